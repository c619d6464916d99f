"""Makes the pictures of rig-guide.md, by an automatic run of the rig wizard on rendered images."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QDeadlineTimer
from PySide6.QtWidgets import QApplication, QPushButton

from handcal.rig.example import example_rig
from handcal.sim.photographs import BOARD, write_photographs
from handcal_gui.app.theme import use_theme
from handcal_gui.rig.project_folder import (
    DisplayEntries,
    ProjectFolder,
    RigInputs,
    StereoEntries,
    ViewpointEntries,
)
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.job_bar import JobBar

PICTURES = Path(__file__).parent / "pictures"
STEPS = ("", "stereo", "", "left", "", "result")
"""Names of the pictures; empty for steps that the guide does not show."""
LOOK_MS, PATIENCE_MS = 500, 60_000


def main() -> None:
    """Calibrate a rig, and save pictures of some steps."""
    app = QApplication([])
    app.setStyle("fusion")
    use_theme("light")
    with tempfile.TemporaryDirectory() as scratch:
        photographs, work = Path(scratch, "photographs"), ProjectFolder(Path(scratch, "rig"))
        write_photographs(photographs, example_rig(), 20, np.random.default_rng(0), samples=2)
        os.chdir(scratch)  # so that the paths shown are short
        work.save(entries())
        wizard = RigWizard(work)
        wizard.resize(1240, 760)
        wizard.show()
        bars = wizard.findChildren(JobBar)
        for number, step in enumerate(STEPS):
            wizard.show_step(number)
            wait(lambda: not any(bar.is_busy for bar in bars))
            for button in wizard.findChildren(QPushButton, "solve"):
                if button.isVisible():
                    button.click()
            wait(lambda: not any(bar.is_busy for bar in bars))
            if step:
                wizard.grab().save(str(PICTURES / f"rig-{step}.png"))
        wizard.accept()


def entries() -> RigInputs:
    """Return what a technician would enter."""

    def display(eye: str) -> DisplayEntries:
        return DisplayEntries(
            grid_images=f"photographs/grid-{eye}",
            board_images=f"photographs/board-{eye}",
            tracked=f"photographs/tracked-{eye}.json",
        )

    return RigInputs(
        board=BOARD,
        stereo=StereoEntries("photographs/depth", "photographs/headset"),
        viewpoint=ViewpointEntries("photographs/viewpoint"),
        left=display("left"),
        right=display("right"),
    )


def wait(holds: Callable[[], bool]) -> None:
    """Let the wizard work until something holds, and a moment more for what is drawn late."""
    patience, look = QDeadlineTimer(PATIENCE_MS), QDeadlineTimer(LOOK_MS)
    while not patience.hasExpired() and not (holds() and look.hasExpired()):
        QApplication.processEvents()


if __name__ == "__main__":
    main()
