import numpy as np
import pytest

from handcal.geometry import invert, rigid, transform
from handcal.sim.hand import make_hand
from handcal.sim.raycast import D415, HandCaster, visible_points
from handcal.types import Float64


@pytest.fixture(scope="module")
def caster() -> HandCaster:
    return HandCaster(make_hand(1))


@pytest.fixture
def T_D_hand() -> Float64:
    return rigid([0.1, 0.2, -0.1], [0.01, 0.02, 0.5])


def test_points_lie_on_the_surface_and_face_the_camera(
    caster: HandCaster, T_D_hand: Float64
) -> None:
    points_m, _ = visible_points(caster, T_D_hand, 2000, np.random.default_rng(0))
    on_hand_m = transform(invert(T_D_hand), points_m)
    np.testing.assert_allclose(caster.closest(on_hand_m), on_hand_m, atol=2e-6)
    # Nothing of the hand lies in front of what is seen.
    nearer = caster.cast(T_D_hand, D415)
    depth_m = np.full((D415.height, D415.width), np.inf)
    depth_m[nearer.rows, nearer.columns] = nearer.depth_m
    pixels = points_m[:, :2] / points_m[:, 2:] * D415.fx + [D415.cx, D415.cy]
    u, v = np.rint(pixels).astype(int).T
    np.testing.assert_allclose(depth_m[v, u], points_m[:, 2], atol=1e-6)


def test_cast_within_its_box_misses_nothing(caster: HandCaster, T_D_hand: Float64) -> None:
    view = caster.cast(T_D_hand, D415)
    x0, y0, x1, y1 = caster._box_px(T_D_hand, D415)
    assert x0 < view.columns.min()
    assert view.columns.max() < x1
    assert y0 < view.rows.min()
    assert y1 == D415.height  # the forearm leaves the image


def test_forearm_is_cut_and_flagged(caster: HandCaster, T_D_hand: Float64) -> None:
    hand = caster.hand
    points_m, is_cut = visible_points(
        caster, T_D_hand, 20_000, np.random.default_rng(0), forearm_m=0.03
    )
    beyond_m = (transform(invert(T_D_hand), points_m) - hand.wrist_m) @ hand.arm_axis - 0.03
    assert beyond_m.max() <= 1e-9
    np.testing.assert_array_equal(is_cut, beyond_m > -0.003)
    assert is_cut.any()


def test_depth_noise_has_the_asked_size(caster: HandCaster, T_D_hand: Float64) -> None:
    clean_m, _ = visible_points(caster, T_D_hand, 5000, np.random.default_rng(0))
    noisy_m, _ = visible_points(
        caster, T_D_hand, 5000, np.random.default_rng(0), depth_sigma_m=0.0015
    )
    assert np.std(noisy_m[:, 2] - clean_m[:, 2]) == pytest.approx(0.0015, rel=0.05)
    np.testing.assert_allclose(noisy_m[:, 0] / noisy_m[:, 2], clean_m[:, 0] / clean_m[:, 2])


def test_hand_behind_or_beside_the_camera_is_not_seen(caster: HandCaster) -> None:
    for translation_m in ([0, 0, -0.5], [2.0, 0, 0.5]):
        assert caster.cast(rigid(translation_m=translation_m), D415).rows.size == 0
