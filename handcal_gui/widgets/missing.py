"""What keeps a panel empty."""

from __future__ import annotations

from handcal.station.snapshot import Snapshot
from handcal_gui.widgets.sentence import sentence


def what_is_missing(snapshot: Snapshot) -> str:
    """Return what there is not to be seen, and in short why not; empty if the hand is there.

    The banner says at length what is wrong with the camera; the wizard and the camera panel, why
    no hand is found.
    """
    if snapshot.camera.problem:
        return "No image"
    seen = snapshot.observation
    if seen is None or not seen.problem:
        return ""
    return "No hand" if seen.cloud is None else sentence(seen.problem)
