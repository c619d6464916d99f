"""FileStorage text read field by field; errors name the invalid field."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import cv2
import numpy as np

from handcal.core.types import Float64
from handcal.rig.check import require

# OpenCV's parser recurses with the nesting and overflows the stack at 65 kB.
MAX_STORAGE_BYTES = 2**14

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
