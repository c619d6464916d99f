from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES, Eye, Verdict, VerdictName, phi_text
from handcal.register.results import Results
from handcal.register.verdict import Advice
from handcal.session.judged_trials import EyeTrials
from handcal_gui.app.theme import colors
from handcal_gui.calibrate.parts.result_card import ResultCard, eye_results, result_text
from tests.gui.helpers import show, text


def test_expected_and_measured_are_told_apart(results: Results) -> None:
    left, right = eye_results(results)
    assert (left.eye, right.eye) == ("left", "right")
    benefit = results.benefits["left"]
    assert [(bar.name, bar.arcmin) for bar in left.bars] == [
        ("Before, expected", benefit.without_arcmin),
        ("After, expected", benefit.after_arcmin),
        ("Verification", None),
    ]
    assert left.bars[-1].text == "not verified"
    assert f"{results.expected_after_another_arcmin['left']:.1f}′" in left.details[1]


def test_the_text_has_every_number_with_its_unit(results: Results) -> None:
    lines = result_text(results, 8.0, {"Wearer": "Ada"}).splitlines()
    assert lines[:2] == ["Wearer: Ada", "Target: 8.0′"]
    for eye in ("left", "right"):
        assert f"After, expected: {results.benefits[eye].after_arcmin:.1f}′" in lines
        assert f"Depth error: {results.benefits[eye].depth}" in lines
        assert f"Solved: {phi_text(results.eyes[eye])}" in lines
    assert lines.count("Verification: not verified") == 2


def test_the_card_shows_the_verdicts(qtbot: QtBot, results: Results) -> None:
    card = show(qtbot, ResultCard(), 600, 240)
    card.show_results(results, 8.0)
    assert text(card, "card-verdict-left").startswith("Left eye: ↻ Repeat")
    [reason] = card.findChildren(QLabel, "card-reason-left")
    assert results.verdicts["left"].reason[1:] in reason.text()
    one = replace(
        results,
        eyes={"left": results.eyes["left"]},
        verdicts={"left": results.verdicts["left"]},
    )
    card.show_results(one, 8.0)
    assert text(card, "card-verdict-right") == "Right eye: – Not solved"
    card.show_results(None, 8.0)
    assert text(card, "card-verdict-left") == "Left eye: – Not solved"


def test_no_eye_is_ticked_whose_trials_are_over_the_target(qtbot: QtBot, results: Results) -> None:
    card = show(qtbot, ResultCard(), 600, 240)
    accepted = replace(results, verdicts=dict.fromkeys(EYES, Verdict("accept", "as told")))
    over: dict[Eye, EyeTrials] = {"left": EyeTrials(2, 20.7, 8.0)}
    card.show_results(accepted, 8.0, over)
    assert text(card, "card-verdict-left") == "Left eye: ⚠ Trials over 8′"
    assert text(card, "card-verdict-right") == "Right eye: ✓ Accept"
    shades = [
        card.findChildren(QLabel, f"card-verdict-{eye}")[0].palette().windowText().color()
        for eye in EYES
    ]
    assert shades == [QColor(colors().warning), QColor(colors().good)]
    reason = "Trials found 20.7′: if φ was set carefully in them, measure again"
    assert text(card, "card-reason-left") == reason
    assert text(card, "card-reason-right") == "As told"
    left, _ = eye_results(accepted, over)
    assert [bar.arcmin is None for bar in left.bars] == [False, False, False, True]
    lines = result_text(accepted, 8.0, trials=over).splitlines()
    assert "Trials, n = 2: 20.7′" in lines
    assert "Trials: none of this φ" in lines


def test_a_bar_within_the_target_is_painted_otherwise(qtbot: QtBot, results: Results) -> None:
    card = show(qtbot, ResultCard(), 600, 240)
    pictures = []
    for target_arcmin in (1.0, 50.0):
        card.show_results(results, target_arcmin)
        pictures.append(card.grab().toImage())
    assert pictures[0] != pictures[1]


def test_all_texts_grow_with_the_card(qtbot: QtBot, results: Results) -> None:
    card = show(qtbot, ResultCard(), 600, 240)
    card.show_results(results, 8.0)
    font = card.font()
    font.setPointSizeF(2.0 * font.pointSizeF())
    card.setFont(font)
    sizes = {label.font().pointSizeF() for label in card.findChildren(QLabel)}
    assert sizes == {font.pointSizeF()}


@pytest.mark.parametrize("name", ["keep", "implausible", "contradicted"])
def test_a_result_that_is_not_used_is_named_so_and_not_praised(
    qtbot: QtBot, results: Results, name: VerdictName
) -> None:
    refused = dict(results.verdicts) | {"right": Verdict(name, "as told")}
    results = replace(results, verdicts=refused)
    left, right = eye_results(results)
    assert "This result, not used" not in [bar.name for bar in left.bars]
    assert left.details
    assert right.bars[1].name == "This result, not used"
    assert not right.details
    card = show(qtbot, ResultCard(), 600, 240)
    good = QColor(colors().good)
    card.show_results(results, 50.0)
    picture = card.grab().toImage()
    shades = {picture.pixelColor(x, y) == good for x in range(320, 600) for y in range(240)}
    assert shades == {False}, "the right eye's half"


@pytest.mark.parametrize(("more", "word"), [(0, "↻ Verify"), (1, "↻ Repeat")])
def test_a_result_that_lacks_only_its_verification_asks_for_it(
    results: Results, more: int, word: str
) -> None:
    advice = Advice((), more, 3.0, 0.99, meets_target=True, is_accepted=True, verify=True)
    results = replace(
        results,
        verdicts=dict.fromkeys(EYES, Verdict("repeat", "as told")),
        advice=dict.fromkeys(EYES, advice),
    )
    assert [one.word for one in eye_results(results)] == [word, word]
    assert f"Left eye: {word}" in result_text(results, 8.0)
