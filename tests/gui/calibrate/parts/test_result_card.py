"""The result card: what it says agrees with the results, the session, and itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES, Eye, Float64, Verdict, VerdictName
from handcal.register.benefit import expected_arcmin
from handcal.register.results import Results, results_json
from handcal.register.verdict import Verified
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.session.drawn import drawn_shifts
from handcal.session.record import SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.app.theme import colors
from handcal_gui.calibrate.parts.result_card import ResultCard, _Bars, eye_results, result_text
from tests.gui.helpers import child, show, text
from tests.gui.views import fine_tuned

TARGET = 8.0


def with_verdicts(results: Results, left: VerdictName, right: VerdictName) -> Results:
    verdicts: dict[Eye, Verdict] = {
        "left": Verdict(left, "As told."),
        "right": Verdict(right, "As told."),
    }
    return replace(results, verdicts=verdicts, advice={})


@pytest.fixture
def applied(record: SessionRecord) -> Callable[[Results], SessionRecord]:
    """Return the record of a session in which results were applied."""

    def applied(results: Results) -> SessionRecord:
        return replace(
            record,
            results=results_json(results),
            is_solved=True,
            is_applied=True,
            applied_shift_m=results.rendered_shift_m,
        )

    return applied


def tune(record: SessionRecord, shifts_m: dict[Eye, Float64]) -> SessionRecord:
    """Return a record after φ was set by hand, by the engine's own rules."""
    tuned = fine_tuned(record, shifts_m)
    return replace(tuned, applied_shift_m={**record.applied_shift_m, **shifts_m})


@pytest.mark.parametrize("name", ["accept", "repeat", "keep", "implausible", "contradicted"])
def test_an_eye_has_one_word_one_number_and_the_final_phi(
    qtbot: QtBot,
    results: Results,
    applied: Callable[[Results], SessionRecord],
    name: VerdictName,
) -> None:
    results = with_verdicts(results, name, "accept")
    card = show(qtbot, ResultCard(), 600, 240)
    card.show_results(results, applied(results), TARGET)
    benefit = results.benefits["left"]
    number = {
        "accept": f" {benefit.after_arcmin:.1f}′ expected",
        "repeat": f" {benefit.after_arcmin:.1f}′ expected",
        "keep": f" {benefit.without_arcmin:.1f}′ expected",
    }.get(name, "")
    said = text(card, "card-verdict-left")
    assert said.startswith("Left eye: ")
    assert said.endswith(f" {VERDICT_WORDS[name]}{number}")
    is_used = name in ("accept", "repeat")
    assert text(card, "card-drawn-left") == f"Final φ: {'solved' if is_used else 'offline'}"


def test_the_final_phi_is_the_engines_whatever_was_done_since(
    results: Results, applied: Callable[[Results], SessionRecord]
) -> None:
    """As after Reset to Solved of an eye that keeps offline, or arrows on one that is good."""
    results = with_verdicts(results, "accept", "keep")
    record = applied(results)
    by_hand_m = results.eyes["left"].shift_m + np.array([0.001, 0.0, 0.0])
    used = tune(record, {"left": by_hand_m, "right": results.eyes["right"].shift_m})
    dropped = tune(record, {"left": np.zeros(3), "right": np.zeros(3)})
    for one, kinds in ((used, ("set by hand", "solved")), (dropped, ("offline", "offline"))):
        final = drawn_shifts(one, results)
        assert tuple(final[eye].kind for eye in EYES) == kinds
        for eye, found in eye_results(results, one, TARGET).items():
            assert found.drawn.startswith(f"Final φ: {final[eye].kind}")
            shift = results.eyes[eye]
            arcmin = expected_arcmin(
                record.rig.eyes[eye], final[eye].shift_m - shift.shift_m, shift.covariance_m2
            )
            assert found.error == f"{arcmin:.1f}′ expected"
            is_judged = eye == "right"
            assert (found.word == final[eye].kind.capitalize()) != is_judged
            assert found.shade != "good"
    lines = result_text(results, used, TARGET).splitlines()
    assert [line.split(";")[0] for line in lines if line.startswith("Final φ: solved")]


def test_an_error_is_verified_only_while_its_verification_counts(
    results: Results, applied: Callable[[Results], SessionRecord]
) -> None:
    results = with_verdicts(results, "accept", "accept")
    verified = replace(applied(results), verified_now=frozenset({"left"}))
    assert "verified" not in eye_results(results, verified, TARGET)["left"].error
    results = replace(results, verified={"left": Verified(6.5, 3.0, 6.5, 0.0, 6.5, 1)})
    found = eye_results(results, verified, TARGET)
    assert found["left"].error.endswith("after verification")
    assert found["right"].error.endswith("expected")
    later = replace(verified, verified_now=frozenset())
    assert eye_results(results, later, TARGET)["left"].error.endswith("expected")


def test_no_eye_is_good_whose_trials_are_over_the_target(
    qtbot: QtBot, results: Results, applied: Callable[[Results], SessionRecord]
) -> None:
    results = with_verdicts(results, "accept", "accept")
    record = applied(results)
    calibrated_m = results.rendered_shift_m["left"]
    trial = make_trial(record.rig.eyes["left"], "left", 0.4, calibrated_m, [0.05, 0.0, 0.0])
    card = show(qtbot, ResultCard(), 600, 240)
    card.show_results(results, replace(record, trials={1: trial}), TARGET)
    mean = trial.error_arcmin.mean()
    assert text(card, "card-verdict-left") == f"Left eye: ⚠ Trials over 8′ {mean:.1f}′ in trials"
    assert "Good" in text(card, "card-verdict-right")
    shades = [
        child(card, QLabel, f"card-verdict-{eye}").palette().windowText().color() for eye in EYES
    ]
    assert shades == [QColor(colors().warning), QColor(colors().good)]


def test_reasons_and_bars_are_behind_why_and_on_one_scale(
    qtbot: QtBot, results: Results, applied: Callable[[Results], SessionRecord]
) -> None:
    results = with_verdicts(results, "accept", "keep")
    card = show(qtbot, ResultCard(), 700, 300)
    card.show_results(results, applied(results), TARGET)
    left, right = card.findChildren(_Bars)
    assert not left.isVisible()
    child(card, QPushButton, "why").click()
    assert left.isVisible()
    assert text(card, "card-reason-left") == "As told."
    assert left.width() == right.width()
    assert left.px_per_arcmin() == right.px_per_arcmin()
    names = [bar.name for bar in eye_results(results, applied(results), TARGET)["right"].bars]
    assert "This result, not used" in names


def test_without_results_nothing_is_said(qtbot: QtBot) -> None:
    card = show(qtbot, ResultCard(), 600, 240)
    card.show_results(None, None, TARGET)
    assert text(card, "card-verdict-left") == "Left eye: – Not solved"
    assert text(card, "card-drawn-left") == ""
