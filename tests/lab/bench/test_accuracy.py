"""Wearers and rigs of the benchmark: known truth, and rigs in its place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.progress import Progress
from handcal.core.types import Intrinsics
from handcal.lab.bench.accuracy import (
    OfflineRun,
    OfflineSettings,
    calibrate_from_photographs,
    measure_cameras,
    ratio_of_means,
    reprojection_of_wearers,
)
from handcal.lab.bench.trials import QUICK
from handcal.rig.compare import compare_rigs
from handcal.rig.example import example_rig
from handcal.rig.rig_file import read_rig, write_rig
from handcal.sim.boards import PictureSettings


def test_a_rig_that_is_wrong_leaves_wearers_worse_off() -> None:
    true = example_rig()
    wrong = replace(true, T_H_D=true.T_H_D @ rigid([0.0, 0.0, 0.0], [0.02, 0.0, 0.0]))
    told: list[float] = []
    progress = Progress(lambda _, share: told.append(share))
    same, worse = (reprojection_of_wearers(rig, true, 2, progress) for rig in (true, wrong))
    assert told == [0.5, 1.0] * 2
    assert ratio_of_means(worse, same).mean > 1.3


def test_the_interval_of_a_ratio_covers_it() -> None:
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(400):
        baseline = rng.gamma(4.0, 2.0, 60)
        errors = 1.2 * baseline + rng.normal(0.0, 2.0, 60)
        found = ratio_of_means(errors, baseline)
        covered += found.low < 1.2 < found.high
    assert covered / 400 == pytest.approx(0.95, abs=0.03)


def test_each_camera_calibrates_the_same_wearer() -> None:
    measured = measure_cameras(replace(QUICK, camera_wearers=1), Progress())
    assert [len(errors) for errors in measured.details.values()] == [2, 2]
    # Without a calibration these eyes are wrong by 15′ and 8′. AHAT's pixels are four times as
    # coarse, and the rig knows its edges to a fifth of one.
    assert max(measured.details["D415_arcmin"]) < 5.0
    assert max(measured.details["AHAT_arcmin"]) < 8.0


# Half the size and a third of the views of what is measured in earnest.
SMALL = OfflineSettings(
    views=6,
    grids=1,
    viewpoint_camera=Intrinsics(
        800, 450, 1120.0, 1118.0, 402.0, 222.0, (-0.08, 0.05, 0.0004, -0.0003, 0.0)
    ),
    headset_camera=Intrinsics(
        640, 360, 505.0, 504.0, 322.0, 178.0, (0.06, -0.13, 0.0006, -0.0004, 0.04)
    ),
    pictures=PictureSettings(samples=1),
)


@pytest.fixture(scope="module")
def run() -> OfflineRun:
    return calibrate_from_photographs(example_rig(), 1, SMALL)


def test_a_rig_is_calibrated_from_its_photographs(run: OfflineRun) -> None:
    # Six small views leave the lens vague at the image's edge; the benchmark takes twenty.
    assert run.rotation_deg < 0.1
    assert run.translation_mm < 2.5
    assert run.focal_share < 0.01
    assert run.homography_px < 4.0
    assert run.distance_share < 0.02
    assert run.viewpoint_mm < 2.5


def test_it_draws_where_the_true_one_does(run: OfflineRun) -> None:
    apart = [one.value for one in compare_rigs(example_rig(), run.rig) if "drawn" in one.name]
    assert len(apart) == 2
    assert max(apart) < 2.0  # arcmin


def test_it_tells_how_every_part_came_about(run: OfflineRun, tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.yaml", run.rig)
    origins = read_rig(tmp_path / "rig.yaml").origins
    assert set(origins) == {"left", "right", "T_H_D"}
    assert all(0.0 < origin.rms_px < 0.5 for origin in origins.values())
