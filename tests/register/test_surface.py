import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from small_gicp import KdTree

from handcal.core.errors import HandError
from handcal.core.geometry import rigid, transform
from handcal.core.types import Bool, Float64
from handcal.register.surface import (
    Surface,
    describe_surface,
    near_cut_edge,
    nearest,
    quantile,
    thin,
    thinnest,
)
from handcal.sim.hand import make_hand
from handcal.sim.raster import visible_points

PITCH_M = 0.003
SIZE = 40


@pytest.fixture(scope="module")
def square_m() -> Float64:
    """A square in the plane z = 0.5."""
    u, v = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    return np.column_stack([PITCH_M * u.ravel(), PITCH_M * v.ravel(), np.full(u.size, 0.5)])


@given(st.lists(st.floats(-1e3, 1e3), min_size=1), st.sampled_from([0.0, 0.1, 0.5, 0.99, 1.0]))
def test_the_quantile_is_the_value_of_its_rank(values: list[float], share: float) -> None:
    found, rank = quantile(np.array(values), share), share * (len(values) - 1)
    below, not_above = (np.less(values, found).sum(), np.less_equal(values, found).sum())
    assert below - 0.5 <= rank <= not_above - 0.5


@pytest.fixture(scope="module")
def is_lower_edge(square_m: Float64) -> Bool:
    return np.asarray(square_m[:, 1] == square_m[:, 1].max())


@pytest.fixture(scope="module")
def square(square_m: Float64) -> Surface:
    return describe_surface(square_m, None, len(square_m))


def _from_border_m(points_m: Float64) -> Float64:
    xy = points_m[:, :2]
    return np.asarray(np.minimum(xy, PITCH_M * (SIZE - 1) - xy).min(axis=1))


def test_normals_of_a_plane(square: Surface) -> None:
    np.testing.assert_allclose(np.abs(square.normals @ [0, 0, 1]), 1.0, atol=1e-6)


def test_the_outline_is_the_border(square: Surface) -> None:
    from_border_m = _from_border_m(square.points_m)
    assert set(np.flatnonzero(from_border_m < 1e-9)) <= set(square.outline)
    assert from_border_m[square.outline].max() < 2.5 * PITCH_M
    on_border = from_border_m[square.outline] < 1e-9
    assert square.outline_weight[on_border].mean() > 0.3
    assert square.outline_weight[~on_border].max(initial=0.0) < 0.3


def test_a_cut_edge_is_no_outline(square_m: Float64, is_lower_edge: Bool) -> None:
    surface = describe_surface(square_m, is_lower_edge, len(square_m))
    from_cut_m = square_m[:, 1].max() - surface.points_m[:, 1]
    np.testing.assert_array_equal(surface.near_cut, from_cut_m < 1.5 * PITCH_M)
    assert from_cut_m[surface.outline].min() > 1.5 * PITCH_M


def test_near_cut_edge_as_by_all_distances() -> None:
    """Only candidates in a box about the edge are searched for; the answer is that of all."""
    rng = np.random.default_rng(0)
    for spacing_m in (0.0005, 0.004):
        cloud_m, points_m = rng.uniform(0.0, 0.1, (300, 3)), rng.uniform(-0.01, 0.11, (400, 3))
        is_cut = cloud_m @ [0.6, 0.8, 0.0] > 0.1
        apart_m = np.linalg.norm(points_m[:, None] - cloud_m[is_cut], axis=2).min(axis=1)
        near = near_cut_edge(points_m, cloud_m, is_cut, spacing_m)
        np.testing.assert_array_equal(near, apart_m < 1.5 * spacing_m)
    far_m = points_m + 1.0
    assert not near_cut_edge(far_m, cloud_m, is_cut, spacing_m).any()


def test_a_surface_wholly_beside_cuts_is_refused(square_m: Float64) -> None:
    with pytest.raises(HandError, match="beside cut edges"):
        describe_surface(square_m, np.ones(len(square_m), dtype=np.bool_), 500)


def test_normals_of_any_scatter() -> None:
    """The closed form agrees with LAPACK where the least spread is clearly the least."""
    rng = np.random.default_rng(0)
    axes = Rotation.random(200, rng=rng).as_matrix()
    spread = rng.uniform(0.1, 1.0, (200, 3)) * [0.1, 1.0, 1.0] * 1e-5
    around = np.einsum("nij,nj,nkj->nik", axes, spread, axes)
    normals, least = thinnest(around)
    values, vectors = np.linalg.eigh(around)
    np.testing.assert_allclose(least, values[:, 0], rtol=1e-6)
    agreement = np.abs(np.einsum("nd,nd->n", normals, vectors[:, :, 0]))
    assert agreement.min() > 1.0 - 1e-6
    assert np.isfinite(thinnest(np.zeros((1, 3, 3)))[0]).all()


@settings(max_examples=20, deadline=None)
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 6))
def test_thinning_does_not_depend_on_the_frame(pose: tuple[float, ...]) -> None:
    T = rigid(pose[:3], pose[3:])
    cloud_m = np.random.default_rng(0).gamma(2.0, 0.01, (3000, 3)) * [3.0, 2.0, 0.05]
    once, again = thin(cloud_m, 400), thin(transform(T, cloud_m), 400)
    np.testing.assert_allclose(again, transform(T, once), atol=1e-9)
    assert 200 < len(once) < 700


def test_strays_are_dropped() -> None:
    """An outlier fills a cube of its own, which would count as much as one of the hand's."""
    rng = np.random.default_rng(0)
    T_D_hand = rigid([0.1, 0.1, 0.0], [0.0, 0.0, 0.5])
    hand_m, is_cut = visible_points(make_hand(1), T_D_hand, 5000, rng)
    stray_m = rng.uniform(hand_m.min(axis=0), hand_m.max(axis=0), (250, 3))
    flags = np.append(is_cut, np.zeros(len(stray_m), np.bool_))
    surface = describe_surface(np.vstack([hand_m, stray_m]), flags, 1000)
    apart_m, _ = nearest(KdTree(hand_m), surface.points_m)
    # All of them would be a fifth of the surface.
    assert np.mean(apart_m > 0.015) < 0.05
