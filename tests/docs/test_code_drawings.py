"""The pictures of the code are those that the code gives."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_stored_drawings_are_those_of_the_code() -> None:
    spec = importlib.util.spec_from_file_location("drawn", ROOT / "docs" / "code_drawings.py")
    assert spec is not None
    assert spec.loader is not None
    drawn = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(drawn)
    pictures = ROOT / "docs" / "pictures"
    assert (pictures / "packages.svg").read_text("utf-8") == drawn.packages_svg()
    assert (pictures / "threads.svg").read_text("utf-8") == drawn.threads_svg()
    folders = {path.parent.name for path in (ROOT / "handcal").glob("*/__init__.py")}
    assert folders == {package for row in drawn.layers() for package in row}
