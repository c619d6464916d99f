from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.solve_again import (
    check_solvable,
    solve_again,
    solve_sound,
    stored_solve_settings,
)
from handcal.core.errors import FileError
from handcal.core.types import EYES, Alignment, Float64
from handcal.register.results import SolveSettings
from handcal.rig.example import example_rig
from handcal.session.repair import repair_session
from handcal.session.session import Session, SessionRecord


@pytest.fixture
def record(tmp_path: Path) -> SessionRecord:
    settings = {"calibration": {"solve": {"method": "linear"}}}
    with Session.create(tmp_path, example_rig(), settings) as session:
        return Session.open(session.path)


def test_settings_are_the_session_s_own(record: SessionRecord) -> None:
    assert stored_solve_settings(record).method == "linear"
    assert stored_solve_settings(replace(record, settings={})) == SolveSettings()


def test_settings_that_cannot_be_read_are_named_with_their_file(record: SessionRecord) -> None:
    wrong = replace(record, settings={"calibration": {"solve": {"method": "guess"}}})
    with pytest.raises(FileError, match=r"settings.json: calibration.solve.method must be one of"):
        stored_solve_settings(wrong)


def test_nothing_comes_of_no_alignment(record: SessionRecord) -> None:
    assert solve_again(record, SolveSettings()) is None


def test_what_cannot_be_solved_is_named(record: SessionRecord, alignment: Alignment) -> None:
    none = replace(alignment, hand_m=np.empty((0, 3)), hand_is_cut=np.empty(0, bool))
    hopeless = replace(record, alignments={1: none})
    with pytest.raises(FileError, match=f"{record.path.name} cannot be solved"):
        solve_again(hopeless, SolveSettings())


def turned(alignment: Alignment, T: Float64) -> Alignment:
    return replace(alignment, T_E_W={eye: T_E_W @ T for eye, T_E_W in alignment.T_E_W.items()})


def with_point(alignment: Alignment, value: float) -> Alignment:
    hand_m = alignment.hand_m.copy()
    hand_m[5, 1] = value
    return replace(alignment, hand_m=hand_m)


def drawn(alignment: Alignment, shift_m: float) -> Alignment:
    return replace(alignment, drawn_shift_m=dict.fromkeys(EYES, np.full(3, shift_m)))


BAD: dict[str, tuple[Callable[[Alignment], Alignment], str]] = {
    "mirrored": (lambda one: turned(one, np.diag([1.0, 1, -1, 1])), "rigid"),
    "scaled": (lambda one: turned(one, np.diag([2.0, 2, 2, 1])), "rigid"),
    "no rotation": (lambda one: turned(one, np.diag([0.0, 0, 0, 1])), "rigid"),
    "NaN pose": (lambda one: turned(one, np.full((4, 4), np.nan)), "rigid"),
    "NaN point": (lambda one: with_point(one, np.nan), "hand_m contains NaN"),
    "far point": (lambda one: with_point(one, 1e300), "points as far away"),
    "NaN shift": (lambda one: drawn(one, np.nan), "drawn_shift_m"),
    "large shift": (lambda one: drawn(one, 5.0), "drawn_shift_m"),
    "millimetres": (lambda one: replace(one, hand_m=1e3 * one.hand_m), "looks like millimetres"),
    "NaN rotation": (lambda one: replace(one, rotation_rad=np.full(3, np.nan)), "rotation_rad"),
    "no pose": (lambda one: replace(one, T_E_W={}), "without pose"),
    "one point": (
        lambda one: replace(one, hand_m=one.hand_m[:1], hand_is_cut=one.hand_is_cut[:1]),
        "hand_m has 1 points",
    ),
}
UNSOLVABLE = "all cut"
BAD[UNSOLVABLE] = (
    lambda one: replace(one, hand_is_cut=np.ones_like(one.hand_is_cut)),
    "all of the hand lies beside cut edges",
)


def with_bad(folder: Path, simulated: Callable[..., Alignment], name: str) -> Path:
    with Session.create(folder, example_rig(), {}, name="bad") as session:
        for number in (1, 2, 3):
            good = simulated(number)
            session.save_alignment(BAD[name][0](good) if number == 2 else good)
    return session.path


@pytest.mark.parametrize("name", [name for name in BAD if name != UNSOLVABLE])
def test_a_bad_alignment_is_refused_where_it_is_read(
    tmp_path: Path, simulated: Callable[..., Alignment], name: str
) -> None:
    record = Session.open(with_bad(tmp_path, simulated, name))
    assert list(record.alignments) == [1, 3]
    [damage] = record.damaged
    assert damage.file == "alignments/2.npz"
    assert BAD[name][1] in damage.what


@pytest.mark.parametrize("name", ["NaN pose", UNSOLVABLE])
def test_a_bad_alignment_costs_only_itself(
    tmp_path: Path, simulated: Callable[..., Alignment], name: str
) -> None:
    path = with_bad(tmp_path, simulated, name)
    solved, results = solve_sound(Session.open(path), SolveSettings())
    assert results is not None
    assert list(solved.alignments) == list(results.alignments) == [1, 3]
    found = check_solvable(path)
    assert found.state == "damaged"
    assert found.damaged == solved.damaged
    assert BAD[name][1] in found.damaged[0].what
    repaired = repair_session(path, tmp_path / "repaired")
    assert check_solvable(repaired.path).state == "sound"
    assert list(repaired.alignments) == [1, 3]


def test_settings_with_which_nothing_can_be_solved_are_not_sound(
    tmp_path: Path, simulated: Callable[..., Alignment]
) -> None:
    settings = {"calibration": {"solve": {"method": "guess"}}}
    with Session.create(tmp_path, example_rig(), settings) as session:
        session.save_alignment(simulated(1))
    [damage] = check_solvable(session.path).damaged
    assert "calibration.solve.method must be one of" in damage.what
