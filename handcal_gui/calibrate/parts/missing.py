"""The reason why a panel shows no image, hand or view."""

from __future__ import annotations

from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr
from handcal_gui.widgets.sentence import lowered, sentence


def missing_text(snapshot: Snapshot) -> str:
    """Return why no image or no hand is shown; empty if the hand is there.

    The banner describes problems of the camera in full.
    """
    if snapshot.camera.problem:
        return tr("No image")
    return sentence(snapshot.observation.problem) if snapshot.observation else ""


def missing_view_text(snapshot: Snapshot) -> str:
    """Return in short why the eyes' views are missing; empty if they are there or to come."""
    if snapshot.comparing is not None:
        return tr("Hidden while the wearer compares")
    text, seen = missing_text(snapshot), snapshot.observation
    if text and not snapshot.camera.problem and seen is not None and seen.cloud is None:
        # The hand may be whole in what the wearer sees.
        return tr("In the camera's image: {}").format(lowered(text))
    return text
