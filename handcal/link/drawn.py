"""Digest of the drawn projections and cursor, by which the PC checks what the headset draws."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from handcal.core.types import EYES, Eye, Projection
from handcal.link import handcal_pb2 as pb

DIGEST_BYTES = 16


def drawn_projections(
    projections: Mapping[Eye, Projection], is_offline: bool
) -> dict[Eye, Projection]:
    """Return the projections to draw with: the given ones, or those of the offline calibration."""
    if not is_offline:
        return dict(projections)
    return {
        eye: shown if shown.P_offline is None else replace(shown, P=shown.P_offline)
        for eye, shown in projections.items()
    }


def drawn_digest(projections: Mapping[Eye, Projection], cursor: pb.Cursor | None) -> bytes:
    """Return the first 16 bytes of SHA-256 over what is drawn, little endian.

    For the left, then the right eye: one byte 0 without a projection; else 1, the twelve numbers
    of P and of T_V_H by rows as float64, width and height as uint32. Then the cursor's id as
    uint32, and the origin (float64) and offsets of its points as in the message; without a cursor
    nothing but an id of 0.

    Parameters
    ----------
    projections : mapping of eye to Projection
        With the P that is drawn: the offline one while that is shown.
    cursor : Cursor or None
        The message by which the cursor came.
    """
    digest = hashlib.sha256()
    for eye in EYES:
        projection = projections.get(eye)
        digest.update(bytes([projection is not None]))
        if projection is not None:
            matrices = np.concatenate([projection.P, projection.T_V_H[:3]])
            digest.update(matrices.astype("<f8").tobytes())
            digest.update(struct.pack("<II", projection.width_px, projection.height_px))
    digest.update(struct.pack("<I", 0 if cursor is None else cursor.cursor_id))
    if cursor is not None:
        digest.update(np.array(cursor.points.origin_m, "<f8").tobytes() + cursor.points.offsets)
    return digest.digest()[:DIGEST_BYTES]
