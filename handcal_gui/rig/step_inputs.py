"""The inputs of a step as text, to compare them with those with which it was solved."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Literal, TypeAlias

from handcal.core.entry import entries_of
from handcal.io.images import IMAGE_SUFFIXES
from handcal_gui.app.translation import tr
from handcal_gui.rig.project_folder import (
    DisplayEntries,
    RigInputs,
    StereoEntries,
    ViewpointEntries,
    entered_path,
)
from handcal_gui.widgets.sentence import lowered

Step: TypeAlias = Literal["T_H_D", "viewpoint", "left", "right"]
"""A step that is solved: a part of the rig, or the viewpoint camera's intrinsics."""
STEP_TITLES: dict[Step, str] = {
    "T_H_D": tr("Depth and headset camera"),
    "viewpoint": tr("Viewpoint camera"),
    "left": tr("Left display"),
    "right": tr("Right display"),
}
_NAMES = {
    "board": tr("board"),
    "camera": tr("viewpoint camera's intrinsics"),
    **{
        name: lowered(told.title)
        for kind in (StereoEntries, ViewpointEntries, DisplayEntries)
        for name, (told, _) in entries_of(kind).items()
    },
    **dict.fromkeys(("dropped", "dropped_grid", "dropped_board"), tr("excluded images")),
}


def step_inputs(inputs: RigInputs, step: Step, camera: Path) -> dict[str, str]:
    """Return the inputs of a step as text, by field; of paths, also what is there.

    Parameters
    ----------
    inputs : RigInputs
    step : {"T_H_D", "viewpoint", "left", "right"}
    camera : Path
        File of the viewpoint camera's intrinsics, from which the displays are solved.
    """
    entries = inputs.stereo if step == "T_H_D" else getattr(inputs, step)
    values = {"board": asdict(inputs.board), **asdict(entries)}
    texts = {name: json.dumps(value) + _content(value) for name, value in values.items()}
    if step in ("left", "right"):
        texts["camera"] = ""
        with suppress(OSError):  # it is the same if it is solved again from the same images
            texts["camera"] = sha256(camera.read_bytes()).hexdigest()
    return texts


def _content(value: object) -> str:
    """Return a mark of a file, or of the images in a folder; empty if `value` is neither."""
    path = entered_path(value) if isinstance(value, str) else None
    try:
        if path is None or not path.exists():
            return ""
        if not path.is_dir():
            return f" {path.stat().st_size} {path.stat().st_mtime_ns}"
        images = [one for one in path.iterdir() if one.suffix.lower() in IMAGE_SUFFIXES]
        listed = sorted(f"{one.name} {one.stat().st_size}" for one in images)
        return f" {sha256(repr(listed).encode()).hexdigest()}"
    except OSError:
        return ""


def changed_inputs(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return which inputs differ, in words; empty if none does."""
    changed = [_NAMES[name] for name in now if then.get(name, now[name]) != now[name]]
    return ", ".join(dict.fromkeys(changed))
