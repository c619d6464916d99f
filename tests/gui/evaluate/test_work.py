"""Evaluations, tested without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.lab.evaluate.user_test import UserTestRun
from handcal.lab.settings import NoiseStudySettings
from handcal.lab.study.run import run_study
from handcal.report.document import Report
from handcal.report.write import write_report
from handcal_gui.evaluate.entries import UserEntries
from handcal_gui.evaluate.work import FileEvaluation, time_left


def test_a_study_is_done_and_told(numbers: Any, entries: NoiseStudySettings) -> None:
    told: list[tuple[str, float]] = []
    assert numbers.work.readiness(entries).button == "Run"
    assert not Path(entries.output).exists()
    outcome = numbers.work.run(entries, Progress(lambda *one: told.append(one)))
    assert outcome.report.lead == "Squares grow."
    assert (outcome.folder / "report.pdf").exists()
    (picture,) = outcome.pictures
    assert picture.shape[2] == 3
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[0] == ("0 of 10 cases", 0.0)
    assert told[10][0] == "10 of 10 cases, less than a minute left"
    assert told[-1] == ("Writing the report", 1.0)
    assert numbers.work.readiness(entries).button == "Show results"


def test_a_study_goes_on_in_its_folder_only(
    numbers: Any, entries: NoiseStudySettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares: list[float] = []
    with pytest.raises(CancelledError):
        numbers.work.run(
            entries,
            Progress(lambda _doing, share: shares.append(share), lambda: len(shares) > 4),
        )
    readiness = numbers.work.readiness(entries)
    assert readiness.button == "Resume"
    assert readiness.finding.found.endswith("holds 40 % of this study")
    with monkeypatch.context() as patch:
        patch.setattr("os.access", lambda *_: False)
        with pytest.raises(FileError, match="cannot write to"):
            numbers.work.readiness(entries)
    with pytest.raises(FileError, match="holds another study"):
        numbers.work.readiness(replace(entries, seed=2))
    with pytest.raises(FileError, match="choose a folder"):
        numbers.work.readiness(replace(entries, output=""))


def _refuse(refused: Path, exists: Callable[[Path], bool]) -> Callable[[Path], bool]:
    """Return a test of existence that raises an error as for a folder of another user."""

    def refuse(path: Path) -> bool:
        if path == refused:
            raise PermissionError(13, "Permission denied", str(path))
        return exists(path)

    return refuse


def test_nothing_is_ready_whose_results_cannot_be_written(
    numbers: Any, entries: NoiseStudySettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = FileEvaluation(lambda _: "", lambda *_: UserTestRun(None, None, ()))  # type: ignore[arg-type]
    (tmp_path / "file").touch()
    for work, given in ((numbers.work, entries), (data, UserEntries())):
        with pytest.raises(FileError, match="is a file: choose a folder"):
            work.readiness(replace(given, output=str(tmp_path / "file" / "results")))
    replaced, out_of_reach = tmp_path / "replaced", tmp_path / "another user" / "new"
    replaced.mkdir()
    (replaced / "report.pdf").touch()
    monkeypatch.setattr("os.access", lambda *_: False)
    monkeypatch.setattr(Path, "exists", _refuse(out_of_reach, Path.exists))
    with pytest.raises(FileError, match="cannot write to"):
        numbers.work.readiness(entries)
    for output in ("new", replaced, out_of_reach):
        with pytest.raises(FileError, match="cannot write to"):
            data.readiness(UserEntries(output=str(output)))


def test_given_data_never_goes_into_a_study(numbers: Any, entries: NoiseStudySettings) -> None:
    def order(given: UserEntries, progress: Progress) -> UserTestRun:
        progress.at(0.7, "Reading")
        report = Report("Data", "given", "Read.", [])
        files = write_report(Path(given.output), report)
        return UserTestRun(None, report, files)  # type: ignore[arg-type]

    data = FileEvaluation(lambda given: "" if given.sessions else "no sessions", order)
    given = UserEntries(sessions="here", output=f"{entries.output}-data")
    missing = data.readiness(replace(given, sessions=""))
    assert not missing.can_run
    assert data.readiness(given).can_run
    told: list[tuple[str, float]] = []
    outcome = data.run(given, Progress(lambda *one: told.append(one)))
    assert (outcome.report.title, outcome.folder) == ("Data", Path(given.output))
    assert told == [("Reading", 0.7)]
    assert "will be replaced" in data.readiness(given).finding.found
    with pytest.raises(CancelledError):
        data.run(given, Progress(is_cancelled=lambda: True))
    run_study(numbers.work.study(entries), Path(entries.output), workers=1)
    with pytest.raises(FileError, match="holds a study"):
        data.readiness(replace(given, output=entries.output))


@pytest.mark.parametrize(
    ("elapsed_s", "share", "begun", "words"),
    [
        (60.0, 0.5, 0.5, ""),
        (60.0, 0.75, 0.5, "about 1 min left"),
        (10.0, 0.5, 0.0, "less than a minute left"),
        (3600.0, 0.25, 0.0, "about 3 h 0 min left"),
    ],
)
def test_the_time_left_counts_only_what_was_done_since_the_start(
    elapsed_s: float, share: float, begun: float, words: str
) -> None:
    assert time_left(elapsed_s, share, begun) == words
