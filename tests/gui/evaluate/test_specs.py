"""The evaluations that are offered, on little data."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import Rig
from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.lab.settings import (
    MethodComparisonSettings,
    NoiseStudySettings,
    SegmentationTestSettings,
)
from handcal.lab.study.methods import QUICK_METHODS, MethodSettings
from handcal.lab.study.noise import QUICK_NOISE
from handcal.lab.study.store import StudyFolder
from handcal.lab.study.studies import noise_cases, run_method_comparison, run_noise_study
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.evaluate.entries import CubeEntries, EvaluationEntries, UserEntries, make_specs
from handcal_gui.evaluate.work import StudyEvaluation


def test_every_form_shows_and_returns_its_entries(qtbot: QtBot) -> None:
    entries = EvaluationEntries(
        NoiseStudySettings("quick", 3, 2, "tcp://host:1", "/n"),
        MethodComparisonSettings(12, 4, 3, "tcp://host:2", "/m"),
        CubeEntries(
            *("/captures", "/cube.json", "/camera.json", "/c", "/rig.yaml", "right", 60, 5),
            poses=2,
            alignments=3,
        ),
        UserEntries("/sessions", "/u"),
        SegmentationTestSettings("/frames", "depth", output="/s"),
    )
    for name, spec in make_specs().items():
        form = spec.form()
        qtbot.addWidget(form)
        form.show_entries(getattr(entries, name))
        assert form.take(getattr(EvaluationEntries(), name)) == getattr(entries, name)


def test_what_cannot_be_prepared_yet_says_what_to_enter_first() -> None:
    for name, spec in make_specs().items():
        entries = getattr(EvaluationEntries(), name)
        for one in spec.preparations:
            assert one.is_possible(entries) or one.request


def test_studies_are_those_of_the_commands() -> None:
    specs = make_specs()
    noise, methods = specs["noise"].evaluation, specs["methods"].evaluation
    assert isinstance(noise, StudyEvaluation)
    assert noise.study(NoiseStudySettings("quick", seed=3)).settings == replace(QUICK_NOISE, seed=3)
    assert isinstance(methods, StudyEvaluation)
    study = methods.study(MethodComparisonSettings(wearers=7, seed=3))
    assert study.settings == MethodSettings(wearers=7, seed=3)
    quick = methods.study(MethodComparisonSettings(wearers=3, size="quick"))
    assert quick.settings == QUICK_METHODS
    assert (noise.order, methods.order) == (run_noise_study, run_method_comparison)


def test_another_study_in_the_folder_is_named_by_what_was_entered(tmp_path: Path) -> None:
    evaluation = make_specs()["noise"].evaluation
    quick = NoiseStudySettings("quick", output=str(tmp_path))
    study = noise_cases(quick)
    StudyFolder(tmp_path, study.name, asdict(study.settings), [study.cases])
    with pytest.raises(FileError) as refused:
        evaluation.readiness(replace(quick, size="full", seed=2))
    assert str(refused.value) == (
        f"{tmp_path} holds another study (another size; seed 1 there, 2 here); "
        "choose another folder, or the same entries"
    )


def test_what_is_entered_for_a_user_test_reaches_it(tmp_path: Path) -> None:
    entries = UserEntries(str(tmp_path / "none"), str(tmp_path / "results"))
    evaluation = make_specs()["users"].evaluation
    readiness = evaluation.readiness(entries)
    assert not readiness.can_run
    assert readiness.finding.found.startswith(f"there is no folder {tmp_path / 'none'}: choose")
    (tmp_path / "none").mkdir()
    readiness = evaluation.readiness(entries)
    assert not readiness.can_run
    assert readiness.finding.found.startswith("there is no session in")
    (tmp_path / "none" / "one").mkdir()
    (tmp_path / "none" / "one" / "journal.jsonl").touch()
    readiness = evaluation.readiness(entries)
    assert not readiness.can_run
    assert readiness.finding.found.startswith(f"no session in {tmp_path / 'none'} holds a trial:")
    with pytest.raises(FileError, match=r"no trial .*none"):
        evaluation.run(entries, Progress())


def test_a_user_test_is_ready_once_a_session_holds_a_trial(
    tmp_path: Path, record: SessionRecord, rig: Rig
) -> None:
    evaluation = make_specs()["users"].evaluation
    one, all_of_them = (
        UserEntries(str(path), str(tmp_path / "results"))
        for path in (record.path, record.path.parent)
    )
    for entries in (one, all_of_them):
        readiness = evaluation.readiness(entries)
        assert not readiness.can_run
        assert "record some in the panel Trials" in readiness.finding.found
    whose = record.wearer or "a wearer without a name"
    assert evaluation.readiness(one).finding.found.startswith(f"the session of {whose} holds no")
    with Session(record.path) as session:
        number = session.save_trial(
            make_trial(rig.eyes["left"], "left", 0.5, [0.0] * 3, [1e-3] * 3)
        )
        for entries in (one, all_of_them):
            assert evaluation.readiness(entries).can_run
        session.delete("trial", number)
    assert not evaluation.readiness(one).can_run


def test_the_folder_of_no_user_is_said_not_to_be_there() -> None:
    readiness = make_specs()["users"].evaluation.readiness(UserEntries("~nosuchuser", "/u"))
    assert readiness.finding.found.startswith("there is no folder ~nosuchuser: choose")


def test_without_sessions_there_is_no_user_test(tmp_path: Path) -> None:
    evaluation = make_specs()["users"].evaluation
    readiness = evaluation.readiness(UserEntries("", str(tmp_path)))
    assert not readiness.can_run
    assert "folder of sessions" in readiness.finding.found
    unreachable = UserEntries(str(tmp_path / ("n" * 300)), str(tmp_path))
    assert "there is no folder" in evaluation.readiness(unreachable).finding.found


def test_frames_are_chosen_before_the_segmentation_is_tested(tmp_path: Path) -> None:
    evaluation = make_specs()["segmentation"].evaluation
    entries = SegmentationTestSettings("", output=str(tmp_path / "results"))
    assert not evaluation.readiness(entries).can_run
    entries = replace(entries, folder=str(tmp_path / "none"))
    assert "there is no folder" in evaluation.readiness(entries).finding.found
    (tmp_path / "none").mkdir()
    with pytest.raises(FileError, match=r"none holds no meta\.json"):
        evaluation.readiness(entries)
    with pytest.raises(FileError, match=r"meta\.json"):
        evaluation.run(entries, Progress())


def test_a_cube_test_is_run_once_there_are_captures_to_look_at(tmp_path: Path) -> None:
    spec = make_specs()["cube"]
    capture, _ = spec.preparations
    entries = CubeEntries(output=str(tmp_path / "results"))
    assert spec.evaluation.readiness(entries).can_run
    assert not capture.is_possible(entries)
    absent = spec.evaluation.readiness(replace(entries, rig=str(tmp_path / "rig.yaml")))
    assert not absent.can_run
    assert "there is no file" in absent.finding.found
    entries = replace(entries, captures=str(tmp_path / "captures"))
    assert capture.is_possible(entries)
    readiness = spec.evaluation.readiness(entries)
    assert "no folder" in readiness.finding.found
    assert not readiness.can_run
    pose = tmp_path / "captures" / "centre" / "pose-1"
    pose.mkdir(parents=True)
    with pytest.raises(FileError, match=r"no captures.*; take them with Capture…"):
        spec.evaluation.readiness(entries)
    for name in ("real.png", "virtual.png"):
        (pose / name).touch()
    assert spec.evaluation.readiness(entries).can_run


def test_names_of_a_plan_are_separated_by_commas() -> None:
    entries = CubeEntries(positions="up, down,", poses=2, drawn="before ,after", with_grid=False)
    assert entries.plan == CapturePlan(("up", "down"), 2, ("before", "after"), False)
    with pytest.raises(ValueError, match="named twice"):
        _ = CubeEntries(positions="up, up").plan
