"""The rig of a demonstration whose depth camera was checked."""

import pytest

from handcal.lab import demo
from handcal.lab.demo import DemoSettings
from handcal.rig.example import example_rig
from handcal.sim.sensor import EDGE_SIGMA_PX, SensorName


@pytest.mark.parametrize(
    ("sensor", "fatten_px", "border_px"),
    [("d415", 2.0, 1.4), ("d415", None, 1.8), ("exact", None, -1.0), ("ahat", None, -0.5)],
)
def test_a_checked_rig_knows_its_cameras_edges_with_the_error_of_a_check(
    sensor: SensorName, fatten_px: float | None, border_px: float
) -> None:
    found = [
        demo._checked(example_rig(), DemoSettings(seed, sensor=sensor, fatten_px=fatten_px))
        for seed in range(20)
    ]
    edges = [one.depth_edges for one in found if one.depth_edges is not None]
    assert {(one.source, one.sigma_px) for one in edges} == {("measured", EDGE_SIGMA_PX)}
    fattened_px = [one.fatten_px for one in edges]
    assert len(set(fattened_px)) == 20
    assert sum(fattened_px) / 20 == pytest.approx(border_px, abs=0.15)
