"""FileStorage text read field by field; errors name the invalid field."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

import cv2
import numpy as np

from handcal.core.types import Float64
from handcal.rig.plausible import require

# OpenCV's parser recurses with the nesting and overflows the stack at 65 kB.
MAX_STORAGE_BYTES = 2**14

_NESTS = re.compile(rb"[\[{<:]|-\s")
"""Openings of a level of nesting in YAML or XML; deeper indentation takes ever more bytes."""
_DEEPEST = 12

Value = TypeVar("Value")


def parse_storage(data: bytes, convert: Callable[[Fields], Value]) -> Value:
    """Return the result of `convert` for FileStorage YAML of at most `MAX_STORAGE_BYTES`.

    Raises
    ------
    ValueError
        If it is not valid FileStorage YAML, or `convert` refuses a field.
    """
    require(data.startswith(b"%YAML"), "not a YAML file as OpenCV and handcal write it")
    try:
        storage = cv2.FileStorage(data.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        return convert(Fields("", storage.root()))
    except (UnicodeDecodeError, cv2.error, SystemError) as error:  # SystemError: not parsable
        raise ValueError("not valid FileStorage YAML") from error


def parse_tree(data: bytes) -> dict[str, Any]:
    """Return FileStorage YAML or XML, or simple YAML of other programs, as maps, lists and values.

    Of several YAML documents, as ``ros2 topic echo`` prints them, it is the first.

    Raises
    ------
    ValueError
        If it cannot be parsed, is no map of fields, or is nested as no calibration is.
    """
    data = data.replace(b"\r\n", b"\n").removeprefix(b"\xef\xbb\xbf").lstrip()
    if not data.startswith(b"<?xml"):
        data = _as_storage(data)
    require(len(_NESTS.findall(data)) <= MAX_STORAGE_BYTES, "it is nested too deeply")
    try:
        storage = cv2.FileStorage(data.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        tree = _tree(storage.root(), _DEEPEST)
    except (UnicodeDecodeError, cv2.error, SystemError) as error:
        raise ValueError("not valid YAML or XML") from error
    if not isinstance(tree, dict):
        raise ValueError("the file must be a map of fields")
    return tree


def _as_storage(data: bytes) -> bytes:
    """Return the first document of YAML in the dialect that OpenCV reads."""
    is_own = data.startswith(b"%YAML")
    documents = re.split(rb"(?m)^---.*$", re.sub(rb"(?m)^%YAML.*$", b"", data))
    first = next((one for one in documents if one.strip()), b"")
    if not is_own:
        first = re.sub(rb"!!python/\S+", b"", first)
        first = re.sub(rb",[ \t]*\n\s*", b", ", first)  # lists go on at any indentation
        # A key without a value is refused by OpenCV.
        first = re.sub(rb"(?m)^( *)([\w./]+):[ \t]*\n(?!\1 +\S|\1- )", rb'\1\2: ""\n', first)
        # PyYAML does not indent a list below its key; OpenCV requires it.
        first = re.sub(rb"(?m)^( *)- ", rb"\1  - ", first)
    return b"%YAML 1.2\n---\n" + first


def _tree(node: cv2.FileNode, levels: int) -> object:
    require(levels > 0, "it is nested too deeply")
    if node.isMap():
        return {key: _tree(node.getNode(key), levels - 1) for key in node.keys()}  # noqa: SIM118
    if node.isSeq():
        return [_tree(node.at(index), levels - 1) for index in range(node.size())]
    if node.isString():
        return node.string()
    return int(node.real()) if node.isInt() else node.real() if node.isReal() else None


class Fields:
    """A map node whose fields are fetched by kind, with a ValueError that names the bad one."""

    def __init__(self, name: str, node: cv2.FileNode) -> None:
        require(node.isMap(), f"{name or 'the file'} must be a map of fields")
        self._prefix = f"{name}." if name else ""
        self._node = node

    def has(self, name: str) -> bool:
        """Return whether the field exists."""
        return not self._node.getNode(name).empty()

    def section(self, name: str) -> Fields:
        """Return a map among the fields."""
        return Fields(self._prefix + name, self._node.getNode(name))

    def part(self, name: str, convert: Callable[[Fields], Value]) -> Value | None:
        """Return what `convert` makes of a map among the fields; None without it."""
        return convert(self.section(name)) if self.has(name) else None

    def text(self, name: str) -> str:
        """Return a text."""
        node = self._node.getNode(name)
        require(node.isString(), f"{self._prefix}{name} must be a text")
        return node.string()

    def number(self, name: str) -> float:
        """Return a number."""
        return _number(self._prefix + name, self._node.getNode(name))

    def integer(self, name: str) -> int:
        """Return a whole number."""
        node = self._node.getNode(name)
        require(node.isInt(), f"{self._prefix}{name} must be a whole number")
        return int(node.real())

    def numbers(self, name: str) -> tuple[float, ...]:
        """Return a list of numbers."""
        node = self._node.getNode(name)
        full_name = self._prefix + name
        require(node.isSeq(), f"{full_name} must be a list of numbers")
        return tuple(_number(full_name, node.at(index)) for index in range(node.size()))

    def texts(self, name: str) -> tuple[str, ...]:
        """Return the field's texts, one or more."""
        node = self._node.getNode(name)
        items = [node.at(index) for index in range(node.size())] if node.isSeq() else []
        require(
            bool(items) and all(item.isString() for item in items),
            f"{self._prefix}{name} must be a list of texts",
        )
        return tuple(item.string() for item in items)

    def matrix(self, name: str, rows: int, columns: int) -> Float64:
        """Return an opencv-matrix of doubles of the given size."""
        return self._matrix(name, rows, columns, str(rows))

    def rows(self, name: str, columns: int, most: int) -> Float64:
        """Return an opencv-matrix of doubles with 1 to `most` rows of `columns`."""
        rows = self._node.getNode(name).getNode("rows").real() if self.has(name) else 0
        return self._matrix(name, rows if rows in range(1, most + 1) else 0, columns, "N")

    def _matrix(self, name: str, rows: float, columns: int, rows_text: str) -> Float64:
        node = self._node.getNode(name)
        # The size is checked before OpenCV allocates memory for it.
        require(
            node.isMap()
            and rows > 0
            and node.getNode("rows").real() == rows
            and node.getNode("cols").real() == columns
            and node.getNode("dt").string() == "d"
            and node.getNode("data").size() == rows * columns,
            f"{self._prefix}{name} must be a {rows_text}×{columns} opencv-matrix of type d",
        )
        return np.asarray(node.mat(), dtype=np.float64)


def _number(name: str, node: cv2.FileNode) -> float:
    require(node.isReal() or node.isInt(), f"{name} must be a number")
    return node.real()
