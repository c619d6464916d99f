"""The catalogue of the window's texts, and a run of the window in a made-up language.

::

    python docs/translations.py            collects the texts into resources/translations
    python docs/translations.py pseudo DIR runs the window in the made-up language, saves pictures
                                           to DIR, and lists what is not translated or cut off
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CATALOGUE = ROOT / "resources" / "translations" / "handcal_en.ts"
_ACCENTS = str.maketrans("AEIOUYaeiouycns", "ÀÉÎÖÛÝàéîöûýçñš")
_KEPT = re.compile(r"(\{[^}]*\}|<[^>]*>|&)")
_PLAIN = re.compile(r"[A-Za-z]*[aeiou][A-Za-z]*")
_LONGER = 0.3
"""Share by which texts of other languages are longer than English ones."""


def update(catalogue: Path = CATALOGUE) -> None:
    """Collect the texts of the window into a catalogue; translations in it are kept."""
    sources = sorted(map(str, (ROOT / "handcal_gui").rglob("*.py")))
    command = ["pyside6-lupdate", "-silent", "-no-obsolete", "-locations", "none"]
    command += ["-source-language", "en", "-target-language", "en", *sources, "-ts", str(catalogue)]
    subprocess.run(command, check=True)  # noqa: S603


def pseudo(text: str) -> str:
    """Return a text in the made-up language: accented and longer, with its placeholders."""
    parts = _KEPT.split(text)
    made = "".join(one if _KEPT.fullmatch(one) else one.translate(_ACCENTS) for one in parts)
    return made + "·" * round(_LONGER * len(text)) if len(text) > 1 else made


def run_pseudo(folder: Path) -> None:
    """Let the program operate itself in the made-up language; list what is wrong on its pages."""
    from handcal_gui.app.translation import use_translator

    use_translator(pseudo)
    from PySide6.QtWidgets import QApplication, QWidget

    from handcal_gui.app import start
    from handcal_gui.app.autopilot.screenshots import Screenshots

    said: set[str] = set()
    save = Screenshots.save

    def save_and_look(shots: Screenshots, name: str, widget: QWidget | None = None) -> None:
        save(shots, name, widget)
        for top in QApplication.topLevelWidgets():
            for one in [top, *top.findChildren(QWidget)] if top.isVisible() else ():
                for line in faults(one):
                    if line not in said:
                        said.add(line)
                        sys.stdout.write(f"{name}: {line}\n")

    Screenshots.save = save_and_look  # type: ignore[method-assign]
    start.translate_texts = lambda _app: None  # the made-up language stays
    folder.mkdir(parents=True, exist_ok=True)
    arguments = ["--screenshots", folder, "--output", folder / "output", "--seed", "3"]
    arguments += ["--preferences", folder / "preferences.json", "--size", "1366x768"]
    sys.argv[1:] = map(str, arguments)
    start.main()


def faults(widget: object) -> list[str]:
    """Return what is not translated or cut off in a visible widget."""
    from PySide6.QtWidgets import QAbstractButton, QComboBox, QLabel, QTabWidget, QWidget

    if not isinstance(widget, QWidget) or not widget.isVisible():
        return []
    texts = [widget.toolTip(), widget.windowTitle(), *(one.text() for one in widget.actions())]
    if isinstance(widget, QLabel | QAbstractButton):
        texts.append(widget.text())
    if isinstance(widget, QTabWidget):
        texts += [widget.tabText(one) for one in range(widget.count())]
    if isinstance(widget, QComboBox):
        texts += [widget.itemText(one) for one in range(widget.count())]
    found = [f"not translated: {text!r}" for text in texts if _PLAIN.search(text)]
    narrow = isinstance(widget, QAbstractButton) or (
        isinstance(widget, QLabel) and not widget.wordWrap() and widget.pixmap().isNull()
    )
    if narrow and widget.width() + 1 < widget.minimumSizeHint().width():
        found.append(f"cut off: {texts[-1]!r}")
    return found


if __name__ == "__main__":
    if sys.argv[1:2] == ["pseudo"] and len(sys.argv) == 3:
        run_pseudo(Path(sys.argv[2]))
    else:
        update()
