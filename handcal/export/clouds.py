"""The clouds of every alignment as PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.export.outcome import SessionOutcome
from handcal.io.files import make_folder, write_ply
from handcal.progress import Progress


def write_clouds(folder: Path, outcome: SessionOutcome, progress: Progress = Progress()) -> None:
    """Write ``alignment-N-cursor.ply`` and ``alignment-N-hand.ply`` for each alignment.

    Points are doubles in W, in metres; `is_cut` is 1 at a cut edge. The hand's
    `residual_left_m` and `residual_right_m`, where solved, are each point's distance to its
    partner on the cursor, NaN for an outlier.
    """
    make_folder(folder)
    solved = outcome.results.alignments if outcome.results else {}
    for done, (number, shifts) in enumerate(solved.items()):
        progress.at(done / len(solved))
        alignment = outcome.record.alignments[number]
        write_ply(
            folder / f"alignment-{number}-cursor.ply",
            alignment.cursor_m,
            properties={"is_cut": alignment.cursor_is_cut.astype(np.uint8)},
        )
        residuals_m = {f"residual_{eye}_m": shift.residuals_m for eye, shift in shifts.items()}
        write_ply(
            folder / f"alignment-{number}-hand.ply",
            alignment.hand_m,
            properties={"is_cut": alignment.hand_is_cut.astype(np.uint8)} | residuals_m,
        )
