from __future__ import annotations

from dataclasses import replace

import pytest

from handcal_gui.pages.wizard.automatic import Automatic
from handcal_gui.pages.wizard.view import Action, ButtonSpec, Step, WizardView

VIEW = WizardView(
    Step.MAKE_CURSOR,
    "Hold still.",
    (),
    ButtonSpec(Action.MAKE_CURSOR, "Make cursor"),
    runs_after_s=2.0,
)
RESTLESS = replace(VIEW, main=replace(VIEW.main, is_enabled=False))


def test_the_share_grows_while_the_button_is_enabled() -> None:
    automatic = Automatic()
    assert [automatic.share(VIEW, s) for s in (5.0, 6.0, 7.0, 9.0)] == [0.0, 0.5, 1.0, 1.0]


def test_a_hand_that_moves_begins_again() -> None:
    automatic = Automatic()
    automatic.share(VIEW, 0.0)
    automatic.share(VIEW, 1.0)
    assert automatic.share(RESTLESS, 1.9) == 0.0
    assert automatic.share(VIEW, 2.0) == pytest.approx(0.05)
    assert automatic.share(VIEW, 2.9) == 0.5


def test_a_frame_without_a_hand_does_not_begin_again_but_presses_nothing() -> None:
    automatic = Automatic()
    for s in (0.0, 1.0, 1.9):
        automatic.share(VIEW, s)
    share = automatic.share(RESTLESS, 2.1)
    assert share is not None
    assert 0.9 < share < 1.0
    assert automatic.share(VIEW, 2.2) == 1.0


def test_another_step_begins_again() -> None:
    automatic = Automatic()
    automatic.share(VIEW, 0.0)
    assert automatic.share(replace(VIEW, step=Step.SOLVE), 2.0) == 0.0


@pytest.mark.parametrize("is_held", [True, False])
def test_a_step_that_is_held_or_a_persons_waits(*, is_held: bool) -> None:
    automatic = Automatic()
    automatic.is_held = is_held
    view = VIEW if is_held else replace(VIEW, runs_after_s=None)
    assert [automatic.share(view, s) for s in (0.0, 9.0)] == [None, None]
    automatic.is_held = False
    assert automatic.share(VIEW, 10.0) == pytest.approx(0.5, abs=0.01)


def test_a_step_that_fails_is_tried_less_and_less_often() -> None:
    automatic = Automatic()
    pressed, s = [], 0.0
    while s < 31.0:
        if automatic.share(VIEW, s) == 1.0:
            automatic.note_pressed(s)
            pressed.append(s)
        s += 0.5
    assert pressed == [2.0, 6.0, 14.0, 30.0]
