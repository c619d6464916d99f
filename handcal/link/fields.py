"""Fields of messages: made of arrays, and checked when they are read.

Every reader raises `MalformedError` for what no correct peer sends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handcal.core.geometry import is_rigid
from handcal.core.types import EYES, Eye, Float64
from handcal.link import handcal_pb2 as pb

MAX_DISPLAY_PX = 65_535
EYE_CODES: Mapping[Eye, pb.Eye] = {"left": pb.EYE_LEFT, "right": pb.EYE_RIGHT}
_EYES: Mapping[int, Eye] = {code: eye for eye, code in EYE_CODES.items()}
_REACH_M = 1e3


class MalformedError(Exception):
    """A message that no correct peer sends."""


def read_eyes(codes: Sequence[int]) -> tuple[Eye, ...]:
    """Read a list of eyes."""
    if len(codes) > len(EYES):
        raise MalformedError("more eyes than two")
    return tuple(read_eye(code) for code in codes)


def flat(T: Float64) -> list[float]:
    """Return a pose as the 12 numbers of its upper rows."""
    numbers: list[float] = np.asarray(T, dtype=np.float64)[:3].ravel().tolist()
    return numbers


def read_numbers(values: Sequence[float], count: int) -> Float64:
    """Read this many finite numbers, (count,)."""
    numbers = np.array(values, dtype=np.float64)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise MalformedError(f"expected {count} finite numbers")
    return numbers


def read_rigid(values: Sequence[float]) -> Float64:
    """Read a pose, (4, 4)."""
    T = np.vstack([read_numbers(values, 12).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
    if not is_rigid(T, _REACH_M):
        raise MalformedError("a pose that is not a rotation and a translation")
    T.flags.writeable = False
    return T


def read_eye(code: int) -> Eye:
    """Read an eye."""
    eye = _EYES.get(code)
    if eye is None:
        raise MalformedError(f"unknown eye {code}")
    return eye


def read_text(text: str, most: int) -> str:
    """Return a text of at most this many characters, without control characters."""
    if not is_text(text, most):
        raise MalformedError(f"a text of more than {most} characters, or with control characters")
    return text


def is_text(text: str, most: int) -> bool:
    """Return whether a text is short enough, and all of it is seen.

    Some terminals take the controls U+0080 to U+009F as orders, and those of bidirectional text let
    a name be read as another.
    """
    return len(text) <= most and text.replace("\N{NO-BREAK SPACE}", " ").isprintable()


def read_size(width_px: int, height_px: int) -> tuple[int, int]:
    """Read the size of a display."""
    if not (0 < width_px <= MAX_DISPLAY_PX and 0 < height_px <= MAX_DISPLAY_PX):
        raise MalformedError("a display of an impossible size")
    return width_px, height_px
