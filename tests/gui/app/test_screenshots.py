"""Pictures of the window: one for each thing that a step offers."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal_gui.app.autopilot import Screenshots
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Step, WizardView


@pytest.fixture
def label(qtbot: QtBot) -> QLabel:
    label = QLabel("handcal")
    qtbot.addWidget(label)
    label.resize(120, 40)
    return label


def view(step: Step, label: str) -> WizardView:
    return WizardView(step, "Do it.", (), ButtonSpec(Action.TAKE_STEP, label))


def test_each_offer_of_a_step_is_pictured_once(label: QLabel, tmp_path: Path) -> None:
    screenshots = Screenshots(label, tmp_path / "pictures")
    for offer in ("Solve", "Send", "Solve"):
        screenshots.save_step(view(Step.SOLVE, offer))
    screenshots.save_step(view(Step.SHOW_HAND, "Next"))
    names = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert names == ["step-2-show-hand.png", "step-5-solve-send.png", "step-5-solve.png"]
    picture = QImage(str(tmp_path / "pictures" / "step-5-solve.png"))
    assert (picture.width(), picture.height()) == (120, 40)


def test_a_picture_that_cannot_be_written_is_said(label: QLabel, tmp_path: Path) -> None:
    screenshots = Screenshots(label, tmp_path / "pictures")
    (tmp_path / "pictures" / "start.png").mkdir()
    with pytest.raises(FileError, match=r"start\.png"):
        screenshots.save("start")
