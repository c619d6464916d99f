"""Specifications of the evaluations in the window."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial

from handcal.io.files import user_path
from handcal.lab.evaluate.cube_folder import find_captures
from handcal.lab.evaluate.cube_test import run_cube_test
from handcal.lab.evaluate.masked_frames import read_masked_names
from handcal.lab.evaluate.segmentation import run_segmentation_test
from handcal.lab.evaluate.user_test import holds_trials, run_user_test
from handcal.lab.settings import (
    CubeTestSettings,
    MethodComparisonSettings,
    NoiseStudySettings,
    SegmentationTestSettings,
)
from handcal.lab.study.studies import (
    method_cases,
    noise_cases,
    run_method_comparison,
    run_noise_study,
)
from handcal.session.journal import JOURNAL
from handcal.session.record import replay
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.capture_dialog import CaptureDialog
from handcal_gui.evaluate.entries import CubeEntries, UserEntries
from handcal_gui.evaluate.evaluation_page import EvaluationSpec, Preparation
from handcal_gui.evaluate.track_dialog import TrackDialog
from handcal_gui.evaluate.trials_dialog import TrialsDialog
from handcal_gui.evaluate.work import FileEvaluation, StudyEvaluation
from handcal_gui.widgets.entries_form import EntriesForm


def make_specs() -> Mapping[str, EvaluationSpec]:
    """Return the specifications by field of `EvaluationEntries`."""
    return {
        "noise": EvaluationSpec(
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
        ),
        "methods": EvaluationSpec(
            tr("Method comparison"),
            tr(
                "Which calibration method is most accurate for the same simulated wearers, and how "
                "much effort does it require? 100 simulated wearers take about eleven minutes on "
                "two cores."
            ),
            StudyEvaluation(method_cases, run_method_comparison),
            partial(EntriesForm, MethodComparisonSettings),
            tr("The errors and effort of each method will be shown here, beside published ones."),
        ),
        "cube": EvaluationSpec(
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
        ),
        "users": EvaluationSpec(
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
        ),
        "segmentation": EvaluationSpec(
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
        ),
    }


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
