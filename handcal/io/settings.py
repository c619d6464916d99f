"""Settings as JSON: the settings of each stage are a frozen dataclass of plain values."""

from __future__ import annotations

import sys
import types
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError

Settings = TypeVar("Settings")


def settings_json(settings: Any) -> dict[str, Any]:
    """Return a settings dataclass, with nested ones, as values for JSON."""
    return asdict(settings)


def read_settings(kind: type[Settings], data: object, where: str = "settings") -> Settings:
    """Return settings of a kind from JSON values; absent fields take their defaults.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are numbers, texts, booleans, tuples, mappings or arrays of them,
        or such dataclasses.
    data : object
        As `json.loads` gives it.
    where : str
        Name of `data` in error messages.

    Raises
    ------
    FileError
        For an unknown name, a value of the wrong type, or one that the settings refuse.
    """
    if not isinstance(data, Mapping):
        raise FileError(f"{where} must be an object")
    hints = get_type_hints(kind)
    names = {field.name for field in fields(kind)}  # type: ignore[arg-type]
    unknown = sorted(str(name) for name in set(data) - names)
    if unknown:
        shown = ", ".join(name or "field without a name" for name in unknown)
        raise FileError(f"{where} has no {shown}, only {', '.join(sorted(names))}")
    values = {name: _convert(hints[name], value, f"{where}.{name}") for name, value in data.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise FileError(f"{where}: {error}") from error


def _convert(kind: Any, value: object, where: str) -> Any:
    """Convert a JSON value to the declared type of a field."""
    alias = getattr(kind, "__value__", None)
    if alias is not None:  # of a `type` statement, as NumPy's NDArray from 2.5 on
        parts = get_args(kind)
        return _convert(alias[parts] if parts else alias, value, where)
    origin, choices = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in choices:
            return None
        texts = [text for kind in choices if get_origin(kind) is Literal for text in get_args(kind)]
        if isinstance(value, str) and value in texts:
            return value
        return _convert(
            next(choice for choice in choices if choice is not type(None)), value, where
        )
    if origin is Literal:
        if value in choices:
            return value
        raise FileError(f"{where} must be one of {', '.join(map(str, choices))}")
    if origin is tuple and isinstance(value, list) and choices[-1] is Ellipsis:
        return tuple(_convert(choices[0], part, where) for part in value)
    if origin is tuple and isinstance(value, list) and len(value) == len(choices):
        return tuple(_convert(kind, part, where) for kind, part in zip(choices, value, strict=True))
    if origin is Mapping and isinstance(value, Mapping):
        return {
            _convert(choices[0], name, where): _convert(choices[1], part, f"{where}.{name}")
            for name, part in value.items()
        }
    if origin is np.ndarray and isinstance(value, list):
        return _array(value, where)
    if is_dataclass(kind) and isinstance(kind, type):
        return read_settings(kind, value, where)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and is_number and abs(value) <= sys.float_info.max:  # type: ignore[arg-type]
        return float(value)  # type: ignore[arg-type]
    if kind in (int, str, bool) and type(value) is kind:
        return value
    raise FileError(f"{where} must be {_name(kind, choices)}, not {str(value)[:40]!r}")


def _array(value: list[Any], where: str) -> NDArray[np.float64]:
    try:
        array = np.array(value, np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.array(np.nan)
    if not np.isfinite(array).all():
        raise FileError(f"{where} must be an array of finite numbers")
    return array


def _name(kind: Any, choices: tuple[Any, ...]) -> str:
    if get_origin(kind) is tuple:
        return "a list" if choices[-1] is Ellipsis else f"a list of {len(choices)} values"
    return {float: "a finite number", int: "a whole number", bool: "true or false"}.get(
        kind, "a text"
    )
