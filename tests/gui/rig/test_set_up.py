"""The set-up of a step, by texts and drawings."""

from __future__ import annotations

import re

from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from handcal_gui.app.theme import font_px
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.entries_form import EntriesForm
from tests.gui.helpers import letters
from tests.gui.rig.wizard_steps import LEFT, RIGHT, STEREO, VIEWPOINT, show_tab
from tests.helpers import ROOT


def test_two_drawings_stand_on_one_line_with_text_as_large_as_the_window_s(
    qtbot: QtBot, wizard: RigWizard
) -> None:
    wizard.resize(960, 540)
    wizard.show_step(LEFT)
    QApplication.processEvents()
    left, right = (one for one in wizard.findChildren(Drawing) if one.isVisible())
    assert left.y() == right.y()
    assert left.height() == right.height()
    svg = (ROOT / "docs" / "pictures" / "setup-board.svg").read_text("utf-8")
    found = re.search("width='(.+?)' height='(.+?)'.+?font-size='(.+?)'", svg, re.DOTALL)
    assert found is not None
    width, height, text = map(float, found.groups())
    assert text * min(left.width() / width, left.height() / height) > 0.95 * font_px()


def test_every_input_of_a_step_has_a_letter_of_its_own(qtbot: QtBot, wizard: RigWizard) -> None:
    for step in (STEREO, VIEWPOINT, LEFT, RIGHT):
        wizard.show_step(step)
        show_tab(wizard, "Inputs")
        (form,) = (one for one in wizard.findChildren(EntriesForm) if one.isVisible())
        assert all("&" in label.text() for label in form.findChildren(QLabel))
        found = letters(wizard, is_shown=True)
        assert len(set(found)) == len(found), (step, found)
