"""Settings of each evaluation as they were entered last, to be proposed again."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtCore import QStandardPaths

from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.lab.settings import (
    CubeTestSettings,
    MethodComparisonSettings,
    NoiseStudySettings,
    SegmentationTestSettings,
    UserTestSettings,
)

_PLAN = CapturePlan()


def _folder(name: str) -> str:
    documents = QStandardPaths.StandardLocation.DocumentsLocation
    return str(Path(QStandardPaths.writableLocation(documents)) / "handcal evaluations" / name)


@dataclass(frozen=True, slots=True)
class CubeEntries(CubeTestSettings):
    """Settings of the cube test, and the plan of its captures."""

    positions: str = ", ".join(_PLAN.positions)
    drawn: str = ", ".join(_PLAN.drawn)
    """Names with commas between them, as of `CapturePlan`."""
    with_grid: bool = _PLAN.with_grid
    tracked_by: str = "network"
    """``network``, ``camera`` or ``virtual``: what tracks the cube live."""

    @property
    def plan(self) -> CapturePlan:
        """The plan of the captures; ValueError if a name is wrong."""
        return CapturePlan(_names(self.positions), self.poses, _names(self.drawn), self.with_grid)


@dataclass(frozen=True, slots=True)
class UserEntries:
    """Settings of the user test: a folder of sessions, or a session."""

    sessions: str = ""
    output: str = field(default_factory=lambda: _folder("users"))
    headset: str = "network"
    """``network`` or ``virtual``: the headset of trials with a cube."""
    cube: str = ""
    """Description of that cube; empty for a 60 mm cube."""

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
    users: UserEntries = field(default_factory=UserEntries)
    segmentation: SegmentationTestSettings = field(
        default_factory=lambda: SegmentationTestSettings(output=_folder("segmentation"))
    )


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, map(str.strip, text.split(","))))
