"""Plain English in docstrings, comments, messages and the documentation.

`tests/data/not_rewritten.txt` lists the files that have yet to be rewritten. A file that has become
clean must leave the list: delete its line, or run this test once with ``HANDCAL_LANGUAGE=write``,
which removes such lines and never adds one.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import DATA, ROOT

NOT_REWRITTEN = DATA / "not_rewritten.txt"
QUESTION = re.compile(r"(What|Whether|How|Where|Which|Who|When|Why)\b")
BANNED = [
    "lest", "anew", "amid", "whoever", "thereof", "as it were", "gone on with", "broken off",
    "to be mended", "is told", "comes to", "so long(?! as)", "tells? whether",
]  # fmt: skip
# A phrase may continue in the next line of a comment or part of a string.
BETWEEN = re.compile(r"[\s\"'#]+")
WORDS = re.compile(rf"\b({'|'.join(BANNED).replace(' ', BETWEEN.pattern)})\b", re.IGNORECASE)


def sources() -> list[Path]:
    packages = [path for name in ("handcal", "handcal_gui") for path in (ROOT / name).rglob("*.py")]
    texts = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "tests").rglob("*.py")]
    return sorted(path for path in packages + texts if not path.stem.endswith("_pb2"))


def docstrings(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of each docstring; a string under a field is one too."""
    for node in ast.walk(ast.parse(source)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield node.lineno, node.value.value


def complaints(source: str, kind: str) -> list[str]:
    """Return what is not plain in a text of a kind: ``package``, ``tests`` or ``text``."""
    documented = [] if kind == "text" else list(docstrings(source))
    searched = documented if kind == "tests" else [(1, source)]
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


@pytest.fixture(scope="module")
def unclean() -> dict[str, list[str]]:
    """Return the complaints about each file that has any, by its path in the project."""
    found = {}
    for path in sources():
        name = path.relative_to(ROOT).as_posix()
        kind = "text" if path.suffix == ".md" else "tests" if name[:6] == "tests/" else "package"
        if about := complaints(path.read_text("utf-8"), kind):
            found[name] = about
    return found


def not_rewritten() -> list[str]:
    return NOT_REWRITTEN.read_text("utf-8").splitlines() if NOT_REWRITTEN.exists() else []


def test_files_are_in_plain_english(unclean: dict[str, list[str]]) -> None:
    wrong = [
        f"{name}:{complaint}"
        for name in sorted(unclean.keys() - set(not_rewritten()))
        for complaint in unclean[name]
    ]
    assert wrong == []


def test_the_list_of_files_to_rewrite_only_shrinks(unclean: dict[str, list[str]]) -> None:
    listed = not_rewritten()
    if os.environ.get("HANDCAL_LANGUAGE") == "write":
        NOT_REWRITTEN.write_text("".join(f"{name}\n" for name in listed if name in unclean))
        listed = not_rewritten()
    clean = [name for name in listed if name not in unclean]
    assert clean == [], f"remove these lines from {NOT_REWRITTEN.relative_to(ROOT)}"
    assert listed == sorted(set(listed))


@pytest.mark.parametrize(
    ("source", "kind", "expected"),
    [
        ('"""What a hand is."""', "package", ["1: begins with What"]),
        (
            'class A:\n    """A."""\n\n    x: int\n    """\n    Who."""',
            "tests",
            ["5: begins with Who"],
        ),
        ('"""However."""', "package", []),
        ("# Lest it end.", "package", ["1: says 'Lest'"]),
        ("# Lest it end.", "tests", []),
        ("x = 1\ny = (\n    'it is '\n    'told'\n)", "package", ["3: says 'is told'"]),
        ("It is so\nlong. It is so long as it is.", "text", ["1: says 'so long'"]),
        ("A pyramid was molested.", "text", []),
        ("It tells whether.", "text", ["1: says 'tells whether'"]),
    ],
)
def test_what_is_not_plain_is_found(source: str, kind: str, expected: list[str]) -> None:
    assert complaints(source, kind) == expected
