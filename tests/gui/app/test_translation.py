"""Every visible text of the window is marked with `tr`."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from tests.helpers import ROOT

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


def test_no_visible_text_lacks_its_mark() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in SOURCES
        for line, text in untranslated(ast.parse(path.read_text("utf-8")))
    ]
    assert "\n".join(found) == ""
