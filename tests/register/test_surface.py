import numpy as np
import pytest

from handcal.errors import HandError
from handcal.register.surface import Surface, describe_surface, near_cut_edge, nearest
from handcal.types import Bool, Float64

PITCH_M = 0.003
SIZE = 40


@pytest.fixture(scope="module")
def square_m() -> Float64:
    """A square in the plane z = 0.5."""
    u, v = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    return np.column_stack([PITCH_M * u.ravel(), PITCH_M * v.ravel(), np.full(u.size, 0.5)])


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


def test_spacing_of_a_grid(square: Surface) -> None:
    assert square.spacing_m == pytest.approx(PITCH_M)


def test_the_outline_is_the_border(square: Surface) -> None:
    from_border_m = _from_border_m(square.points_m)
    assert set(np.flatnonzero(from_border_m < 1e-9)) <= set(square.outline)
    assert from_border_m[square.outline].max() < 2.5 * PITCH_M
    on_border = from_border_m[square.outline] < 1e-9
    assert square.outline_weight[on_border].mean() > 0.3
    assert square.outline_weight[~on_border].max(initial=0.0) < 0.3


def test_outward_leads_out(square: Surface) -> None:
    border = np.flatnonzero(_from_border_m(square.points_m) < 1e-9)
    steps_m = square.points_m[border] + PITCH_M * square.outward[border]
    assert (_from_border_m(steps_m) < -0.5 * PITCH_M).all()
    np.testing.assert_allclose(np.linalg.norm(square.outward[border], axis=1), 1.0)


def test_a_cut_edge_is_no_outline(square_m: Float64, is_lower_edge: Bool) -> None:
    surface = describe_surface(square_m, is_lower_edge, len(square_m))
    from_cut_m = square_m[:, 1].max() - surface.points_m[:, 1]
    np.testing.assert_array_equal(surface.near_cut, from_cut_m < 1.5 * PITCH_M)
    assert from_cut_m[surface.outline].min() > 1.5 * PITCH_M


def test_near_cut_edge_knows_nothing_without_cuts(square_m: Float64) -> None:
    assert not near_cut_edge(square_m, square_m, None, PITCH_M).any()
    none = np.zeros(len(square_m), dtype=np.bool_)
    assert not near_cut_edge(square_m, square_m, none, PITCH_M).any()


def test_thinning_takes_some_of_the_points_always_the_same(square_m: Float64) -> None:
    one, again = (describe_surface(square_m, None, 300) for _ in range(2))
    assert len(one.points_m) == 300
    assert set(map(tuple, one.points_m)) <= set(map(tuple, square_m))
    np.testing.assert_array_equal(one.points_m, again.points_m)
    np.testing.assert_array_equal(one.outline, again.outline)
    assert one.spacing_m == pytest.approx(PITCH_M * np.sqrt(len(square_m) / 300), rel=0.3)


def test_a_surface_wholly_beside_cuts_is_refused(square_m: Float64) -> None:
    with pytest.raises(HandError, match="beside cut edges"):
        describe_surface(square_m, np.ones(len(square_m), dtype=np.bool_), 500)


def test_nearest(square: Surface) -> None:
    distance_m, index = nearest(square.tree, np.array([[0.0, 0.0, 0.5], [9.0, 0.0, 0.5]]), 1, 0.1)
    assert distance_m[0] == 0.0
    np.testing.assert_array_equal(square.points_m[index[0]], [0.0, 0.0, 0.5])
    assert np.isinf(distance_m[1])
