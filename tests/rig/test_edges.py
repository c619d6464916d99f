from dataclasses import replace

import pytest

from handcal.core.types import CameraIdentity, DepthEdges
from handcal.hand.outline import edges_of
from handcal.rig.example import example_rig


def of_model(model: str) -> DepthEdges:
    return edges_of(replace(example_rig(), depth_camera=CameraIdentity(model)))


def test_measured_edges_are_taken() -> None:
    measured = DepthEdges(1.2, 0.1, "measured", 12, "2026-11-28")
    assert edges_of(replace(example_rig(), depth_edges=measured)) == measured


@pytest.mark.parametrize("model", ["Intel RealSense D415", "Simulated camera", "OAK-D-LITE"])
def test_stereo_cameras_fatten_by_one_to_three_pixels(model: str) -> None:
    edges = of_model(model)
    assert edges.source == "typical"
    assert edges.fatten_px - 2 * edges.sigma_px < 1.0
    assert edges.fatten_px + 2 * edges.sigma_px > 3.0
    assert edges.fatten_px > 1.0


@pytest.mark.parametrize("model", ["HoloLens 2 RM_DEPTH_AHAT", "Intel RealSense L515", "SR305"])
def test_the_outermost_pixels_of_others_lie_half_a_pixel_inside(model: str) -> None:
    assert of_model(model).fatten_px == -0.5


def test_an_unknown_camera_is_most_likely_a_stereo_camera_but_less_certain() -> None:
    """It may be wrong by several times that, too, as nobody measured it (test_sitting.py)."""
    stereo, unknown = of_model("Intel RealSense D455"), of_model("")
    assert unknown.fatten_px == stereo.fatten_px
    assert unknown.sigma_px > max(stereo.sigma_px, of_model("Azure Kinect").sigma_px)
    assert of_model("Something new") == unknown
