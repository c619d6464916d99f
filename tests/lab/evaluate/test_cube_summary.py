import pytest

from handcal.lab.evaluate.cube_test import CubeRow, cube_summary


def row(position: str, drawn: str, error_mm: float) -> CubeRow:
    return {"position": position, "pose": "1", "drawn": drawn, "faces": 3, "err_t_x_mm": error_mm}


def test_each_way_of_drawing_has_its_errors() -> None:
    rows = [row(p, d, e) for p, d, e in (("a", "x", 1.0), ("a", "y", 9.0), ("b", "x", 3.0))]
    summary = cube_summary(rows)
    assert list(summary) == ["x", "y"]
    assert summary["x"].keys() == {"err_t_x_mm"}
    found = summary["x"]["err_t_x_mm"]
    assert (found.spread.count, found.spread.mean, found.spread.median) == (2, 2.0, 2.0)
    assert found.interval is not None
    assert found.interval.clusters == 2
    assert found.interval.mean == pytest.approx(2.0)
    assert summary["y"]["err_t_x_mm"].interval is None


def test_poses_at_one_position_are_not_independent() -> None:
    few = [row("a", "x", 1.0), row("b", "x", 3.0)]
    many = few + 9 * [row("a", "x", 1.0), row("b", "x", 3.0)]
    intervals = [cube_summary(rows)["x"]["err_t_x_mm"].interval for rows in (few, many)]
    assert intervals[0] == intervals[1]
