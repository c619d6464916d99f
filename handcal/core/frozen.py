"""Helpers for frozen dataclasses: read-only arrays, and short texts of their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

_FEW = 6  # items that `brief` shows


def readonly(values: ArrayLike, dtype: DTypeLike, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return `values` as a read-only, C-ordered array of `dtype`; copy only if necessary.

    Parameters
    ----------
    values : array_like
    dtype : dtype
    shape : tuple of int or None
        Required shape; None matches any length.

    Raises
    ------
    ValueError
        If the shape does not match.
    """
    array = np.asarray(values, dtype=dtype, order="C").view()
    if len(array.shape) != len(shape) or any(
        want is not None and got != want for got, want in zip(array.shape, shape, strict=True)
    ):
        wanted = "×".join("N" if want is None else str(want) for want in shape)
        got = "×".join(map(str, array.shape)) or "scalar"
        raise ValueError(f"expected an array of shape {wanted}, got {got}")
    array.flags.writeable = False
    return array


def freeze(instance: object, name: str, dtype: DTypeLike, *shape: int | None) -> None:
    """Make an array field of a frozen dataclass read-only; called from its ``__post_init__``.

    None stays None. ValueError names the field whose shape does not match.
    """
    value = getattr(instance, name)
    if value is not None:
        try:
            object.__setattr__(instance, name, readonly(value, dtype, shape))
        except ValueError as error:
            raise ValueError(f"{type(instance).__name__}.{name}: {error}") from None


def require_kind(name: str, value: object, kind: type) -> None:
    """Raise TypeError, which names the argument, if a value is not of a kind."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be of type {kind.__name__}, not {type(value).__name__}")


def brief(instance: Any) -> str:
    """Return a dataclass as one line, large arrays by type and shape: a ``__repr__``."""
    values = ", ".join(
        f"{field.name}={_brief(getattr(instance, field.name))}" for field in fields(instance)
    )
    return f"{type(instance).__name__}({values})"


def html_table(rows: Sequence[Sequence[str]]) -> str:
    """Return a table for notebooks; the first row and the first column are its headings."""
    head, *body = ([escape(cell) for cell in row] for row in rows)
    lines = ["".join(f"<th>{cell}</th>" for cell in head)]
    for name, *cells in body:
        lines.append(f"<th>{name}</th>" + "".join(f"<td>{cell}</td>" for cell in cells))
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _brief(value: object) -> str:
    if isinstance(value, np.ndarray):
        if value.size <= _FEW:
            return np.array2string(value, precision=6, separator=", ").replace("\n", "")
        return f"{value.dtype} {value.shape}"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key!r}: {_brief(item)}' for key, item in value.items())}}}"
    if isinstance(value, tuple) and len(value) > _FEW:
        return f"<{len(value)} items>"
    if isinstance(value, tuple):
        return f"({', '.join(map(_brief, value))})"
    return repr(value)
