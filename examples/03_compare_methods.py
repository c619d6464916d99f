"""Solve one session by every method, and show how far their results lie apart.

python examples/03_compare_methods.py [--session FOLDER]

paper: Hu et al. 2021 as published; linear: its model with all three rows of each pair; consistent:
exact factor, robust to cuts and a turned hand; icp: rigid, the paper's baseline.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import handcal
from handcal.cli.terminal import errors_in_one_line
from handcal.core.types import EYES, Method

# icp-open3d would be a fifth, if Open3D is installed.
METHODS: tuple[Method, ...] = ("paper", "linear", "consistent", "icp")
EXAMPLE = Path(__file__).parents[1] / "resources/example_session"


def main() -> None:
    """Print φ of each method, its difference from the session's own method, and the time taken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--session", type=Path, default=EXAMPLE, help="session folder")
    arguments = parser.parse_args()

    session = handcal.open_session(arguments.session)
    own = handcal.solve(session)
    print(f"The session's own method is {own.method}.")
    print(f"{'method':12}{'eye':8}{'φ, mm':>24}{'rms, mm':>10}{'apart, mm':>11}{'seconds':>9}")
    for method in METHODS:
        started_s = time.perf_counter()
        results = handcal.solve(session, method=method)
        seconds = time.perf_counter() - started_s
        for eye in EYES:
            # A session may hold alignments of one eye only.
            if eye not in results.eyes:
                continue
            shift = results.eyes[eye]
            phi_mm = " ".join(f"{value:+7.2f}" for value in 1e3 * shift.shift_m)
            apart_mm = 1e3 * np.linalg.norm(shift.shift_m - own.eyes[eye].shift_m)
            print(
                f"{method:12}{eye:8}{phi_mm:>24}{1e3 * shift.rms_m:>10.2f}"
                f"{apart_mm:>11.2f}{seconds:>9.2f}"
            )


if __name__ == "__main__":
    with errors_in_one_line():
        main()
