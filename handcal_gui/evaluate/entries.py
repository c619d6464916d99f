"""Settings of each evaluation as they were entered last, to be proposed again."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtCore import QStandardPaths

from handcal.core.entry import CUBE_FILES, entry
from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.lab.settings import (
    CubeTestSettings,
    MethodComparisonSettings,
    NoiseStudySettings,
    SegmentationTestSettings,
    UserTestSettings,
    results_folder,
)
from handcal_gui.app.translation import tr

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


@dataclass(frozen=True, slots=True)
class EvaluationEntries:
    """Everything entered for evaluations."""

    noise: NoiseStudySettings = field(
        default_factory=lambda: NoiseStudySettings(output=_folder("noise"))
    )
    methods: MethodComparisonSettings = field(
        default_factory=lambda: MethodComparisonSettings(output=_folder("methods"))
    )
    cube: CubeEntries = field(default_factory=lambda: CubeEntries(output=_folder("cube")))
    users: UserEntries = field(default_factory=lambda: UserEntries(output=_folder("users")))
    segmentation: SegmentationTestSettings = field(
        default_factory=lambda: SegmentationTestSettings(output=_folder("segmentation"))
    )


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, map(str.strip, text.split(","))))
