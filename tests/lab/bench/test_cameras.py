"""Whole calibrations with simulated depth cameras."""

from dataclasses import replace

from handcal.core.progress import Progress
from handcal.lab.bench.accuracy import measure_cameras
from handcal.lab.bench.trials import QUICK


def test_each_camera_calibrates_the_same_wearer() -> None:
    measured = measure_cameras(replace(QUICK, camera_wearers=1), Progress())
    assert [len(errors) for errors in measured.details.values()] == [2, 2]
    # Without a calibration these eyes are wrong by 15′ and 8′. AHAT's pixels are four times as
    # coarse, and the rig knows its edges to a fifth of one.
    assert max(measured.details["D415_arcmin"]) < 5.0
    assert max(measured.details["AHAT_arcmin"]) < 8.0
