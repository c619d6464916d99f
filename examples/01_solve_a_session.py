"""Solve a stored session, and print the eye shifts and what the headset renders with.

python examples/01_solve_a_session.py [--session FOLDER] [--method METHOD]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import handcal
from handcal.cli.terminal import errors_in_one_line
from handcal.core.types import METHODS

EXAMPLE = Path(__file__).parents[1] / "resources/example_session"


def main() -> None:
    """Solve, print, and convert for Unity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--session", type=Path, default=EXAMPLE, help="session folder")
    parser.add_argument("--method", choices=METHODS, help="solver (default: the session's own)")
    arguments = parser.parse_args()

    # A session folder holds the rig, the settings and the clouds of every alignment.
    session = handcal.open_session(arguments.session)
    print(f"{len(session.alignments)} alignments of {session.wearer or 'an unnamed wearer'}")

    # φ is where each eye is, from the viewpoint of the offline calibration.
    results = handcal.solve(session, method=arguments.method)
    for eye, shift in results.eyes.items():
        verdict = results.verdicts[eye]
        print(f"{eye}: {shift}")
        print(f"{eye}: {verdict.name}: {verdict.reason}")

    # P takes points in the rendering camera V (metres) to pixels on the display.
    projections = handcal.projections(session.rig, results)
    unity = handcal.to_unity(session.rig, results, near_m=0.1, far_m=100.0)
    with np.printoptions(precision=3, suppress=True):
        for eye, P in projections.items():
            print(f"P, {eye} eye:\n{P}")
            print(f"Unity's projection, {eye} eye:\n{unity[eye].projection}")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
