from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import project, rigid, transform
from handcal.core.types import EYES, Eye, EyeDisplay, Rig
from handcal.rig.example import example_rig
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.simulation import TrueEyes
from handcal.sim.wearer import Wearer
from handcal.sim.wearer_settings import WearerSettings

T_W_H = rigid([0.02, -0.05, 0.03], [0.05, 0.0, 0.1])
# Far enough away for the fingertips to lie in the display; the forearm leaves it below.
T_W_HAND = T_W_H @ rigid(translation_m=[0.0, 0.06, 1.0])
# So far that an image from the viewpoint C0 would be tens of pixels wrong.
FAR_OFF = WearerSettings(headset_sigma_m=(0.02, 0.02, 0.02), largest_shift_m=0.1)


@pytest.fixture(scope="module")
def world() -> World:
    return World(make_hand(1), make_room(1))


def _rig_with(**changes: object) -> Rig:
    """Return the example rig with changes to both eyes' displays."""
    rig = example_rig()
    displays: dict[Eye, EyeDisplay] = {
        eye: replace(rig.eyes[eye], **changes)  # type: ignore[arg-type]
        for eye in EYES
    }
    return replace(rig, eyes=displays)


def test_they_are_the_wearers_own(world: World) -> None:
    rig = example_rig()
    wearer, eyes = Wearer(7, rig, world.hand), TrueEyes(world, rig, 7)
    for eye in EYES:
        np.testing.assert_array_equal(eyes.shift_m[eye], wearer.true_shift_m[eye])


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize(
    "rig",
    [
        example_rig(),
        _rig_with(H0=rigid([0.03, -0.02, 0.1])[:3, :3], width_px=1001, height_px=701),
    ],
    ids=["example", "turned homography, odd size"],
)
def test_hand_is_seen_where_the_eyes_projection_says(world: World, rig: Rig, eye: Eye) -> None:
    eyes = TrueEyes(world, rig, 3, FAR_OFF)
    empty, image = (eyes.look(eye, T_W_H, T) for T in (None, T_W_HAND))
    display = rig.eyes[eye]
    assert image.shape == (display.height_px // 2, display.width_px // 2, 3)

    on_hand = np.abs(image.astype(int) - empty).sum(axis=2) > 40
    rows, columns = np.nonzero(on_hand)
    drawn = [columns.min(), rows.min(), columns.max(), rows.max()]
    vertices_E_m = transform(view_of_eye(display, T_W_H) @ T_W_HAND, world.hand.vertices_m)
    px = project(eye_projection(display, eyes.shift_m[eye]), vertices_E_m)
    size = np.array(image.shape[1::-1])
    px = (px + 0.5) * size / [display.width_px, display.height_px] - 0.5
    px = px[np.all((px > -0.5) & (px < size - 0.5), axis=1)]
    np.testing.assert_allclose(drawn, np.concatenate([px.min(axis=0), px.max(axis=0)]), atol=1.5)
