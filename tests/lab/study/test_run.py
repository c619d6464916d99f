"""Runs of a study: in any number of processes, resumed, and refused."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import CancelledError, FileError, HandcalError
from handcal.core.progress import Progress
from handcal.lab.study.run import OVERSUBSCRIBE, Case, Study, open_workers, run_study, share_done
from handcal.lab.study.store import StudyRow
from tests.helpers import ROOT

CASES, MIDDLE = 90, 45


@dataclass(frozen=True)
class Settings:
    """`kills` names the process, this or its parent, that a case in the middle kills once."""

    scale: float = 3.0
    log: str = ""
    kills: str = ""
    folder: str = ""


def trial(settings: Settings, case: Case) -> list[StudyRow]:
    number = int(case["number"])
    if settings.log:
        with Path(settings.log).open("a") as file:
            file.write(f"{number}\n")
    if settings.kills and number == MIDDLE:
        kill_once(settings)
    value = settings.scale * np.random.default_rng(number).normal()
    row: StudyRow = {**case, "value": value, "is_even": number % 2 == 0, "gap": None}
    return [row] * (number % 3)


def kill_once(settings: Settings) -> None:
    killed = Path(settings.folder) / "killed"
    if not killed.exists():
        while not any(Path(settings.folder, "chunks").glob("0*.json")):
            time.sleep(0.01)
        killed.touch()
        os.kill(os.getpid() if settings.kills == "self" else os.getppid(), signal.SIGKILL)


def threads(settings: Settings, case: Case) -> list[StudyRow]:
    return [{"OMP_NUM_THREADS": os.environ["OMP_NUM_THREADS"]}]


def fail_at_three(settings: Settings, case: Case) -> list[StudyRow]:
    if case["number"] == 3:
        raise ValueError("no such thing")
    return trial(settings, case)


def sleep(settings: Settings, case: Case) -> list[StudyRow]:
    Path(settings.log).touch()
    time.sleep(600.0)
    return []


def nan(settings: Settings, case: Case) -> list[StudyRow]:
    return [{"value": np.nan}]


def make_study(settings: Settings | None = None, cases: int = CASES) -> Study:
    return Study(
        "numbers", settings or Settings(), [{"number": number} for number in range(cases)], trial
    )


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let other processes import this file's functions."""
    monkeypatch.syspath_prepend(ROOT)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


@pytest.fixture(autouse=True)
def _few_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pack several of the few cases into one chunk."""
    monkeypatch.setattr("handcal.lab.study.run._MAX_CHUNKS", 30)


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
    patient = {f"distributed.comm.timeouts.{what}": "120s" for what in ("connect", "tcp")}
    path, sys.path[:] = sys.path[:], [str(ROOT), *sys.path]
    try:
        with (
            dask.config.set(patient),
            distributed.LocalCluster(
                n_workers=2,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address=None,
            ) as cluster,
        ):
            yield cluster.scheduler_address
    finally:
        sys.path[:] = path


def log_lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def cancel_after(calls: int) -> Callable[[], bool]:
    counter = iter(range(calls))
    return lambda: next(counter, None) is None


def test_rows_come_in_the_order_of_the_cases(tmp_path: Path) -> None:
    study = make_study()
    shares: list[float] = []
    rows = run_study(
        study, tmp_path, workers=1, progress=Progress(lambda _what, share: shares.append(share))
    )
    assert rows == [row for case in study.cases for row in trial(study.settings, case)]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    header, first, *_ = (tmp_path / "rows.csv").read_text().splitlines()
    assert header == "number,value,is_even,gap"
    assert first == f"1,{rows[0]['value']},False,"


def test_the_same_bytes_on_any_number_of_workers(tmp_path: Path, cluster: str) -> None:
    study = make_study()
    alone = run_study(study, tmp_path / "alone", workers=1)
    two = run_study(study, tmp_path / "two", workers=2)
    dask = run_study(study, tmp_path / "dask", scheduler=cluster)
    assert alone == two == dask
    files = [f.relative_to(tmp_path / "alone") for f in (tmp_path / "alone").rglob("*.*")]
    assert len(files) == 32
    for file in files:
        contents = {(tmp_path / name / file).read_bytes() for name in ("alone", "two", "dask")}
        assert len(contents) == 1


def test_a_study_that_is_done_is_not_done_again(tmp_path: Path) -> None:
    log = tmp_path / "log"
    study = make_study(Settings(log=str(log)))
    rows = run_study(study, tmp_path / "study", workers=1)
    log.unlink()
    assert run_study(study, tmp_path / "study", workers=1) == rows
    assert not log.exists()


@pytest.mark.process
def test_cancelling_gives_up_what_other_processes_are_at(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    study = replace(make_study(Settings(log=str(begun))), trial=sleep)
    before = set(multiprocessing.active_children())
    with pytest.raises(CancelledError):
        run_study(
            study, tmp_path / "study", workers=2, progress=Progress(is_cancelled=begun.exists)
        )
    assert set(multiprocessing.active_children()) == before


def test_how_much_of_a_study_is_done_is_reported_without_a_trace(tmp_path: Path) -> None:
    study, folder = make_study(), tmp_path / "study"
    assert share_done(study, folder) == 0.0
    assert not folder.exists()
    run_study(study, folder, workers=1)
    assert share_done(study, folder) == 1.0
    with pytest.raises(FileError, match="another study"):
        share_done(make_study(Settings(scale=4.0)), folder)


def test_a_cancelled_study_goes_on(tmp_path: Path) -> None:
    log = tmp_path / "log"
    study = make_study(Settings(log=str(log)))
    with pytest.raises(CancelledError, match="to resume it"):
        run_study(
            study,
            tmp_path / "study",
            workers=1,
            progress=Progress(is_cancelled=cancel_after(CASES // 2)),
        )
    began = len(log_lines(log))
    kept = len(list((tmp_path / "study" / "chunks").iterdir()))
    assert 0 < kept < 30
    assert share_done(study, tmp_path / "study") == kept / 30
    rows = run_study(study, tmp_path / "study", workers=1)
    assert rows == run_study(make_study(), tmp_path / "other", workers=1)
    assert len(log_lines(log)) - began == CASES - 3 * kept


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_killed_study_goes_on_and_leaves_no_process(tmp_path: Path) -> None:
    study = make_study(Settings(kills="parent", folder=str(tmp_path)))
    code = (
        "from tests.lab.study.test_run import *\n"
        "import handcal.lab.study.run as run\n"
        "run._MAX_CHUNKS = 30\n"
        f"run_study(make_study({study.settings}), Path({str(tmp_path)!r}), workers=2)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        process.communicate(timeout=300)  # ends once no process is left that could write
        assert process.returncode == -signal.SIGKILL
    rows = run_study(study, tmp_path, workers=1)
    assert rows == run_study(make_study(), tmp_path / "other", workers=1)


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_worker_that_dies_is_reported_and_the_study_continues(tmp_path: Path) -> None:
    study = make_study(Settings(kills="self", folder=str(tmp_path)))
    with pytest.raises(HandcalError, match="a process of the study died"):
        run_study(study, tmp_path, workers=2)
    rows = run_study(study, tmp_path, workers=1)
    assert rows == run_study(make_study(), tmp_path / "other", workers=1)


@pytest.mark.parametrize("damage", [b"", b"{", b'{"rows": [[]], "sha256": ""}', b"\xff", None])
def test_a_damaged_chunk_is_done_again(tmp_path: Path, damage: bytes | None) -> None:
    rows = run_study(make_study(), tmp_path, workers=1)
    chunk = tmp_path / "chunks" / "0007.json"
    whole = chunk.read_bytes()
    chunk.write_bytes(whole.replace(b"0.", b"1.", 1) if damage is None else damage)
    assert run_study(make_study(), tmp_path, workers=1) == rows
    assert chunk.read_bytes() == whole


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (make_study(Settings(scale=2.0)), r"scale 3\.0 there, 2\.0 here"),
        (make_study(cases=CASES + 1), "cases 90 there, 91 here"),
        (replace(make_study(), name="letters"), "name 'numbers' there, 'letters' here"),
        (replace(make_study(), cases=[{"number": 1}] * CASES), r"\(other cases\)"),
    ],
)
def test_a_folder_of_another_study_is_refused(tmp_path: Path, other: Study, message: str) -> None:
    run_study(make_study(), tmp_path, workers=1)
    table = (tmp_path / "rows.csv").read_bytes()
    with pytest.raises(FileError, match=message):
        run_study(other, tmp_path, workers=1)
    assert (tmp_path / "rows.csv").read_bytes() == table


def test_a_trial_that_fails_says_in_which_case(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such thing") as raised:
        run_study(replace(make_study(), trial=fail_at_three), tmp_path, workers=1)
    assert "in the study's case {'number': 3}" in raised.value.__notes__


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nowhere", "tcp://nowhere.invalid:1"])
def test_no_cluster_there(tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("handcal.lab.study.run._CONNECT_S", 0.2)
    with pytest.raises(HandcalError, match="no Dask scheduler answers"):
        run_study(make_study(), tmp_path, scheduler=address)


@pytest.mark.process
def test_the_environment_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    study = replace(make_study(cases=2), trial=threads)
    rows = run_study(study, tmp_path, workers=2)
    assert {row["OMP_NUM_THREADS"] for row in rows} == {"1"}
    assert dict(os.environ) == before


def test_a_link_in_a_studys_folder_is_not_followed(tmp_path: Path) -> None:
    mine, folder = tmp_path / "mine", tmp_path / "study"
    mine.mkdir()
    (mine / "0000.json").write_text("mine")
    folder.mkdir()
    (folder / "chunks").symlink_to(mine)
    with pytest.raises(FileError, match="is a link"):
        run_study(make_study(), folder, workers=1)
    (folder / "chunks").unlink()
    run_study(make_study(), folder, workers=1)
    (folder / "study.json").rename(mine / "study.json")
    (folder / "study.json").symlink_to(mine / "study.json")
    with pytest.raises(FileError, match="is a link"):
        run_study(make_study(), folder, workers=1)
    assert (mine / "0000.json").read_text() == "mine"


def opened_workers(workers: int | None, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return how many processes were asked for, without starting them."""
    asked: list[int] = []

    class Pool(ThreadPoolExecutor):
        def __init__(self, workers: int, *_: object) -> None:
            asked.append(workers)
            super().__init__(1)

    monkeypatch.setattr("handcal.lab.study.run.ProcessPoolExecutor", Pool)
    with open_workers(workers, None) as executor:
        assert executor.submit(abs, -3).result() == 3
    return asked


@pytest.mark.parametrize("workers", [None, 2, 4])
def test_there_are_no_more_workers_than_cores(
    workers: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    assert opened_workers(workers, monkeypatch) == [workers or 4]
    with pytest.raises(HandcalError, match="5 processes on the 4 cores"):
        opened_workers(5, monkeypatch)
    monkeypatch.setenv(OVERSUBSCRIBE, "1")
    assert opened_workers(5, monkeypatch) == [5]


@pytest.mark.parametrize(("platform", "opened"), [("win32", 61), ("linux", 100)])
def test_windows_waits_for_61_processes_at_most(
    platform: str, opened: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 100)
    monkeypatch.setattr(sys, "platform", platform)
    assert opened_workers(100, monkeypatch) == [opened]
