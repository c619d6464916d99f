"""The reason why a panel shows no image, hand or view."""

from __future__ import annotations

from handcal.station.snapshot import Snapshot
from handcal_gui.translation import tr
from handcal_gui.widgets.sentence import sentence


def missing_text(snapshot: Snapshot) -> str:
    """Return in short what is missing and why; empty if the hand is there.

    The banner describes problems of the camera in full; the wizard and the camera panel describe
    why no hand is found.
    """
    if snapshot.camera.problem:
        return tr("No image")
    seen = snapshot.observation
    if seen is None or not seen.problem:
        return ""
    return tr("No hand") if seen.cloud is None else sentence(seen.problem)


def missing_view_text(snapshot: Snapshot) -> str:
    """Return in short why the eyes' views are missing; empty if they are there or to come."""
    if snapshot.comparing is not None:
        return tr("Hidden while the wearer compares")
    return missing_text(snapshot)
