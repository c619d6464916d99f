"""The user test over sessions of known errors."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.errors import FileError
from handcal.core.types import EYES, Float64
from handcal.lab.evaluate.user_test import (
    UserTest,
    evaluate_user_test,
    read_user_test,
    user_test_report,
)
from handcal.report.cells import median_quartiles
from handcal.report.document import Table
from handcal.report.statistics import mean_interval
from handcal.rig.example import example_rig
from handcal.session.comparison import COMPARED, Answer, Comparison, Drawing, comparison_json
from handcal.session.journal import Event
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial, trial_spread

RIG = example_rig()


def make_session(parent: Path, wearer: str, shifts_m: Float64, name: str) -> Path:
    """Make a session with a calibration for every φ, of which zero is the truth."""
    with Session.create(parent, RIG, {}, name=name, wearer=wearer) as session:
        for shift_m in shifts_m:
            for eye in EYES:
                for depth_m in TARGET_DEPTHS_M:
                    session.save_trial(
                        make_trial(RIG.eyes[eye], eye, depth_m, shift_m, np.zeros(3))
                    )
    return session.path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return sessions of wearers a (two), b and one without a name; and what is left out."""
    parent = tmp_path_factory.mktemp("sessions")
    random = np.random.default_rng(1)
    shifts_m = random.normal(0.0, 0.001, (7, 3))
    make_session(parent, "a", shifts_m[:2], "one")
    make_session(parent, "a", shifts_m[2:3], "two")
    make_session(parent, "b $x_1$ [red] 🙂", shifts_m[3:6], "three")
    make_session(parent, "", shifts_m[6:], "four")
    make_session(parent, "c", np.empty((0, 3)), "no-trial")
    shutil.copytree(parent / "one", parent / "zz-copy")
    (parent / "broken").mkdir()
    (parent / "broken" / "journal.jsonl").write_text("no journal\n")
    return parent


@pytest.fixture(scope="module")
def user_test(folder: Path) -> UserTest:
    return read_user_test([folder, folder / "one", folder / "missing"])


def test_sessions_are_read_once_and_others_named(user_test: UserTest, folder: Path) -> None:
    assert list(user_test.sessions) == ["four", "one", "three", "two"]
    left_out = {Path(path).name: why for path, why in user_test.left_out.items()}
    assert set(left_out) == {"no-trial", "broken", "zz-copy", "missing"}
    assert "holds no trial" in left_out["no-trial"]
    assert "line 1 is not an event" in left_out["broken"]
    assert left_out["zz-copy"] == f"is a copy of {folder / 'one'}"
    assert "is not a session" in left_out["missing"]


def test_errors_are_those_of_the_trials(user_test: UserTest) -> None:
    result = evaluate_user_test(user_test)
    trials = [trial for record in user_test.sessions.values() for trial in record.trials.values()]
    corners = np.concatenate([trial.error_arcmin for trial in trials])
    assert result.total.corner_arcmin.mean == pytest.approx(corners.mean())
    assert result.total.corner_arcmin.median == pytest.approx(np.median(corners))
    means = [trial.error_arcmin.mean() for trial in trials]
    assert result.total.arcmin.mean == pytest.approx(np.mean(means))
    assert result.total.arcmin.sd == pytest.approx(np.std(means, ddof=1)), "of trials"
    assert (result.total.calibrations, result.total.trials) == (7, 42)
    assert {name: group.calibrations for name, group in result.by_wearer.items()} == {
        "a": 3,
        "b $x_1$ [red] 🙂": 3,
        "not named, four": 1,
    }
    assert [group.trials for group in result.by_eye.values()] == [21, 21]
    assert list(result.by_depth_m) == ["0.4", "0.5", "0.6"]
    assert result.components_arcmin is not None
    json.dumps(asdict(result), allow_nan=False)


def test_the_spread_of_trials_is_that_of_the_windows_panel(folder: Path) -> None:
    record = Session.open(folder / "one")
    shown = trial_spread(record.trials, list(record.trials))
    found = evaluate_user_test(read_user_test([folder / "one"])).total
    assert found.arcmin.mean == pytest.approx(shown.mean_arcmin)
    assert found.arcmin.sd == pytest.approx(shown.trial_sd_arcmin)
    assert found.trials == shown.trials


def test_intervals_are_over_wearers_and_of_one_over_calibrations(user_test: UserTest) -> None:
    result = evaluate_user_test(user_test)
    means = [group.arcmin.mean for group in result.by_wearer.values()]
    expected = mean_interval(means)
    found = result.total.interval_arcmin
    assert found is not None
    assert result.total.unit == "wearer"
    assert [found.low, found.high] == pytest.approx([expected.low, expected.high])
    of_a, of_unnamed = (result.by_wearer[name] for name in ("a", "not named, four"))
    assert of_a.interval_arcmin is not None
    assert (of_a.unit, of_a.interval_arcmin.clusters) == ("calibration", 3)
    assert of_unnamed.interval_arcmin is None


def test_a_single_wearers_interval_is_over_calibrations(folder: Path) -> None:
    result = evaluate_user_test(read_user_test([folder / "one", folder / "two"]))
    found = result.total.interval_arcmin
    assert found is not None
    assert (result.total.unit, found.clusters) == ("calibration", 3)
    assert result.components_arcmin is None


def test_without_trials_there_is_nothing_to_evaluate(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no trial of the user test.*no-trial: holds no trial"):
        read_user_test([folder / "no-trial"])
    second = make_session(tmp_path / "other", "e", np.empty((0, 3)), "second")
    with pytest.raises(FileError, match=r"\(2 sessions: holds no trial of the user test\)"):
        read_user_test([folder / "no-trial", second])
    with pytest.raises(FileError, match="is not a session"):
        read_user_test([tmp_path])


def test_sessions_of_one_name_are_told_apart(folder: Path, tmp_path: Path) -> None:
    other = make_session(tmp_path, "d", np.full((1, 3), 0.001), "one")
    found = read_user_test([folder / "one", other])
    assert list(found.sessions) == [str(folder / "one"), str(other)]


def test_the_report_says_it(user_test: UserTest) -> None:
    result = evaluate_user_test(user_test)
    report = user_test_report(user_test, result)
    found = result.total.interval_arcmin
    assert found is not None
    assert report.lead.startswith(
        f"Mean reprojection error over 3 wearers {found.mean:.2f} arcmin, 95 % interval "
        f"{found.low:.2f}\u00a0to\u00a0{found.high:.2f}."
    )
    assert report.subject == "3 wearers, 4 sessions, 42 trials"
    tables = [item for part in report.sections for item in part.items if isinstance(item, Table)]
    cells = [cell for table in tables for row in table.rows for cell in row]
    assert median_quartiles(result.by_wearer["a"].arcmin) in cells
    assert "holds no trial of the user test" in cells
    assert {figure.name for figure in report.figures} == {"errors", "wearers-1", "corners"}
    published = ("Moser & Swan 2016, finger, 25", "16.98", "10.83–25.51", "0.93–46.87")
    assert published in [tuple(row) for table in tables for row in table.rows]


def test_the_report_counts_simulated_sessions_and_blinded_comparisons(user_test: UserTest) -> None:
    def summary(sessions: dict[str, SessionRecord]) -> dict[str, str]:
        test = replace(user_test, sessions=sessions)
        [table, _] = user_test_report(test, evaluate_user_test(test)).sections[0].items
        assert isinstance(table, Table)
        return {row[0]: row[1] for row in table.rows}

    sessions = dict(user_test.sessions)
    assert not {"Simulated sessions", "Blinded comparisons"} & set(summary(sessions))
    name, record = next(iter(sessions.items()))
    answers: tuple[tuple[Drawing, Answer], ...] = (("offline", "second"), ("applied", "neither"))
    events = tuple(
        Event(number, record.events[-1].time, COMPARED, comparison_json(Comparison(*one, {})))
        for number, one in enumerate(answers, 100)
    )
    settings = {"station": {"source": "simulator", "headset": "virtual"}}
    sessions[name] = replace(record, events=(*record.events, *events), settings=settings)
    said = summary(sessions)
    assert said["Simulated sessions"] == "1"
    test = replace(user_test, sessions=sessions)
    lead = user_test_report(test, evaluate_user_test(test)).lead
    assert lead.endswith(f" Simulated sessions: 1 of {len(sessions)}.")
    assert said["Blinded comparisons"] == "1 better with the calibration, 0 without it, 1 neither"


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    monkeypatch.setattr("sys.argv", ["handcal", "evaluate", "users", *map(str, arguments)])
    main()


def test_the_command_writes_it_whatever_the_wearers_names(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figures = tmp_path / "json" / "users.json"
    run(monkeypatch, folder, "--output", tmp_path / "out", "--json", figures)
    said = capsys.readouterr().out
    assert "b $x_1$ [red] 🙂" in said
    assert f"Left out: {folder / 'no-trial'}: holds no trial of the user test" in said
    assert json.loads(figures.read_text())["total"]["corners"] == 168
    assert (tmp_path / "out" / "figures" / "wearers-1.csv").read_text().count("\n") == 4
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "b $x_1$ [red] 🙂" in html
    assert (tmp_path / "out" / "report.pdf").read_bytes().startswith(b"%PDF")
