from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QLineEdit, QProgressBar, QPushButton
from pytestqt.qtbot import QtBot

from handcal.calibration.plan import PlanSettings, StepName
from handcal.calibration.states import State
from handcal.core.types import EYES, EyePlan
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import use_theme
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import Action, Step
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.result_rows import EYE_NAMES
from tests.gui.helpers import text
from tests.gui.views import NUDGED, VERIFIED, all_views, begun, judged, planned_snapshot

Maker = Callable[..., Snapshot]


@pytest.fixture
def panel(qtbot: QtBot) -> WizardPanel:
    panel = WizardPanel()
    qtbot.addWidget(panel)
    panel.resize(460, 420)
    panel.show()
    qtbot.addWidget(panel.bar)
    panel.bar.resize(900, panel.bar.height())
    panel.bar.show()
    panel.wizard = begun(is_held=True)
    return panel


@pytest.fixture
def asked(panel: WizardPanel) -> list[Action]:
    """Return the actions that its buttons ask for."""
    actions: list[Action] = []
    panel.bar.do = actions.append
    return actions


def child(panel: WizardPanel, name: str) -> QPushButton:
    found = panel.bar.findChild(QPushButton, name)
    assert isinstance(found, QPushButton)
    return found


def test_the_main_button_asks_for_what_it_says(
    panel: WizardPanel, asked: list[Action], snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.ALIGNED))
    button = child(panel, "wizardMain")
    assert button.text() == "Solve"
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert asked.pop() is Action.TAKE_STEP
    panel.press_main()
    assert asked.pop() is Action.TAKE_STEP


def test_another_step_is_reported_once(qtbot: QtBot, panel: WizardPanel, snapshot: Maker) -> None:
    with qtbot.waitSignal(panel.step_changed) as told:
        panel.show_snapshot(snapshot(State.ALIGN))
    assert told.args == [Step.ALIGN]
    with qtbot.assertNotEmitted(panel.step_changed):
        panel.show_snapshot(snapshot(State.ALIGN))
    with qtbot.waitSignal(panel.step_changed) as told:
        panel.show_snapshot(snapshot(State.ALIGNED))
    assert told.args == [Step.SOLVE]


def test_a_disabled_main_button_asks_for_nothing(
    panel: WizardPanel, asked: list[Action], snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.APPLYING))
    panel.press_main()
    assert not asked


def test_the_main_button_has_its_colour_only_where_a_press_is_needed_and_the_bar_says_why(
    panel: WizardPanel, snapshot: Maker
) -> None:
    def is_colored() -> bool:
        shade = child(panel, "wizardMain").palette().button().color()
        is_quiet = shade == QApplication.palette().button().color()
        assert bool(text(panel.bar, "wizardMainQuiet")) == is_quiet
        return not is_quiet

    try:
        for theme in ("light", "dark"):
            use_theme(theme)
            panel.show_snapshot(snapshot(State.ALIGNED))
            assert is_colored()
            for asked in (
                snapshot(State.ALIGN),
                snapshot(State.VERIFY, procedure={"verifying": NUDGED}),
            ):
                panel.show_snapshot(asked)
                assert not is_colored()
                assert "wearer confirms" in text(panel.bar, "wizardMainQuiet")
    finally:
        use_theme("system")


def test_the_other_buttons_come_and_go(
    qtbot: QtBot, panel: WizardPanel, asked: list[Action], snapshot: Maker, record: SessionRecord
) -> None:
    none = replace(record, alignments={})
    panel.show_snapshot(snapshot(State.ALIGNED))
    other = child(panel, "wizardOther0")
    assert (other.isVisible(), other.text()) == (True, "&Discard and repeat")
    qtbot.waitUntil(other.isEnabled)
    QTest.mouseClick(other, Qt.MouseButton.LeftButton)
    assert asked.pop() is Action.REDO
    panel.show_snapshot(planned_snapshot(snapshot, StepName.NUDGE))
    assert other.text() == "&Undo"
    panel.show_snapshot(snapshot(State.ALIGNED, record=none))
    assert not other.isVisible()


def test_every_other_button_has_a_letter_and_none_that_discards_has_the_focus(
    panel: WizardPanel, snapshot: Maker, record: SessionRecord
) -> None:
    menus_and_choice = set("FTVHY")
    for view in all_views(snapshot, record):
        panel.bar.show_view(view)
        letters = []
        for i, offer in enumerate(view.others):
            other = child(panel, f"wizardOther{i}")
            discards = offer.action is Action.REDO
            assert bool(offer.discards) == discards
            policy = Qt.FocusPolicy.NoFocus if discards else Qt.FocusPolicy.TabFocus
            assert other.focusPolicy() == policy
            letters.append(other.shortcut().toString())
            assert letters[-1] in other.toolTip()
        assert all(letters)
        assert len(set(letters)) == len(letters)
        assert not {letter[-1] for letter in letters} & menus_and_choice


def test_a_click_meant_for_the_button_before_does_not_discard(
    qtbot: QtBot, panel: WizardPanel, asked: list[Action], snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.ALIGN))
    other = child(panel, "wizardOther0")
    qtbot.waitUntil(other.isEnabled)
    panel.show_snapshot(snapshot(State.ALIGNED))  # the wearer has confirmed
    QTest.mouseClick(other, Qt.MouseButton.LeftButton)
    assert not asked
    qtbot.waitUntil(other.isEnabled)
    QTest.mouseClick(other, Qt.MouseButton.LeftButton)
    assert asked.pop() is Action.REDO


def test_the_focus_does_not_stay_on_a_button_that_becomes_another(
    qtbot: QtBot, panel: WizardPanel, snapshot: Maker
) -> None:
    accepted = judged(snapshot, "accept", "accept", State.APPLIED)
    panel.show_snapshot(accepted)
    other = child(panel, "wizardOther0")
    panel.bar.activateWindow()
    qtbot.waitActive(panel.bar)
    other.setFocus()
    assert other.hasFocus()
    panel.show_snapshot(planned_snapshot(snapshot, StepName.RAISE))
    assert other.text() == "&Back"
    assert panel.bar.focusWidget() is None


def test_the_key_shown_is_the_one_that_works(
    qtbot: QtBot, panel: WizardPanel, asked: list[Action], snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.ALIGNED))
    key = panel.bar.findChild(QLabel, "wizardMainKey")
    assert isinstance(key, QLabel)
    field = QLineEdit(panel.bar)
    field.show()
    panel.bar.activateWindow()
    qtbot.waitActive(panel.bar)
    assert key.text() == "Space"
    width = key.width()
    field.setFocus()
    assert key.text() == "Ctrl+Return"
    assert key.width() == width >= key.sizeHint().width() - 2
    QTest.keyClick(field, Qt.Key.Key_Space)
    assert field.text() == " "
    QTest.keyClick(field, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert asked.pop() is Action.TAKE_STEP
    field.setReadOnly(True)
    field.clearFocus()
    assert key.text() == "Space"


def test_the_plan_is_chosen_before_the_cursor_is_made(
    qtbot: QtBot, panel: WizardPanel, snapshot: Maker
) -> None:
    plan = panel.findChild(QComboBox, "wizardPlan")
    assert isinstance(plan, QComboBox)
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert (plan.currentText(), plan.isEnabled()) == ("Both eyes at once", True)
    chosen: list[EyePlan] = []
    panel.choose_eyes = chosen.append
    plan.setCurrentText("Right eye only")
    assert chosen == ["right"]
    panel.show_snapshot(snapshot(State.SHOW_HAND, number=2))
    assert plan.currentText() == "Right eye only", "until the station has heard of it"
    right = PlanSettings("paper", ("right",))
    panel.show_snapshot(snapshot(State.SHOW_HAND, plan=right))
    panel.show_snapshot(snapshot(State.SHOW_HAND, plan=PlanSettings("paper", in_turn=True)))
    assert chosen == ["right"]
    assert plan.currentText() == "One eye after the other"
    panel.show_snapshot(snapshot(State.ALIGN, plan=right))
    assert not plan.isEnabled()
    panel.show_snapshot(planned_snapshot(snapshot, StepName.RAISE))
    assert not plan.isVisible(), "the recommended plan chooses"


def test_the_refusal_is_read(panel: WizardPanel, snapshot: Maker) -> None:
    panel.show_snapshot(
        snapshot(procedure={"refusal": "the headset's poses have a gap of 466 ms."})
    )
    note = panel.findChild(QLabel, "wizardNote")
    assert isinstance(note, QLabel)
    assert note.text() == "The headset's poses have a gap of 466 ms."


def test_after_a_slip_no_step_is_ticked_that_was_left_out_and_eyes_are_counted(
    panel: WizardPanel, snapshot: Maker, record: SessionRecord
) -> None:
    progress = panel.findChildren(QProgressBar)[0]
    first = planned_snapshot(snapshot, StepName.SOLVE)
    panel.show_snapshot(first)
    assert "✓ Align" in _texts(panel)
    assert progress.text() == "2/2 aligned"
    panel.show_snapshot(planned_snapshot(snapshot, StepName.ALIGN))
    assert progress.text().startswith("2/3 aligned"), "one more is being made"
    panel.show_snapshot(first)
    panel.show_snapshot(planned_snapshot(snapshot, StepName.VERIFY))
    assert progress.text() == "0/2 eyes verified"
    again = replace(
        record,
        facts=replace(record.facts, former="ada-1"),
        alignments={},
        verified_now=frozenset({"left"}),
    )
    slipped = planned_snapshot(snapshot, StepName.VERIFY, record=again, verified={"left": VERIFIED})
    panel.show_snapshot(slipped)
    texts = _texts(panel)
    assert "✓ Show hand" in texts
    assert {"Make cursor", "Align", "Solve"} <= texts
    assert progress.text().startswith("1/2 eyes verified")
    once_more = replace(slipped.procedure, state=State.VERIFY, verifying=NUDGED)
    panel.show_snapshot(replace(slipped, procedure=once_more))
    assert progress.text().startswith("1/2 eyes verified"), "as the table says"


def test_names_and_paths_like_markup_are_shown_as_they_are(
    panel: WizardPanel, snapshot: Maker
) -> None:
    panel.start(Wizard())
    panel.show_snapshot(snapshot(State.SHOW_HAND, camera={"name": "<b>D415</b>"}))
    [label] = [one for one in panel.findChildren(QLabel) if "D415" in one.text()]
    assert label.textFormat() is Qt.TextFormat.PlainText


def _texts(panel: WizardPanel) -> set[str]:
    return {label.text() for label in panel.findChildren(QLabel)}


def test_the_picture_is_of_the_eye_that_the_sentence_names(
    panel: WizardPanel, snapshot: Maker
) -> None:
    for eye in EYES:
        panel.show_snapshot(snapshot(State.ALIGN, procedure={"eyes": (eye,)}))
        open_eyes = [
            one.accessibleName()
            for one in panel.picture.findChildren(EyeCanvas)
            if one.isVisibleTo(panel)
        ]
        assert open_eyes == [f"Guide {EYE_NAMES[eye]}"]


def test_before_the_first_image_nothing_of_the_session_before_is_shown(
    panel: WizardPanel, snapshot: Maker
) -> None:
    camera = panel.picture.findChild(ImageView)
    assert isinstance(camera, ImageView)
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert camera.has_image
    panel.picture.begin()
    broken = snapshot(State.SHOW_HAND, frame=None, camera={"problem": "unplugged"})
    panel.picture.show_snapshot(broken)
    assert not camera.has_image


def test_while_drawings_are_compared_the_guide_asks_for_the_answer(
    panel: WizardPanel, snapshot: Maker
) -> None:
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    assert child(panel, "wizardMain").isEnabled()
    panel.show_snapshot(replace(applied, comparing="first"))
    assert not child(panel, "wizardMain").isEnabled()
    assert any(text.startswith("The wearer compares two drawings.") for text in _texts(panel))


def test_the_box_shows_the_eyes_of_the_plan_after_a_refused_choice(
    panel: WizardPanel, snapshot: Maker
) -> None:
    shown = snapshot(plan=PlanSettings("paper"))
    panel.show_snapshot(shown)
    box = panel.findChild(QComboBox, "wizardPlan")
    assert isinstance(box, QComboBox)
    before = box.currentText()
    box.setCurrentIndex(box.count() - 1)
    assert box.currentText() != before
    panel.show_eyes_again()
    panel.show_snapshot(shown)
    assert box.currentText() == before


def test_all_alignments_are_counted_of_the_paper_s_plan(
    panel: WizardPanel, snapshot: Maker
) -> None:
    progress = panel.findChildren(QProgressBar)[0]
    for plan, planned in (
        (PlanSettings("paper", alignments=3), 3),
        (PlanSettings("paper", alignments=3, in_turn=True), 6),
    ):
        panel.show_snapshot(planned_snapshot(snapshot, StepName.RAISE, plan=plan))
        assert f"/{planned} aligned" in progress.text()
