"""Plain English in docstrings, comments, messages and the documentation: no banned words."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.helpers import ROOT

QUESTION = re.compile(r"(What|Whether|How|Where|Which|Who|When|Why)\b")
BANNED = [
    "lest", "anew", "amid", "whoever", "thereof", "as it were", "gone on with", "broken off",
    "to be mended", "is told", "comes to", "so long(?! as)", "tells? whether",
]  # fmt: skip
# A phrase may continue in the next line of a comment or part of a string.
BETWEEN = re.compile(r"[\s\"'#]+")
WORDS = re.compile(rf"\b({'|'.join(BANNED).replace(' ', BETWEEN.pattern)})\b", re.IGNORECASE)
SUSPECT = re.compile(rf"[\"']\s*{QUESTION.pattern}|{WORDS.pattern}", re.IGNORECASE)
"""Found in every source of which there is something to complain."""


def sources() -> list[Path]:
    """Return the files to check: code, tests, examples and pages."""
    folders = "handcal", "handcal_gui", "docs", "examples", "tests"
    code = [path for name in folders for path in (ROOT / name).rglob("*.py")]
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    return sorted(path for path in code + pages if not path.stem.endswith("_pb2"))


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and text of each docstring; a string under a field is one too."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield node.lineno, node.value.value


def names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and words of the name of each function and class."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name.replace("_", " ")


def is_suspect(source: str) -> bool:
    """Return whether a source is worth parsing, which takes a hundred times longer."""
    return SUSPECT.search(source.replace("_", " ")) is not None


def complaints(source: str, kind: str) -> list[str]:
    """Return what is not plain in a text of a kind: ``package``, ``tests`` or ``text``."""
    tree = ast.parse("" if kind == "text" else source)
    documented = list(docstrings(tree))
    searched = documented if kind == "tests" else [(1, source)]
    searched = [*searched, *names(tree)]
    found = [
        (line, f"begins with {match[1]}")
        for line, text in documented
        if (match := QUESTION.match(text.lstrip()))
    ] + [
        (line + text.count("\n", 0, match.start()), f"says {BETWEEN.sub(' ', match[1])!r}")
        for line, text in searched
        for match in WORDS.finditer(text)
    ]
    return [f"{line}: {complaint}" for line, complaint in sorted(found)]


def test_files_are_in_plain_english() -> None:
    wrong = []
    for path in sources():
        name = path.relative_to(ROOT).as_posix()
        kind = "text" if path.suffix == ".md" else "tests" if name[:6] == "tests/" else "package"
        source = path.read_text("utf-8")
        found = complaints(source, kind) if is_suspect(source) else []
        wrong += [f"{name}:{complaint}" for complaint in found]
    assert wrong == []
