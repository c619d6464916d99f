import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.link.poses import PoseBuffer

MS = 1_000_000


def pose(i: float) -> Float64:
    """A steady motion, 10 ms a step."""
    return rigid([0.0, 0.02 * i, 0.0], [0.001 * i, 0.0, 0.0])


@given(st.permutations(range(8)))
def test_poses_are_interpolated_in_whatever_order_they_came(order: list[int]) -> None:
    poses = PoseBuffer()
    for i in order:
        poses.add(10 * MS * i, pose(i))
    for step in (3.0, 3.5, 6.9):
        np.testing.assert_allclose(poses.at(round(10 * MS * step)), pose(step), atol=1e-12)


def test_refusals_say_why() -> None:
    poses = PoseBuffer()
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(0)
    for t_ms in (100, 110, 200):
        poses.add(t_ms * MS, pose(t_ms))
    with pytest.raises(PoseError, match="100 ms before"):
        poses.at(0)
    with pytest.raises(PoseError, match="no pose for 90 ms"):
        poses.at(150 * MS)
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(201 * MS)
    assert poses.at(105 * MS).shape == (4, 4)


@pytest.mark.parametrize(
    ("gap_ms", "moved_m", "turned_rad", "is_known"),
    [
        (50, 0.1, 0.5, True),
        (60, 0.1, 0.0, False),
        (60, 0.0, 0.1, False),
        (60, 0.004, 0.008, True),
        (250, 0.004, 0.008, True),
        (260, 0.0, 0.0, False),
    ],
)
def test_longer_gaps_are_interpolated_where_the_head_is_slow(
    gap_ms: int, moved_m: float, turned_rad: float, is_known: bool
) -> None:
    poses = PoseBuffer()
    poses.add(0, rigid())
    poses.add(gap_ms * MS, rigid([0.0, turned_rad, 0.0], [moved_m, 0.0, 0.0]))
    if is_known:
        assert poses.at(gap_ms * MS // 2)[0, 3] == pytest.approx(moved_m / 2)
    else:
        with pytest.raises(PoseError, match=f"no pose for {gap_ms} ms"):
            poses.at(gap_ms * MS // 2)


def test_only_the_newest_are_kept() -> None:
    poses = PoseBuffer(capacity=10)
    for i in range(30):
        poses.add(10 * MS * i, pose(i))
    poses.add(0, pose(0))
    with pytest.raises(PoseError, match="before the oldest"):
        poses.at(199 * MS)
    np.testing.assert_allclose(poses.at(200 * MS), pose(20))


def test_the_rate_counts_each_pose_once() -> None:
    poses = PoseBuffer()
    assert poses.rate_hz() == 0.0
    for i in range(300):
        for j in (i, max(i - 1, 0)):
            poses.add(10 * MS * j, pose(j))
    assert poses.rate_hz() == pytest.approx(100.0)
