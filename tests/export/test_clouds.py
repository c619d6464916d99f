"""The PLY files, read back to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handcal.export.clouds import write_clouds
from handcal.export.outcome import SessionOutcome
from handcal.progress import Progress

KINDS = {"double": "<f8", "uchar": "u1"}


def read(path: Path) -> NDArray[Any]:
    header, body = path.read_bytes().split(b"end_header\n", 1)
    fields = [line.split()[1:] for line in header.decode().splitlines() if line[:8] == "property"]
    return np.frombuffer(body, [(name, KINDS[kind]) for kind, name in fields])


def test_clouds_and_residuals_come_back(tmp_path: Path, outcome: SessionOutcome) -> None:
    shares: list[float] = []
    write_clouds(tmp_path / "clouds", outcome, Progress(lambda _what, share: shares.append(share)))
    assert shares == [0.0, 0.5]
    assert sorted(path.name for path in (tmp_path / "clouds").iterdir()) == [
        f"alignment-{number}-{which}.ply" for number in (1, 3) for which in ("cursor", "hand")
    ]
    assert outcome.results is not None
    assert list(outcome.record.alignments) == list(outcome.results.alignments) == [1, 3]
    for number, alignment in outcome.record.alignments.items():
        shifts = outcome.results.alignments[number]
        cursor = read(tmp_path / "clouds" / f"alignment-{number}-cursor.ply")
        hand = read(tmp_path / "clouds" / f"alignment-{number}-hand.ply")
        for points, expected_m in ((cursor, alignment.cursor_m), (hand, alignment.hand_m)):
            assert np.array_equal(np.column_stack([points[axis] for axis in "xyz"]), expected_m)
        assert np.array_equal(hand["is_cut"], alignment.hand_is_cut)
        names = [f"residual_{eye}_m" for eye in shifts]
        assert list(hand.dtype.names or ()) == ["x", "y", "z", "is_cut", *names]
        for eye, shift in shifts.items():
            residuals_m = hand[f"residual_{eye}_m"]
            assert np.array_equal(residuals_m, shift.residuals_m, equal_nan=True)
