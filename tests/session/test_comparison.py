"""Blinded comparisons: what the journal stores, and what is counted."""

from __future__ import annotations

from math import comb
from pathlib import Path

import numpy as np
import pytest

from handcal.core.types import Eye, Float64
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.session.trial import (
    COMPARED,
    Answer,
    Comparison,
    Drawing,
    comparison_json,
    count_comparisons,
    read_comparisons,
    sign_test,
)

SHIFT_M: dict[Eye, Float64] = {"left": np.array([1e-3, 2e-3, 3e-3])}


def made(first: Drawing, answer: Answer) -> Comparison:
    return Comparison(first, answer, SHIFT_M)


@pytest.mark.parametrize(
    ("first", "answer", "better"),
    [
        ("offline", "first", "offline"),
        ("offline", "second", "applied"),
        ("applied", "first", "applied"),
        ("applied", "second", "offline"),
        ("applied", "neither", None),
    ],
)
def test_the_better_one_follows_from_order_and_answer(
    first: Drawing, answer: Answer, better: Drawing | None
) -> None:
    assert made(first, answer).better == better


def test_a_session_keeps_comparisons_and_leaves_out_what_is_damaged(tmp_path: Path) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        session.record(COMPARED, **comparison_json(made("offline", "second")))
        session.record(COMPARED, first="offline", answer=["first"], applied_shift_m={})
        session.record(COMPARED, first="offline", answer="first", applied_shift_m={"nose": [0]})
        session.record(COMPARED, first="offline", answer="first")
        session.record(COMPARED, **comparison_json(made("applied", "neither")))
    kept = read_comparisons(Session.open(session.path).events)
    assert [(one.first, one.answer) for one in kept] == [
        ("offline", "second"),
        ("applied", "neither"),
    ]
    np.testing.assert_array_equal(kept[0].applied_shift_m["left"], SHIFT_M["left"])
    assert kept[0].time
    counts = count_comparisons(kept)
    assert (counts.applied, counts.offline, counts.neither, counts.p_value) == (1, 0, 1, 1.0)


def test_the_sign_test_is_that_of_the_binomial_distribution() -> None:
    assert sign_test(0, 0) == sign_test(5, 5) == 1.0
    assert sign_test(10, 0) == sign_test(0, 10) == 2 / 2**10
    assert sign_test(2000, 0) == 0.0
    assert sign_test(8, 2) == 2 * (1 + 10 + comb(10, 2)) / 2**10
