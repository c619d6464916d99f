from pathlib import Path

import pytest

from handcal.core.types import Intrinsics
from handcal.lab.bench.accuracy import OfflineRun, OfflineSettings, calibrate_from_photographs
from handcal.rig.compare import compare_rigs
from handcal.rig.example import example_rig
from handcal.rig.rig_file import read_rig, write_rig
from handcal.sim.boards import PictureSettings

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
