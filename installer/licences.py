"""Collects the licences of everything that a bundle or a setup contains, one folder a package.

    python installer/licences.py FOLDER            # of this environment and its Python
    python installer/licences.py FOLDER WHEEL ...  # of wheels

Fails if a package has no licence that could be collected.
"""

from __future__ import annotations

import re
import sys
import sysconfig
import zipfile
from collections.abc import Iterable, Iterator
from importlib.metadata import distributions
from pathlib import Path, PurePosixPath

_LICENCE = re.compile(r"(licen[cs]e|copying|notice|thirdparty|third-party|authors)", re.IGNORECASE)
_CODE = (".py", ".pyc", ".pyi", ".so", ".dll", ".pyd", ".h")
_COMMON = Path("/usr/share/common-licenses")
_COMMON_TEXTS: dict[str, tuple[str, ...]] = {
    "flatbuffers": ("Apache-2.0",),
    "pyside6_essentials": ("LGPL-3", "GPL-3", "GPL-2"),
    "shiboken6": ("LGPL-3", "GPL-3", "GPL-2"),
    "small_gicp": ("MPL-2.0",),
}
"""Texts of Debian, for wheels without a licence of theirs or of a library in them (Eigen)."""
_TOOLS = {
    "altgraph", "editables", "hatchling", "pathspec", "pip", "pluggy", "pyinstaller_hooks_contrib",
    "setuptools", "tomlkit", "trove_classifiers", "uv",
}  # fmt: skip
"""Packages of the environment that build a bundle, and are not in it."""
_README = """\
Licences of the packages that come with handcal; THIRD-PARTY.md lists them. All are unchanged.

Qt and PySide6 are used under the LGPL 3: their libraries are separate files, which you may
replace with your own build of the same version. Their source is at
https://download.qt.io/official_releases/QtForPython and https://download.qt.io/official_releases/qt;
that of the FFmpeg in opencv-python-headless (LGPL 2.1) at https://github.com/opencv/opencv-python,
that of zeroconf (LGPL 2.1) at https://github.com/python-zeroconf/python-zeroconf.
"""


def is_licence(path: str) -> bool:
    """Return whether a file of a package, by its path in it, is a licence or a notice."""
    place = PurePosixPath(path)
    if path.endswith("/") or place.suffix.lower() in _CODE:
        return False
    in_folder = "dist-info/licenses/" in path or "dist-info/license_files/" in path
    return in_folder or bool(_LICENCE.match(place.name))


def of_wheels(wheels: Iterable[Path]) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Return an iterator over the wheels' packages, with their licences by path."""
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            found = {name: archive.read(name) for name in archive.namelist() if is_licence(name)}
        yield wheel.name.split("-")[0].lower(), found


def of_environment() -> Iterator[tuple[str, dict[str, bytes]]]:
    """Return an iterator over the packages of this environment and Python, with their licences."""
    for package in distributions():
        name = re.sub(r"[-.]+", "_", package.metadata["Name"]).lower()
        if name not in _TOOLS:
            files = [file for file in package.files or () if is_licence(file.as_posix())]
            yield name, {file.as_posix(): Path(file.locate()).read_bytes() for file in files}
    text = Path(sysconfig.get_path("stdlib"), "LICENSE.txt")
    yield "python", {text.name: text.read_bytes()} if text.exists() else {}


def collect(folder: Path, packages: Iterable[tuple[str, dict[str, bytes]]]) -> None:
    """Write the licences into a folder; SystemExit names the packages without any."""
    missing = []
    for name, licences in packages:
        common = _COMMON_TEXTS.get(name, ())
        texts = {f"{text}.txt": (_COMMON / text).read_bytes() for text in common}
        for path, content in (licences | texts).items():
            inner = re.sub(r"^[^/]*\.dist-info/(licenses/)?", "", path)
            file = folder / name / inner.replace("/", "-")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        if not licences and not texts:
            missing.append(name)
    if missing:
        raise SystemExit(f"no licence was found of {', '.join(sorted(missing))}")
    root = Path(__file__).parents[1]
    for name in ("LICENSE", "THIRD-PARTY.md"):
        (folder / name).write_bytes((root / name).read_bytes())
    (folder / "README.txt").write_text(_README, "utf-8")


if __name__ == "__main__":
    wheels = [Path(name) for name in sys.argv[2:]]
    collect(Path(sys.argv[1]), of_wheels(wheels) if wheels else of_environment())
