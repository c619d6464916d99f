import numpy as np
import pytest

from handcal.core.geometry import rigid, transform
from handcal.core.types import Float64
from handcal.lab.methods.mpaam import FEWEST_PAIRS, MapModel, solve_mpaam

CORNERS_M = 0.04 * np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [1, 1, 1]], dtype=float
)


def cube_corners(rng: np.random.Generator, times: int = 4) -> Float64:
    """Return five corners of a cube at several places within reach."""
    return np.concatenate(
        [
            transform(rigid(rng.normal(0.0, 0.4, 3), rng.normal([0, 0, 0.5], 0.08)), CORNERS_M)
            for _ in range(times)
        ]
    )


def mapped(T: Float64, points_m: Float64) -> Float64:
    h = np.column_stack([points_m, np.ones(len(points_m))]) @ T.T
    result: Float64 = h[:, :3] / h[:, 3:]
    return result


RIGID = rigid([0.02, -0.03, 0.01], [0.004, -0.002, 0.01])
AFFINE = RIGID @ np.diag([1.01, 0.98, 1.03, 1.0])
PERSPECTIVE = np.vstack([AFFINE[:3], [0.02, -0.01, 0.05, 1.0]])


@pytest.mark.parametrize(
    ("model", "true"),
    [("isometric", RIGID), ("affine", RIGID), ("affine", AFFINE)]
    + [("perspective", T) for T in (RIGID, AFFINE, PERSPECTIVE)],
)
def test_exact_corners_give_the_map(model: MapModel, true: Float64) -> None:
    points_m = cube_corners(np.random.default_rng(1))
    found = solve_mpaam(points_m, mapped(true, points_m), model)
    assert np.abs(found / found[3, 3] - true).max() < 1e-6


@pytest.mark.parametrize("model", FEWEST_PAIRS)
def test_the_fewest_pairs_are_enough(model: MapModel) -> None:
    points_m = np.random.default_rng(2).normal([0.0, 0.0, 0.5], 0.05, (FEWEST_PAIRS[model], 3))
    found = solve_mpaam(points_m, mapped(RIGID, points_m), model)
    assert np.abs(found / found[3, 3] - RIGID).max() < 1e-6


def test_the_isometric_map_is_the_nearest_motion() -> None:
    """Never a mirror, though one would fit these noisy pairs better."""
    points_m = cube_corners(np.random.default_rng(3), 1)[:3]
    found = solve_mpaam(points_m, points_m * [1.0, 1.0, -1.0], "isometric")
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("model", FEWEST_PAIRS)
def test_bad_input_is_refused(model: MapModel) -> None:
    few = FEWEST_PAIRS[model] - 1
    with pytest.raises(ValueError, match="are needed"):
        solve_mpaam(np.ones((few, 3)), np.ones((few, 3)), model)
    flat_m = np.outer(np.linspace(0.0, 1.0, 9), [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="different places"):
        solve_mpaam(flat_m, flat_m, model)
    with pytest.raises(ValueError, match="partner"):
        solve_mpaam(np.ones((9, 3)), np.ones((8, 3)), model)


def test_one_face_of_the_cube_is_not_enough_for_affine() -> None:
    face_m = CORNERS_M[:4]
    with pytest.raises(ValueError, match="one plane"):
        solve_mpaam(face_m, face_m, "affine")


def test_one_cube_is_not_enough_for_perspective() -> None:
    with pytest.raises(ValueError, match="not on one plane"):
        solve_mpaam(CORNERS_M, CORNERS_M, "perspective")


def test_unknown_model_is_refused() -> None:
    with pytest.raises(ValueError, match="choose from isometric"):
        solve_mpaam(CORNERS_M, CORNERS_M, "similar")  # type: ignore[arg-type]
