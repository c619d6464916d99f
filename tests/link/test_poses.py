import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.errors import PoseError, PosePendingError
from handcal.geometry import rigid
from handcal.link.poses import PoseBuffer
from handcal.types import Float64

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
    poses = PoseBuffer(max_gap_s=0.05)
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(0)
    for t_ms in (100, 110, 200):
        poses.add(t_ms * MS, pose(0))
    with pytest.raises(PoseError, match="100 ms before"):
        poses.at(0)
    with pytest.raises(PoseError, match="gap of 90 ms"):
        poses.at(150 * MS)
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(201 * MS)
    assert poses.at(105 * MS).shape == (4, 4)


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
