"""Fixtures for all tests, and the rules of a run: markers, order, processes and second tries."""

import gc
import multiprocessing.process
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import EYES, Alignment, Eye
from handcal.rig.example import Z_E_S_M
from handcal.sim.alignments import AlignmentSettings, simulate_alignment
from handcal.sim.hand import make_hand

# A busy machine fails no test.
hypothesis.settings.register_profile("handcal", deadline=None)
hypothesis.settings.load_profile("handcal")

gc.disable()  # until all modules are imported and all tests collected: none of that is garbage

# Images of machines turn bytecode off, and then each worker rewrites all assertions in every run.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# The tests write thousands of small files through to the disk and wait for each. They write into
# memory instead, where it has room and lets programs run, which some tests write.
_MEMORY = Path("/dev/shm")
_MEMORY_BYTES = 4e9
if (
    sys.platform == "linux"
    and os.access(_MEMORY, os.W_OK)
    and not os.statvfs(_MEMORY).f_flag & os.ST_NOEXEC
    and shutil.disk_usage(_MEMORY).free > _MEMORY_BYTES
):
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(_MEMORY))

platform.platform()  # starts a process the first time, which a quick test may not

_IN_REAL_TIME = {
    "qtbot", "display", "live", "studio", "server", "raw_server", "client", "process", "begun",
    "cluster",
}  # fmt: skip
"""Fixtures that run windows, threads or processes, which a busy machine may keep waiting."""
_WINDOWS = {"qtbot", "display"}
_PROCESSES = {"display", "process", "begun", "cluster"}
_NOT_QUICK = "window", "process", "slow", "campaign"
_LONG = {
    "tests/cli/test_accept.py",
    "tests/cli/test_study.py",
    "tests/lab/bench/test_accuracy.py",
    "tests/lab/bench/test_run.py",
    "tests/register/test_consistent.py",
    "tests/rig/boards/test_board.py",
    "tests/rig/boards/test_corpus.py",
    "tests/rig/lens/test_stereo.py",
}
"""Files of long series that are not quick; the files beside them test the same code."""
_PROGRAMS = {
    "tests/gui/app/test_real_window.py",
    "tests/gui/app/test_start.py",
    "tests/station/test_station.py",
    "tests/cli/test_demo.py",
}
"""Files that start whole programs, each of which can keep more than one core busy."""
_SECOND_TRIES = 1
"""Most tests of a run that may need a second try."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect garbage again, but never look through what was imported and collected."""
    result = yield
    gc.enable()
    gc.freeze()
    return result


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests by their fixtures, and begin with those that start whole programs."""
    for item in items:
        fixtures = set(getattr(item, "fixturenames", ()))
        if _IN_REAL_TIME & fixtures:
            item.add_marker(pytest.mark.flaky(reruns=1))
        if _WINDOWS & fixtures:
            item.add_marker("window")
        if _PROCESSES & fixtures:
            item.add_marker("process")
        if _file(item.nodeid) not in _LONG and not any(map(item.get_closest_marker, _NOT_QUICK)):
            item.add_marker("quick")
    items.sort(key=lambda item: _file(item.nodeid) not in _PROGRAMS)


def _file(nodeid: str) -> str:
    return nodeid.split("::", 1)[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a quick test that starts a process; collect no garbage during one with windows.

    A worker crashed once as former windows were deleted while Qt passed on an event.
    """
    with pytest.MonkeyPatch.context() as patch, ExitStack() as after:
        if item.get_closest_marker("window"):
            gc.disable()
            after.callback(gc.enable)
        if item.get_closest_marker("quick"):
            patch.setattr(subprocess.Popen, "__init__", _refuse_process)
            patch.setattr(multiprocessing.process.BaseProcess, "start", _refuse_process)
        return (yield)


def _refuse_process(self: object, *_arguments: object, **_options: object) -> None:
    pytest.fail("mark this test with pytest.mark.process: it starts one")


def pytest_configure(config: pytest.Config) -> None:
    """End a run whose worker crashes: with another in its place, xdist may wait for ever."""
    config.option.maxworkerrestart = "0"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Give out tests by file; all that start whole programs go to one worker, one by one."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):  # type: ignore[misc]  # xdist has no types
        def _split_scope(self, nodeid: str) -> str:
            return "programs" if _file(nodeid) in _PROGRAMS else _file(nodeid)

    config.option.loadscopereorder = False  # the programs first, then as collected
    return Scheduling(config, log)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run in which too many tests needed a second try."""
    too_many = len(_second_tries(session.config)) > _SECOND_TRIES
    if too_many and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """List the tests that needed a second try."""
    if tried := _second_tries(config):
        terminalreporter.section("second tries")
        for report in tried:
            crash = getattr(report.longrepr, "reprcrash", None)
            why = crash.message.splitlines()[0] if crash else ""
            terminalreporter.line(f"{report.nodeid} - {why}")
        if len(tried) > _SECOND_TRIES:
            terminalreporter.line(
                f"{len(tried)} tests needed a second try; at most {_SECOND_TRIES} may", red=True
            )


def _second_tries(config: pytest.Config) -> list[pytest.TestReport]:
    """Return the reports of failed first tries; none in xdist's workers, which have no terminal."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    return list(reporter.stats.get("rerun", ())) if reporter else []


@pytest.fixture(scope="session")
def alignment() -> Alignment:
    """Return an alignment of random numbers, each field unlike every other; it can be solved."""
    rng = np.random.default_rng(1)
    cloud_m = rng.normal(size=(150, 3)) * [0.05, 0.05, 0.005]
    return Alignment(
        cursor_m=cloud_m[:140],
        hand_m=cloud_m + rng.normal([0.01, 0.0, -0.01], 0.0005, (150, 3)),
        cursor_is_cut=rng.random(140) < 0.1,
        hand_is_cut=rng.random(150) < 0.1,
        T_E_W={
            "left": rigid(rng.normal(size=3), rng.normal(size=3)),
            "right": rigid(rng.normal(size=3), rng.normal(size=3)),
        },
        eyes=("right",),
        rotation_rad=rng.normal(size=3),
        t_a_ns=1_700_000_000_123_456_789,
        t_b_ns=1_700_000_003_123_456_789,
        drawn_shift_m={"left": 0.01 * rng.normal(size=3), "right": 0.01 * rng.normal(size=3)},
    )


@pytest.fixture(scope="session")
def simulated() -> Callable[..., Alignment]:
    """Return a maker of simulated alignments, by seed and the eyes that took part.

    The hand is sampled twice with noise and moved; both eyes see it from one viewpoint, shifted by
    at most 3 mm each way.
    """
    settings = AlignmentSettings(
        count=600,
        display_distance_m=Z_E_S_M,
        shift_max_m=0.003,
        resample=True,
        depth_sigma_m=0.001,
    )

    @cache
    def make(seed: int, eyes: Sequence[Eye] = EYES) -> Alignment:
        one = simulate_alignment(np.random.default_rng(seed), make_hand(1), 0.05, settings)
        return Alignment(
            cursor_m=one.cursor_m,
            hand_m=one.hand_m,
            cursor_is_cut=one.cursor_cut,
            hand_is_cut=one.hand_cut,
            T_E_W=dict.fromkeys(EYES, one.T_E_W),
            eyes=tuple(eyes),
            rotation_rad=one.rotation_rad,
            t_a_ns=1_000_000_000 * seed,
            t_b_ns=1_000_000_000 * seed + 500_000_000,
        )

    return make


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
    """Return a function that finds the virtual headset started by a process, by process ids."""
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
