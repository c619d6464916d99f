import os
from collections.abc import Callable
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from handcal.geometry import rigid
from handcal.types import Alignment

# A busy machine fails no test.
hypothesis.settings.register_profile("handcal", deadline=None)
hypothesis.settings.load_profile("handcal")

_IN_REAL_TIME = {
    "qtbot", "display", "live", "studio", "server", "raw_server", "client", "process", "begun",
    "cluster",
}  # fmt: skip
"""Fixtures that run windows, threads or processes, which a busy machine may keep waiting."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try what runs in real time a second time, which counts."""
    for item in items:
        if _IN_REAL_TIME & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.fixture(scope="session")
def alignment() -> Alignment:
    rng = np.random.default_rng(1)
    return Alignment(
        cursor_m=rng.normal(size=(40, 3)),
        hand_m=rng.normal(size=(50, 3)),
        cursor_is_cut=rng.random(40) < 0.1,
        hand_is_cut=rng.random(50) < 0.1,
        T_E_W={
            "left": rigid(rng.normal(size=3), rng.normal(size=3)),
            "right": rigid(rng.normal(size=3), rng.normal(size=3)),
        },
        eyes=("right",),
        rotation_rad=rng.normal(size=3),
        t_a_ns=1_700_000_000_123_456_789,
        t_b_ns=1_700_000_003_123_456_789,
        drawn_shift_m={"left": rng.normal(size=3), "right": rng.normal(size=3)},
    )


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real recordings made by others, which is not part of the project."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("HANDCAL_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no real recordings: set HANDCAL_DATA to the folder that holds them")
    return folder


@pytest.fixture(scope="session")
def headset_of() -> Callable[[int], int]:
    """Return what finds the process of the virtual headset that a process has started."""
    if not Path("/proc/self/task").is_dir():
        pytest.skip("processes are found only in Linux's /proc")

    def find(pid: int) -> int:
        children = [
            int(child)
            for task in Path(f"/proc/{pid}/task").iterdir()
            for child in (task / "children").read_text().split()
        ]
        (headset,) = (
            child
            for child in children
            if b"headset" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        )
        return headset

    return find
