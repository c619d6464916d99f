"""Specifications of the evaluations in the window."""

from __future__ import annotations

import os
from collections.abc import Mapping

from PySide6.QtWidgets import QLineEdit, QSpinBox, QWidget

from handcal.io.files import user_path
from handcal.lab.evaluate.cube_folder import find_captures
from handcal.lab.evaluate.cube_test import run_cube_test
from handcal.lab.evaluate.masked_frames import read_masked_names
from handcal.lab.evaluate.segmentation import run_segmentation_test
from handcal.lab.evaluate.user_test import holds_trials, run_user_test
from handcal.lab.settings import SegmentationTestSettings
from handcal.lab.study.studies import (
    method_cases,
    noise_cases,
    run_method_comparison,
    run_noise_study,
)
from handcal.session.journal import JOURNAL
from handcal.session.record import replay
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.capture_dialog import MOST_POSES, CaptureDialog
from handcal_gui.evaluate.entries import CubeEntries, UserEntries
from handcal_gui.evaluate.evaluation_page import EvaluationSpec, Preparation
from handcal_gui.evaluate.track_dialog import TrackDialog
from handcal_gui.evaluate.trials_dialog import TrialsDialog
from handcal_gui.evaluate.work import FileEvaluation, StudyEvaluation
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import choice, whole_number, with_name
from handcal_gui.widgets.path_field import INTRINSICS_FILES, PathField

_MOST_WEARERS, _MOST_SEED, _MOST_PROCESSES = 10_000, 2**31 - 1, 1024
_MOST_ALIGNMENTS = 20


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
            _noise_form,
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
            _methods_form,
            tr("The errors and effort of each method will be shown here, beside published ones."),
        ),
        "cube": EvaluationSpec(
            tr("Cube test"),
            tr(
                "How far is a drawn cube from the real one, as seen by a camera at the eye "
                "position? About a minute with rendered captures."
            ),
            FileEvaluation(_missing_captures, run_cube_test),
            _cube_form,
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
            _users_form,
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
            _segmentation_form,
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


def _noise_form() -> EntriesForm:
    size = choice(
        "size",
        tr("Size"),
        {"full": tr("Full"), "quick": tr("Quick")},
        tr("A quick run uses few trials; do not report its numbers."),
    )
    return EntriesForm({"size": (tr("Si&ze"), size), **_study_fields()})


def _methods_form() -> EntriesForm:
    wearers = whole_number(
        "wearers", 2, _MOST_WEARERS, tr("Simulated wearers; each uses every method.")
    )
    return EntriesForm({"wearers": (tr("&Wearers"), wearers), **_study_fields()})


def _cube_form() -> EntriesForm:
    captures = PathField(tr("Captures"), "folder", empty=tr("Rendered by the simulator"))
    captures.setToolTip(tr("POSITION/POSE/real.png and virtual.png, and POSITION/grid.png."))
    cube = PathField(tr("Cube"), "file", tr("Cubes (*.json)"), tr("cube.json of the captures"))
    camera = PathField(tr("Camera"), "file", INTRINSICS_FILES, tr("camera.json of the captures"))
    camera.setToolTip(tr("Intrinsics of the camera at the eye position."))
    rig = PathField(tr("Rig file"), "file", tr("Rig files (*.yaml *.yml)"), tr("The example rig"))
    square = whole_number(
        "square", 20, 2000, tr("Side length of the squares of the display's grid.")
    )
    square.setSuffix(" px")
    poses = whole_number(
        "poses", 1, MOST_POSES, tr("Poses of the cube at each position, rendered or captured.")
    )
    alignments = whole_number(
        "alignments",
        1,
        _MOST_ALIGNMENTS,
        tr("Alignments at each position, if captures are rendered."),
    )
    return EntriesForm(
        {
            "captures": (tr("Ca&ptures"), captures),
            "cube": (tr("C&ube"), cube),
            "camera": (tr("Camera &intrinsics"), camera),
            **_output(),
            "rig": (tr("Ri&g file"), rig),
            "eye": (
                tr("&Display"),
                choice(
                    "eye",
                    tr("Display"),
                    {"left": tr("Left"), "right": tr("Right")},
                    tr("The display in front of the camera."),
                ),
            ),
            "square_px": (tr("Grid s&quares"), square),
            "seed": (tr("&Seed of the rendering"), _seed()),
            "poses": (tr("Poses &at each position"), poses),
            "alignments": (tr("Align&ments per position"), alignments),
        }
    )


def _users_form() -> EntriesForm:
    sessions = PathField(tr("Sessions"), "folder")
    sessions.setToolTip(tr("Folder of one session, or a folder that contains sessions."))
    return EntriesForm({"sessions": (tr("&Sessions"), sessions), **_output()})


def _segmentation_form() -> EntriesForm:
    folder = PathField(tr("Frames"), "folder")
    folder.setToolTip(tr("NAME_color.png, NAME_depth.png and NAME_handmask.png, and a meta.json."))
    ways = {
        "detector": tr("Where the detector sees one"),
        "depth": tr("Nearest object, by depth alone"),
    }
    return EntriesForm(
        {
            "folder": (tr("Fra&mes"), folder),
            "roi": (
                tr("&Hand"),
                choice("roi", tr("Hand"), ways, tr("Where the hand is looked for in a frame.")),
            ),
            **_output(),
        }
    )


def _study_fields() -> dict[str, tuple[str, QWidget]]:
    processes: QSpinBox = whole_number(
        "processes",
        0,
        _MOST_PROCESSES,
        tr("Number of processes on this computer; more than its cores is not faster."),
    )
    processes.setSpecialValueText(tr("One per core"))
    processes.setMinimumWidth(processes.sizeHint().width())
    scheduler = with_name(
        QLineEdit(placeholderText=tr("None: this computer"), clearButtonEnabled=True),
        "scheduler",
        tr("Dask scheduler"),
        tr("Address of a Dask cluster that does the work instead, such as tcp://HOST:PORT."),
    )
    return {
        "seed": (tr("&Seed"), _seed()),
        "processes": (tr("&Processes"), processes),
        "scheduler": (tr("&Dask scheduler"), scheduler),
        **_output(),
    }


def _seed() -> QSpinBox:
    seed = whole_number(
        "seed", 0, _MOST_SEED, tr("Random seed; the same seed gives the same numbers.")
    )
    seed.setMinimumWidth(seed.sizeHint().width())
    return seed


def _output() -> dict[str, tuple[str, QWidget]]:
    output = PathField(tr("Results folder"), "folder")
    output.setToolTip(tr("Report, figures and raw numbers; an unfinished study there is resumed."))
    return {"output": (tr("Results fold&er"), output)}
