"""Calibrate simulated wearers, whose true eyes are known, and print how far off the results are.

python examples/04_simulate_wearers.py [--wearers N] [--alignments K] [--method METHOD]
"""

from __future__ import annotations

import argparse

import numpy as np

from handcal.cli.terminal import errors_in_one_line
from handcal.core.display import reprojection_arcmin
from handcal.core.types import EYES, METHODS, Eye, Float64
from handcal.lab.study.wearers import align_hand, draw_wearer
from handcal.register.results import SolveSettings, solve_session
from handcal.sim.wearer_settings import WearerSettings

NOT_CALIBRATED: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}


def main() -> None:
    """Draw wearers, let each align the hand, solve, and compare with the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wearers", type=int, default=5)
    parser.add_argument("--alignments", type=int, default=1, help="of each wearer")
    parser.add_argument("--method", choices=METHODS, default="consistent")
    arguments = parser.parse_args()

    placement = WearerSettings()  # how the headset sits, and how closely people align
    errors_arcmin = []
    for seed in range(1, arguments.wearers + 1):
        rng = np.random.default_rng(seed)
        wearer = draw_wearer(rng, hand_seed=seed, placement=placement)
        # The wearer lays the hand over its frozen cursor, which both eyes see.
        alignments = [
            align_hand(
                wearer,
                rng,
                eyes=EYES,
                drawn_shift_m=NOT_CALIBRATED,
                placement=placement,
                points=5000,
                depth_sigma_m=0.001,
            )
            for _ in range(arguments.alignments)
        ]
        results = solve_session(alignments, wearer.rig, SolveSettings(method=arguments.method))
        solved_m = {eye: results.eyes[eye].shift_m for eye in EYES}

        # The error that the true eyes see, at the corners of the user test's target.
        before = reprojection_arcmin(wearer.rig, NOT_CALIBRATED, wearer.true_shift_m)
        after = reprojection_arcmin(wearer.rig, solved_m, wearer.true_shift_m)
        off_mm = [1e3 * np.linalg.norm(solved_m[eye] - wearer.true_shift_m[eye]) for eye in EYES]
        errors_arcmin.append(after)
        print(
            f"wearer {seed}: φ off by {off_mm[0]:.1f} mm left, {off_mm[1]:.1f} mm right; "
            f"display error {before:.1f}′ before, {after:.1f}′ after"
        )
    print(f"Median display error after calibration: {np.median(errors_arcmin):.1f}′")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
