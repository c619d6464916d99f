"""The evaluations offered: what is entered for each, its work and its page.

The preferences hold the entries, so what runs an evaluation is imported with its page.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QStandardPaths

from handcal.core.entry import CUBE_FILES, entry
from handcal.io.files import user_path
from handcal.lab.evaluate.cube_folder import CapturePlan, find_captures
from handcal.lab.settings import (
    CubeTestSettings,
    MethodComparisonSettings,
    NoiseStudySettings,
    SegmentationTestSettings,
    UserTestSettings,
    results_folder,
)
from handcal.session.journal import JOURNAL
from handcal.session.record import replay
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.evaluation_page import EvaluationSpec, Preparation
from handcal_gui.evaluate.work import FileEvaluation, StudyEvaluation
from handcal_gui.widgets.entries_form import EntriesForm

Kind = TypeVar("Kind")
_PLAN = CapturePlan()


def _folder(name: str) -> str:
    documents = QStandardPaths.StandardLocation.DocumentsLocation
    return str(Path(QStandardPaths.writableLocation(documents)) / "handcal evaluations" / name)


@dataclass(frozen=True, slots=True)
class CubeEntries(CubeTestSettings):
    """Settings of the cube test, and the plan of its captures."""

    positions: str = entry(
        ", ".join(_PLAN.positions),
        tr("&Positions"),
        tr("Positions of the camera in the eye box: names of folders, separated by commas."),
    )
    drawn: str = entry(
        ", ".join(_PLAN.drawn),
        tr("&Renderings"),
        tr("Names of the renderings to compare, such as: before, after."),
        hint=tr("One"),
    )
    """Names with commas between them, as of `CapturePlan`."""
    with_grid: bool = entry(
        _PLAN.with_grid,
        tr("Display's grid"),
        tr("Without the grid, errors are measured along the camera's axes, not the display's."),
        hint=tr("At &each position"),
    )
    tracked_by: str = entry(
        "network",
        tr("Tracked &by"),
        tr("A headset draws the cube's edges where it stands in the room."),
        options={
            "network": tr("RealSense on a paired headset"),
            "camera": tr("RealSense that does not move"),
            "virtual": tr("Simulator"),
        },
    )

    @property
    def plan(self) -> CapturePlan:
        """The plan of the captures; ValueError if a name is wrong."""
        return CapturePlan(_names(self.positions), self.poses, _names(self.drawn), self.with_grid)


@dataclass(frozen=True, slots=True)
class UserEntries:
    """Settings of the user test: a folder of sessions, or a session."""

    sessions: str = entry(
        "",
        tr("&Sessions"),
        tr("Folder of one session, or a folder that contains sessions."),
        path="folder",
    )
    output: str = results_folder("")
    headset: str = entry(
        "network",
        tr("&Headset"),
        tr("The simulator needs a session of a simulated wearer, who adjusts φ."),
        options={"network": tr("Paired headset, RealSense"), "virtual": tr("Simulator")},
    )
    """Of trials with a cube."""
    cube: str = entry("", tr("C&ube"), hint=tr("60 mm cube"), path="file", files=CUBE_FILES)
    """Description of that cube."""

    @property
    def settings(self) -> UserTestSettings:
        """The same as the evaluation takes it."""
        return UserTestSettings((self.sessions,), self.output)


def _noise() -> EvaluationSpec:
    from handcal.lab.study.studies import noise_cases, run_noise_study

    return EvaluationSpec(
        tr("Noise study"),
        tr(
            "How much rotation and noise do the solvers tolerate before their error exceeds "
            "the 4 mm of Hu et al. 2021? 55 minutes in one process beside other programs, "
            "less in several; half a minute for a quick run."
        ),
        StudyEvaluation(noise_cases, run_noise_study),
        partial(EntriesForm, NoiseStudySettings),
        tr(
            "The mean error of each solver over rotation and noise will be shown here, and up "
            "to where it stays within 4 mm."
        ),
    )


def _methods() -> EvaluationSpec:
    from handcal.lab.study.studies import method_cases, run_method_comparison

    return EvaluationSpec(
        tr("Method comparison"),
        tr(
            "Which calibration method is most accurate for the same simulated wearers, and how "
            "much effort does it require? 100 simulated wearers take about eleven minutes on "
            "two cores."
        ),
        StudyEvaluation(method_cases, run_method_comparison),
        partial(EntriesForm, MethodComparisonSettings),
        tr("The errors and effort of each method will be shown here, beside published ones."),
    )


def _cube() -> EvaluationSpec:
    from handcal.lab.evaluate.cube_test import run_cube_test
    from handcal_gui.evaluate.capture_dialog import CaptureDialog
    from handcal_gui.evaluate.track_dialog import TrackDialog

    return EvaluationSpec(
        tr("Cube test"),
        tr(
            "How far is a drawn cube from the real one, as seen by a camera at the eye "
            "position? About a minute with rendered captures."
        ),
        FileEvaluation(_missing_captures, run_cube_test),
        partial(EntriesForm, CubeTestSettings),
        tr(
            "How far the drawn cube is from the real one will be shown here, by axis and by "
            "position of the camera."
        ),
        (
            Preparation(
                tr("&Capture…"),
                tr("Take the captures with a camera; enter their folder first."),
                lambda entries: bool(entries.captures),
                CaptureDialog,
                request=tr("To capture, choose a folder in Captures."),
            ),
            Preparation(
                tr("&Track cube…"),
                tr("Track the cube with the depth camera, and have the headset draw it."),
                lambda _: True,
                TrackDialog,
                "track",
            ),
        ),
    )


def _users() -> EvaluationSpec:
    from handcal.lab.evaluate.user_test import run_user_test
    from handcal_gui.evaluate.trials_dialog import TrialsDialog

    return EvaluationSpec(
        tr("User test"),
        tr(
            "How large are the errors that wearers see after calibration, over all trials of "
            "their sessions? A few seconds."
        ),
        FileEvaluation(
            _missing_sessions,
            lambda entries, progress: run_user_test(entries.settings, progress),
        ),
        partial(EntriesForm, UserEntries, ("sessions", "output")),
        tr(
            "The errors of all trials and of each wearer will be shown here, and where the "
            "corners were drawn."
        ),
        (
            Preparation(
                tr("Re&cord trials…"),
                tr(
                    "Record the trials of one session with a cube in the room; enter the "
                    "session first."
                ),
                lambda entries: bool(entries.sessions),
                TrialsDialog,
                request=tr("To record, choose a session in Sessions."),
            ),
        ),
    )


def _segmentation() -> EvaluationSpec:
    from handcal.lab.evaluate.segmentation import run_segmentation_test

    return EvaluationSpec(
        tr("Segmentation"),
        tr(
            "How well does the segmented hand agree with true masks of your own camera's "
            "frames, and how stable is it? About a second per frame."
        ),
        FileEvaluation(_missing_frames, run_segmentation_test),
        partial(EntriesForm, SegmentationTestSettings),
        tr(
            "How well each frame agrees with its mask will be shown here, with pictures of "
            "where they differ."
        ),
        note=tr(
            "A frame NAME is NAME_depth.png, NAME_handmask.png and, if there is one, "
            'NAME_color.png; meta.json describes all frames: <a href="{}">its contents</a>.'
        ).format("docs/commands.md#handcal-evaluate-segmentation"),
    )


def _evaluation(make: Callable[[], EvaluationSpec], kind: Callable[..., Kind]) -> Kind:
    """Return a field of `EvaluationEntries`: how its page is made, and its entries at first."""
    name = make.__name__.removeprefix("_")
    made: Kind = field(default_factory=lambda: kind(output=_folder(name)), metadata={"spec": make})
    return made


@dataclass(frozen=True, slots=True)
class EvaluationEntries:
    """Everything entered for evaluations: a field for each that is offered, in order."""

    noise: NoiseStudySettings = _evaluation(_noise, NoiseStudySettings)
    methods: MethodComparisonSettings = _evaluation(_methods, MethodComparisonSettings)
    cube: CubeEntries = _evaluation(_cube, CubeEntries)
    users: UserEntries = _evaluation(_users, UserEntries)
    segmentation: SegmentationTestSettings = _evaluation(_segmentation, SegmentationTestSettings)


def make_specs() -> Mapping[str, EvaluationSpec]:
    """Return how each evaluation's page is made, by field of `EvaluationEntries`."""
    return {one.name: one.metadata["spec"]() for one in fields(EvaluationEntries)}


def _missing_captures(entries: CubeEntries) -> str:
    for file in filter(None, (entries.cube, entries.camera, entries.rig)):
        if not os.path.isfile(user_path(file)):
            return tr("there is no file {}: choose another, or leave the field empty").format(file)
    if not entries.captures:
        return ""
    folder = user_path(entries.captures)
    if not os.path.exists(folder):
        return tr("there is no folder {} yet: press Capture… to create it").format(folder)
    find_captures(folder)  # raises an error if they are not usable
    return ""


def _missing_sessions(entries: UserEntries) -> str:
    from handcal.lab.evaluate.user_test import holds_trials

    request = tr("choose a session, or a folder of sessions")
    if missing := _missing_folder(entries.sessions, request):
        return missing
    folder = user_path(entries.sessions)
    if not any(path.is_file() for path in (folder / JOURNAL, *folder.glob(f"*/{JOURNAL}"))):
        return tr("there is no session in {}: {}").format(entries.sessions, request)
    if holds_trials(folder):
        return ""
    if (folder / JOURNAL).is_file():
        return tr(
            "the session of {} holds no trial: record some in the panel Trials, or press Record "
            "trials…"
        ).format(replay(folder).state.wearer or tr("a wearer without a name"))
    return tr(
        "no session in {} holds a trial: record some in the panel Trials, or choose one session "
        "and press Record trials…"
    ).format(entries.sessions)


def _missing_frames(entries: SegmentationTestSettings) -> str:
    from handcal.lab.evaluate.masked_frames import read_masked_names

    request = tr("choose a folder of frames with true masks")
    missing = _missing_folder(entries.folder, request)
    if not missing:
        read_masked_names(user_path(entries.folder))  # raises an error if they are not usable
    return missing


def _missing_folder(folder: str, request: str) -> str:
    """Return a request to choose a folder; empty if there is the one entered."""
    if not folder:
        return request
    if not os.path.isdir(user_path(folder)):
        return tr("there is no folder {}: {}").format(folder, request)
    return ""


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, map(str.strip, text.split(","))))
