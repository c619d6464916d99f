"""Snapshots for the bridges' tests, without a station."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.hands import PlacedHand
from handcal.calibration.procedure import Procedure
from handcal.calibration.sight import Observation
from handcal.calibration.states import State
from handcal.camera.feed import CameraStatus
from handcal.core.geometry import rigid, transform
from handcal.core.types import Eye, Float64, HandCloud
from handcal.link.statistics import LinkStatistics
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.station.snapshot import Snapshot

POINTS_D_M = (
    np.random.default_rng(0)
    .uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.6], (5000, 3))
    .astype(np.float32)
)
T_W_D = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
SHIFT_M: dict[Eye, Float64] = {"left": np.array([0.003, 0.001, 0.005]), "right": np.zeros(3)}


def placed_hand() -> PlacedHand:
    cloud = HandCloud(
        t_camera_ns=0,
        t_host_ns=0,
        points_m=POINTS_D_M,
        is_cut=np.zeros(len(POINTS_D_M), bool),
        colors=None,
        contour_m=POINTS_D_M[:4],
        contour_is_cut=np.zeros(4, bool),
        mask=np.zeros((2, 2), np.uint8),
        box_px=(0, 0, 1, 1),
        median_depth_m=0.5,
    )
    points_W_m = transform(T_W_D, POINTS_D_M)
    return PlacedHand(cloud, 0, T_W_D, points_W_m, np.median(points_W_m, axis=0))


@pytest.fixture
def snapshot(tmp_path: Path) -> Iterator[Snapshot]:
    """Return a snapshot with a hand and without a cursor."""
    with Session.create(tmp_path, example_rig(), {}, name="session") as session:
        record = Session.open(session.path)
        procedure = Procedure(
            State.SHOW_HAND, ("left", "right"), None, "", None, SHIFT_M, is_applied=True
        )
        yield Snapshot(
            number=1,
            t_host_ns=time.monotonic_ns(),
            frame=None,
            observation=Observation(State.SHOW_HAND, placed_hand(), "", True),
            camera=CameraStatus("Camera of the tests"),
            link=LinkStatistics(
                True, 0, 0, 0, 0, 0, 0, 0, 0, {}, 60.0, None, None, None, None, None, 0, 0
            ),
            link_problem="",
            procedure=procedure,
            record=record,
        )


@pytest.fixture
def later(snapshot: Snapshot) -> Callable[..., Snapshot]:
    """Return a maker of the next snapshot, whose procedure has changed."""

    def make(**changes: object) -> Snapshot:
        return replace(
            snapshot,
            number=snapshot.number + 1,
            t_host_ns=time.monotonic_ns(),
            procedure=replace(snapshot.procedure, **changes),  # type: ignore[arg-type]
        )

    return make
