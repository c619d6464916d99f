"""Every visible text of the window is in the catalogue, and is shown translated."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from string import Formatter
from xml.etree import ElementTree

import pytest
from PySide6.QtCore import QCoreApplication, QLocale

from handcal_gui.app import translation
from handcal_gui.app.start import translation_for
from handcal_gui.app.translation import tr, use_translator
from tests.helpers import ROOT

CATALOGUE = ROOT / "resources" / "translations" / "handcal_en.ts"
NO_WINDOW = (
    "app/autopilot", "benchmark.py", "bundle.py", "app/start.py", "app/launch.py", "app/theme.py",
)  # fmt: skip
SOURCES = [
    path
    for path in sorted((ROOT / "handcal_gui").rglob("*.py"))
    if not path.relative_to(ROOT / "handcal_gui").as_posix().startswith(NO_WINDOW)
]
SETTERS = {
    "Column", "Finding", "ImageView", "Table", "PathField", "QAction", "QCheckBox", "QGroupBox",
    "QLabel", "QPushButton", "QRadioButton", "Row", "addAction", "addButton", "addItem", "addMenu",
    "addRow", "addTab", "button", "choice", "label_for", "main_button", "number", "paragraph",
    "setAccessibleDescription", "setAccessibleName", "setHeaderLabels", "setLabelText",
    "setPlaceholderText", "setStatusTip", "setTabText", "setText", "setTitle", "setToolTip",
    "setWhatsThis", "setWindowTitle", "show_message", "show_text", "whole_number", "with_name",
}  # fmt: skip
"""Functions that show a text."""
WITH_IDENTIFIER = {
    "Table", "PathField", "addAction", "addItem", "button", "choice", "main_button", "number",
    "paragraph", "whole_number", "with_name",
}  # fmt: skip
"""Those that also take an identifier, such as an object name."""
NAMES = {"handcal", "OpenIGTLink", "LSL", "mm", "pairing.key"}
_WORD = re.compile(r"[^\W\d_]{2,}")
_IDENTIFIER = re.compile(r"[a-z][\w-]*")
_FILLED = re.compile(r"^[^:</]*(\s\(?[a-z]{4,}\b|\b[a-z]{4,}\s)[^:</]*$")
_SENTENCE = re.compile(r"[A-Z][a-z]+ [a-z]")


def literals(node: ast.AST) -> Iterator[ast.Constant]:
    """Yield the texts below a node, except those that are translated."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "tr":
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node
    for child in ast.iter_child_nodes(node):
        yield from literals(child)


def untranslated(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield lines and texts that are shown, or are sentences, and are not translated."""
    apart = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
    for node in ast.walk(tree):
        is_enum = isinstance(node, ast.ClassDef) and "StrEnum" in map(ast.unparse, node.bases)
        if isinstance(node, ast.Raise) or is_enum:
            apart |= {id(text) for text in literals(node)}
        name = called(node)
        if isinstance(node, ast.Call) and name in SETTERS:
            for one in (*node.args, *(keyword.value for keyword in node.keywords)):
                if is_shown(one, allows_identifier=name in WITH_IDENTIFIER):
                    apart.add(id(one))
                    yield one.lineno, ast.unparse(one)
        if isinstance(node, ast.JoinedStr):
            for text in literals(node):
                if id(text) not in apart and _FILLED.match(str(text.value)):
                    apart.add(id(text))
                    yield text.lineno, str(text.value)
    for text in literals(tree):
        if id(text) not in apart and _SENTENCE.match(str(text.value)):
            yield text.lineno, str(text.value)


def is_shown(argument: ast.expr, *, allows_identifier: bool) -> bool:
    """Return whether an argument is a text that a person reads."""
    shown = argument.value if isinstance(argument, ast.Constant) else ""
    if not isinstance(shown, str) or not _WORD.search(shown) or shown.strip() in NAMES:
        return False
    return not (allows_identifier and _IDENTIFIER.fullmatch(shown))


def called(node: ast.AST) -> str:
    """Return the name of the function that a node calls; empty if it is no call."""
    function = node.func if isinstance(node, ast.Call) else None
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def test_no_visible_text_bypasses_the_catalogue() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in SOURCES
        for line, text in untranslated(ast.parse(path.read_text("utf-8")))
    ]
    assert "\n".join(found) == ""


def test_the_test_finds_texts_that_bypass_the_catalogue() -> None:
    source = """
label.setText("one")
box = QLabel("Two words"), with_name(box, "three", "Four")
_HELP = "Five is a sentence."
name = f"{eye}, measured", f"color: {shade}", f"{kind}-number", f"{share:.1f} px"
fine = tr("Six is translated"), with_name(box, "seven", tr("Eight")), label.setText("")
"""
    found = [text.strip("'") for _, text in untranslated(ast.parse(source))]
    assert found == ["one", "Two words", "Four", ", measured", "Five is a sentence."]


def test_the_catalogue_holds_every_text_once_in_one_context() -> None:
    """If it fails, run ``python docs/translations.py``."""
    root = ElementTree.parse(CATALOGUE).getroot()
    assert [context.findtext("name") for context in root] == [""]
    listed = [one.findtext("source") for one in root.iter("message")]
    written = {
        ast.literal_eval(node.args[0])
        for path in (ROOT / "handcal_gui").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call) and called(node) == "tr"
    }
    assert len(listed) == len(set(listed))
    assert set(listed) == written


def test_placeholders_of_every_text_can_be_filled() -> None:
    for message in ElementTree.parse(CATALOGUE).getroot().iter("message"):
        source, translated = message.findtext("source"), message.findtext("translation")
        assert source is not None
        fields = [part[1:] for part in Formatter().parse(source) if part[1] is not None]
        assert all(name == "" for name, _, _ in fields), source
        if translated:
            assert [part[1:] for part in Formatter().parse(translated) if part[1]] == fields


@pytest.mark.process  # the compiler
def test_a_compiled_translation_is_used(
    tmp_path: Path, qapp: QCoreApplication, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = shutil.which("pyside6-lrelease")
    if compiler is None:
        pytest.skip("pyside6-lrelease is not installed")
    text = CATALOGUE.read_text("utf-8")
    source, empty = "<source>Show hand</source>", '<translation type="unfinished"></translation>'
    assert source in text
    before, after = text.split(source)
    after = after.replace(empty, "<translation>Hand zeigen</translation>", 1)
    (tmp_path / "handcal_de.ts").write_text(before + source + after, "utf-8")
    compiled = tmp_path / "handcal_de.qm"
    subprocess.run([compiler, "-silent", tmp_path / "handcal_de.ts", "-qm", compiled], check=True)
    monkeypatch.setattr(translation, "_translate", [])
    translator = translation_for(QLocale("de_AT"), tmp_path)
    assert translator is not None
    qapp.installTranslator(translator)
    use_translator(lambda text: QCoreApplication.translate("", text))
    assert tr("Show hand") == "Hand zeigen"
    assert tr("Make cursor") == "Make cursor"
    qapp.removeTranslator(translator)


def test_no_object_name_is_made_of_a_shown_text() -> None:
    made = re.compile(r"setObjectName\(.*\.lower\(\)")
    assert [path.name for path in SOURCES if made.search(path.read_text("utf-8"))] == []
