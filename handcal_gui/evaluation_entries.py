"""What was entered for each evaluation, to be proposed again."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from PySide6.QtCore import QStandardPaths

from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.types import Eye

Size: TypeAlias = Literal["full", "quick"]
_PLAN = CapturePlan()


def _folder(name: str) -> str:
    documents = QStandardPaths.StandardLocation.DocumentsLocation
    return str(Path(QStandardPaths.writableLocation(documents)) / "handcal evaluations" / name)


@dataclass(frozen=True, slots=True)
class NoiseEntries:
    """What the noise study is to do."""

    size: Size = "full"
    seed: int = 1
    processes: int = 0
    """On this computer; 0 for one on each core."""
    scheduler: str = ""
    """Address of a Dask scheduler that does the work instead; empty for none."""
    output: str = field(default_factory=lambda: _folder("noise"))


@dataclass(frozen=True, slots=True)
class MethodEntries:
    """What the method comparison is to do; fields as in `NoiseEntries`."""

    wearers: int = 100
    seed: int = 1
    processes: int = 0
    scheduler: str = ""
    output: str = field(default_factory=lambda: _folder("methods"))


@dataclass(frozen=True, slots=True)
class CubeEntries:
    """What the cube test looks at, and the plan of its captures."""

    captures: str = ""
    """Folder; empty to have the simulator render them."""
    cube: str = ""
    camera: str = ""
    """Files; those in the folder of captures if empty."""
    rig: str = ""
    """The example's if empty."""
    eye: Eye = "left"
    square_px: int = 80
    """Of the grid on the display."""
    seed: int = 1
    """Of what is rendered."""
    output: str = field(default_factory=lambda: _folder("cube"))
    positions: str = ", ".join(_PLAN.positions)
    poses: int = _PLAN.poses
    drawn: str = ", ".join(_PLAN.drawn)
    """Names with commas between them, as of `CapturePlan`."""
    with_grid: bool = _PLAN.with_grid


@dataclass(frozen=True, slots=True)
class UserEntries:
    """What the user test looks at: a folder of sessions, or a session."""

    sessions: str = ""
    output: str = field(default_factory=lambda: _folder("users"))


@dataclass(frozen=True, slots=True)
class EvaluationEntries:
    """Everything entered for evaluations."""

    noise: NoiseEntries = field(default_factory=NoiseEntries)
    methods: MethodEntries = field(default_factory=MethodEntries)
    cube: CubeEntries = field(default_factory=CubeEntries)
    users: UserEntries = field(default_factory=UserEntries)
