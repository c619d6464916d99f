import numpy as np
import pytest

from handcal.sim.hand import isosurface


def _edges(triangles: np.ndarray) -> list[tuple[int, int]]:
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return [(a, b) for a, b in ends.tolist()]


@pytest.mark.parametrize("seed", range(3))
def test_any_field_has_a_closed_surface(seed: int) -> None:
    field = np.full((14, 15, 16), 1.0, np.float32)
    rng = np.random.default_rng(seed)
    field[1:-1, 1:-1, 1:-1] = rng.normal(size=(12, 13, 14))  # every one of the 256 cases
    _, triangles, _ = isosurface(field)
    edges = _edges(triangles)
    # Surfaces may touch along an edge, but every edge is passed as often one way as the other.
    assert sorted(edges) == sorted((b, a) for a, b in edges)


def test_a_ball_is_round_and_its_normals_point_outwards() -> None:
    center, radius = np.array([10.2, 11.1, 9.7]), 7.3
    at = np.stack(np.meshgrid(*map(np.arange, (21, 22, 20)), indexing="ij"), axis=-1) - center
    field = (np.linalg.norm(at, axis=-1) - radius).astype(np.float32)
    vertices, triangles, normals = isosurface(field)
    assert len(vertices) - len(_edges(triangles)) // 2 + len(triangles) == 2  # Euler
    out = vertices - center
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), radius, atol=0.02)
    assert np.einsum("ij,ij->i", out, normals).min() > 0.99 * radius
    a, b, c = (out[triangles[:, corner]] for corner in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02)
