import numpy as np
import pytest

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import D415, draw_hand, visible_points

ODD = Intrinsics(width=640, height=400, fx=610.0, fy=580.0, cx=300.2, cy=220.7)


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(1)


@pytest.fixture
def T_D_hand() -> Float64:
    return rigid([0.1, 0.2, -0.1], [0.01, 0.02, 0.5])


def _first_hit_m(hand: HandModel, T_D_hand: Float64, ray: Float64) -> float:
    """Depth of the nearest triangle along a ray of unit z (Möller & Trumbore 1997)."""
    v = transform(T_D_hand, hand.vertices_m)[hand.triangles]
    edge_1, edge_2 = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    across = np.cross(ray, edge_2)
    inverse = 1.0 / np.einsum("ij,ij->i", edge_1, across)
    a = -np.einsum("ij,ij->i", v[:, 0], across) * inverse
    q = np.cross(-v[:, 0], edge_1)
    b = q @ ray * inverse
    t = np.einsum("ij,ij->i", edge_2, q) * inverse
    hit = (a >= 0) & (b >= 0) & (a + b <= 1) & (t > 0)
    return float(t[hit].min(initial=np.inf))


@pytest.mark.parametrize("intrinsics", [D415, ODD])
def test_drawn_depth_is_the_first_hit_of_each_pixels_ray(
    hand: HandModel, T_D_hand: Float64, intrinsics: Intrinsics
) -> None:
    image = draw_hand(hand, T_D_hand, intrinsics)
    rng = np.random.default_rng(0)
    rows = rng.integers(0, image.depth_m.shape[0], 60)
    columns = rng.integers(0, image.depth_m.shape[1], 60)
    rays = np.column_stack(
        [
            (columns + image.x0 - intrinsics.cx) / intrinsics.fx,
            (rows + image.y0 - intrinsics.cy) / intrinsics.fy,
            np.ones(60),
        ]
    )
    expected = [_first_hit_m(hand, T_D_hand, ray) for ray in rays]
    drawn = image.depth_m[rows, columns]
    assert 10 < np.isfinite(drawn).sum() < 50
    np.testing.assert_allclose(drawn, expected, atol=2e-6)


def test_forearm_is_cut_and_flagged(hand: HandModel, T_D_hand: Float64) -> None:
    points_m, is_cut = visible_points(
        hand, T_D_hand, 20_000, np.random.default_rng(0), forearm_m=0.03
    )
    assert len(points_m) == 20_000
    beyond_m = (transform(invert(T_D_hand), points_m) - hand.wrist_m) @ hand.arm_axis - 0.03
    assert beyond_m.max() <= 1e-9
    np.testing.assert_array_equal(is_cut, beyond_m > -0.003)
    assert is_cut.any()


@pytest.mark.parametrize("translation_m", [(0, 0, -0.5), (2.0, 0, 0.5), (0, 0, 0.01)])
def test_hand_behind_beside_or_around_the_camera_is_not_seen(
    hand: HandModel, translation_m: tuple[float, float, float]
) -> None:
    image = draw_hand(hand, rigid(translation_m=translation_m), D415)
    assert not np.isfinite(image.depth_m).any()
