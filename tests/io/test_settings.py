"""Settings to JSON and back, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typing_extensions import TypeAliasType

from handcal.calibration.states import CalibrationSettings
from handcal.core.errors import FileError
from handcal.core.types import Float64
from handcal.io.settings import read_settings, settings_json
from handcal.lab.demo import DemoSettings

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@dataclass(frozen=True)
class Inner:
    ratio: float = 0.5
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.ratio < 0.0:
            raise ValueError("ratio is negative; take a positive one")


@dataclass(frozen=True)
class Outer:
    count: int = 1
    name: str = "x"
    is_on: bool = False
    kind: Literal["a", "b"] = "a"
    limit_s: float | None = None
    names: tuple[str, ...] = ()
    inner: Inner = field(default_factory=Inner)


_Scalar = TypeVar("_Scalar", bound=np.generic)
_Array = TypeAliasType(
    "_Array", np.ndarray[tuple[Any, ...], np.dtype[_Scalar]], type_params=(_Scalar,)
)
_Words = TypeAliasType("_Words", tuple[str, ...])


@dataclass(frozen=True, eq=False)
class Aliased:
    """Fields of types that `type` statements name, as NumPy's NDArray from 2.5 on."""

    place_m: _Array[np.float64]
    other_m: Float64 | None = None
    words: _Words = ()


@given(FINITE, st.lists(FINITE, min_size=3, max_size=3), st.none() | FINITE)
def test_every_kind_of_value_comes_back(ratio: float, place: list[float], limit: float) -> None:
    data = {
        "count": 3,
        "name": "y",
        "is_on": True,
        "kind": "b",
        "limit_s": limit,
        "names": ["a", "b", "c"],
        "inner": {"ratio": abs(ratio), "place_m": place},
    }
    settings = read_settings(Outer, data)
    inner = Inner(abs(ratio), (place[0], place[1], place[2]))
    assert settings == Outer(3, "y", True, "b", limit, ("a", "b", "c"), inner)
    assert json.loads(json.dumps(settings_json(settings))) == data


def test_what_is_absent_takes_its_default_and_a_whole_number_serves_as_any() -> None:
    assert read_settings(CalibrationSettings, {}) == CalibrationSettings()
    settings = read_settings(Outer, {"inner": {"ratio": 2}})
    assert settings == Outer(inner=Inner(ratio=2.0))
    assert type(settings.inner.ratio) is float


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ([], "settings must be an object"),
        (None, "settings must be an object"),
        ({"speed": 1}, "settings has no speed, only count, inner, "),
        ({"inner": {"b": 1, "a": 2}}, "settings.inner has no a, b, only place_m, ratio"),
        ({"inner": 3}, "settings.inner must be an object"),
        ({"inner": {"ratio": "1"}}, "settings.inner.ratio must be a finite number, not '1'"),
        ({"inner": {"ratio": True}}, "settings.inner.ratio must be a finite number, not 'True'"),
        ({"inner": {"ratio": math.nan}}, "settings.inner.ratio must be a finite number, not 'nan'"),
        ({"inner": {"ratio": -math.inf}}, "settings.inner.ratio must be a finite number"),
        ({"inner": {"ratio": 10**400}}, "settings.inner.ratio must be a finite number"),
        ({"inner": {"ratio": None}}, "settings.inner.ratio must be a finite number"),
        ({"inner": {"ratio": -1}}, "settings.inner: ratio is negative; take a positive one"),
        ({"inner": {"place_m": [1, 2]}}, "settings.inner.place_m must be a list of 3 values"),
        ({"inner": {"place_m": 1}}, "settings.inner.place_m must be a list of 3 values"),
        ({"inner": {"place_m": [1, 2, "3"]}}, "settings.inner.place_m must be a finite number"),
        ({"names": "abc"}, "settings.names must be a list, not 'abc'"),
        ({"names": ["a", 1]}, "settings.names must be a text, not '1'"),
        ({"count": 1.0}, "settings.count must be a whole number, not '1.0'"),
        ({"count": True}, "settings.count must be a whole number, not 'True'"),
        ({"name": 1}, "settings.name must be a text, not '1'"),
        ({"is_on": 1}, "settings.is_on must be true or false, not '1'"),
        ({"kind": "c"}, "settings.kind must be one of a, b"),
        ({"kind": ["a"]}, "settings.kind must be one of a, b"),
        ({"": 1}, "settings has no field without a name, only count"),
        ({"limit_s": "no"}, "settings.limit_s must be a finite number, not 'no'"),
    ],
)
def test_bad_settings_are_named(data: object, problem: str) -> None:
    with pytest.raises(FileError) as error:
        read_settings(Outer, data)
    assert str(error.value).startswith(problem)


def test_the_stages_own_complaint_carries_its_place() -> None:
    data = {"segment": {"depth_min_m": 0.9}}
    with pytest.raises(FileError, match=r"^mine\.segment: the depth gate 0\.9 to 0\.7 m is empty"):
        read_settings(CalibrationSettings, data, "mine")


@pytest.mark.parametrize("settings", [DemoSettings(seed=3), CalibrationSettings()])
def test_shipped_settings_are_plain_values(settings: Any) -> None:
    stored = json.loads(json.dumps(settings_json(settings)))
    assert read_settings(type(settings), stored) == settings


def test_what_an_alias_names_is_read_as_that() -> None:
    data = {"place_m": [1, 2.5], "other_m": [[3.0], [4.0]], "words": ["a", "b"]}
    read = read_settings(Aliased, data)
    assert read.other_m is not None
    np.testing.assert_array_equal(read.place_m, [1.0, 2.5])
    np.testing.assert_array_equal(read.other_m, [[3.0], [4.0]])
    assert read.place_m.dtype == np.float64
    assert read.words == ("a", "b")
    with pytest.raises(FileError, match=r"^settings\.place_m must be an array of finite numbers"):
        read_settings(Aliased, data | {"place_m": [1.0, "x"]})
    with pytest.raises(FileError, match=r"^settings\.words must be a text, not '3'"):
        read_settings(Aliased, data | {"words": [3]})
