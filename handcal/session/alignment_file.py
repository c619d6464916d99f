"""Lossless encoding of one alignment as the bytes of an uncompressed .npz archive."""

from __future__ import annotations

import io
import tokenize
import zipfile
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from handcal.core.types import EYES, Alignment, Eye

_DTYPES = {
    "cursor_m": "<f8",
    "hand_m": "<f8",
    "cursor_is_cut": "|b1",
    "hand_is_cut": "|b1",
    "rotation_rad": "<f8",
    "t_ns": "<i8",
    "eyes": "<U5",
    "time_sigma_m": "<f8",
    "outline_sigma_px": "<f8",
} | {f"{name}_{eye}": "<f8" for name in ("T_E_W", "drawn_shift_m") for eye in EYES}

# Raised by zipfile, numpy's header parser and ndarray on damaged archives, besides ValueError.
_DAMAGE = (
    zipfile.BadZipFile,
    RuntimeError,
    EOFError,
    TypeError,
    SyntaxError,
    tokenize.TokenError,
)


def encode_alignment(alignment: Alignment) -> bytes:
    """Return `alignment` as a .npz archive.

    It contains `cursor_m`, `hand_m`, `cursor_is_cut`, `hand_is_cut` and `rotation_rad` as in
    `Alignment`, `t_ns` (t_a, t_b), `eyes`, `time_sigma_m` unless it is 0, `outline_sigma_px` if it
    is known, and for each eye that has them `T_E_W` and `drawn_shift_m`, named `T_E_W_left` and so
    on.
    """
    arrays: dict[str, Any] = {
        "cursor_m": alignment.cursor_m,
        "hand_m": alignment.hand_m,
        "cursor_is_cut": alignment.cursor_is_cut,
        "hand_is_cut": alignment.hand_is_cut,
        "rotation_rad": alignment.rotation_rad,
        "t_ns": [alignment.t_a_ns, alignment.t_b_ns],
        "eyes": alignment.eyes,
    }
    if alignment.time_sigma_m:
        arrays["time_sigma_m"] = alignment.time_sigma_m
    if alignment.outline_sigma_px is not None:
        arrays["outline_sigma_px"] = alignment.outline_sigma_px
    arrays |= {f"T_E_W_{eye}": T for eye, T in alignment.T_E_W.items()}
    arrays |= {f"drawn_shift_m_{eye}": shift for eye, shift in alignment.drawn_shift_m.items()}
    stream = io.BytesIO()
    np.savez(
        stream,
        allow_pickle=False,
        **{name: np.asarray(value, _DTYPES[name], order="C") for name, value in arrays.items()},
    )
    return stream.getvalue()


def decode_alignment(data: bytes) -> Alignment:
    """Return the alignment in a .npz archive, without allocating more than its own length.

    Raises
    ------
    ValueError
        If the archive is damaged or contains anything else.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            arrays = {
                info.filename.removesuffix(".npy"): _decode_array(archive, info)
                for info in archive.infolist()
            }
        t_a_ns, t_b_ns = map(int, arrays["t_ns"])
        return Alignment(
            cursor_m=arrays["cursor_m"],
            hand_m=arrays["hand_m"],
            cursor_is_cut=arrays["cursor_is_cut"],
            hand_is_cut=arrays["hand_is_cut"],
            T_E_W=_of_eyes(arrays, "T_E_W"),
            drawn_shift_m=_of_eyes(arrays, "drawn_shift_m"),
            eyes=tuple(map(str, arrays["eyes"])),  # type: ignore[arg-type]
            rotation_rad=arrays["rotation_rad"],
            t_a_ns=t_a_ns,
            t_b_ns=t_b_ns,
            time_sigma_m=float(arrays.get("time_sigma_m", 0.0)),
            outline_sigma_px=(
                float(arrays["outline_sigma_px"]) if "outline_sigma_px" in arrays else None
            ),
        )
    except KeyError as error:
        raise ValueError(f"the alignment has no array {error}") from error
    except _DAMAGE as error:
        raise ValueError(f"the alignment is damaged: {error}") from error


def _of_eyes(arrays: dict[str, NDArray[Any]], name: str) -> dict[Eye, NDArray[Any]]:
    return {eye: arrays[key] for eye in EYES if (key := f"{name}_{eye}") in arrays}


def _decode_array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{info.filename} is compressed; alignments are stored uncompressed")
    data = archive.read(info)
    start = 10 + int.from_bytes(data[8:10], "little")
    shape, fortran_order, dtype = _parse_header(data[:start])
    wanted = _DTYPES.get(info.filename.removesuffix(".npy"))
    if dtype.str != wanted or fortran_order:
        raise ValueError(f"{info.filename} holds {dtype.str}, not {wanted} in C order")
    # Creating a view fails if the header declares more bytes than there are.
    return np.ndarray(shape, dtype, data, start).copy()


@lru_cache(64)  # most are the same in all alignments, and NumPy takes its time
def _parse_header(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    stream = io.BytesIO(header)
    if npy.read_magic(stream) != (1, 0):
        raise ValueError("is not a version 1.0 array")
    return npy.read_array_header_1_0(stream)
