import numpy as np
import pytest

from handcal_gui.calibrate.cloud.orbit import Direction, Orbit

RIGHT, DOWN, AWAY = np.eye(3)


@pytest.mark.parametrize(
    ("direction", "right", "down", "away"),
    [
        (Direction.FRONT, RIGHT, DOWN, AWAY),
        (Direction.SIDE, AWAY, DOWN, -RIGHT),  # from the wearer's right
        (Direction.TOP, RIGHT, -AWAY, DOWN),
    ],
)
def test_directions(
    direction: Direction, right: np.ndarray, down: np.ndarray, away: np.ndarray
) -> None:
    orbit = Orbit().looking(direction)
    np.testing.assert_allclose(orbit.rotation, [right, down, away], atol=1e-12)


def test_scene_follows_the_mouse() -> None:
    """Near points move right on a rotation to the right, and down on a rotation downwards."""
    near = np.array([[0.0, 0.0, -50.0]])
    orbit = Orbit().looking(Direction.FRONT)
    assert orbit.turned(-0.1, 0.0).project(near)[0, 0] > 1.0
    assert orbit.turned(0.0, 0.1).project(near)[0, 1] > 1.0
    assert orbit.turned(0.0, 9.0).pitch_rad == pytest.approx(np.pi / 2)


def test_panning_moves_everything_by_as_many_pixels() -> None:
    points = np.random.default_rng(0).normal(0.0, 100.0, (5, 3))
    orbit = Orbit(px_per_mm=2.5, centre_mm=(3.0, 4.0, 5.0))
    moved = orbit.panned(12.0, -7.0).project(points) - orbit.project(points)
    np.testing.assert_allclose(moved, np.tile([12.0, -7.0, 0.0], (5, 1)), atol=1e-9)


def test_zooming_keeps_the_middle_and_has_an_end() -> None:
    orbit = Orbit(centre_mm=(3.0, 4.0, 5.0))
    points = np.array([[3.0, 4.0, 5.0], [13.0, 4.0, 5.0]])
    np.testing.assert_allclose(orbit.zoomed(2.0).project(points), 2.0 * orbit.project(points))
    assert orbit.zoomed(1e9).px_per_mm == 50.0
    assert orbit.zoomed(0.0).px_per_mm > 0.0


@pytest.mark.parametrize("direction", Direction)
def test_fitted_points_fill_the_picture_and_no_more(direction: Direction) -> None:
    points = np.random.default_rng(1).normal(40.0, 30.0, (200, 3))
    px = Orbit().looking(direction).fitted(points, 300.0, 200.0).project(points)[:, :2]
    low, high = px.min(axis=0), px.max(axis=0)
    np.testing.assert_allclose(low, -high, atol=1e-9)
    fill = 2.0 * high / [300.0, 200.0]
    assert fill.max() == pytest.approx(1.0)
