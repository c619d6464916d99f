import logging
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.types import Alignment, Verification
from handcal.rig.example import example_rig
from handcal.session.journal import JOURNAL, happens_now, journal_line
from handcal.session.session import (
    MAX_NOTES_CHARACTERS,
    Session,
    SessionRecord,
)
from handcal.session.state import MAX_TRIALS, VERIFYING, WENT_BACK, SessionEvent
from handcal.session.trial import Trial, trial_json
from tests.session.conftest import RESULTS, SETTINGS, SHIFT_M


def test_everything_comes_back(finished: SessionRecord, alignment: Alignment) -> None:
    names = [event.name for event in finished.events]
    assert names == [
        "created", "cursor_made", "alignment_saved", "refused", "alignment_saved",
        "alignment_deleted", "alignment_restored", "solved", "applied", "trial_saved",
        "fine_tuned", "finished",
    ]  # fmt: skip
    assert [event.number for event in finished.events] == list(range(1, 13))
    assert finished.events[1].data == {"points": 5000}
    assert finished.settings == SETTINGS
    assert finished.results == RESULTS
    assert finished.rig.name == example_rig().name
    assert len(finished.alignments) == 2
    for stored in finished.alignments.values():
        assert stored.cursor_m.tobytes() == alignment.cursor_m.tobytes()
        assert stored.T_E_W["right"].tobytes() == alignment.T_E_W["right"].tobytes()
    assert finished.torn_bytes == 0


def test_a_session_goes_on_where_it_ended(session: Session, alignment: Alignment) -> None:
    assert session.save_alignment(alignment) == 1
    session.close()
    with Session(session.path) as resumed:
        assert resumed.save_alignment(alignment) == 2
        resumed.record("done")
    assert [event.number for event in Session.open(session.path).events] == [1, 2, 3, 4]


def test_a_folder_is_never_taken_over(tmp_path: Path, session: Session) -> None:
    with pytest.raises(FileError, match=r"cannot create .*one: File exists"):
        Session.create(tmp_path, example_rig(), SETTINGS, name="one")
    with pytest.raises(FileError, match="in use by process"):
        Session(session.path)


def test_what_is_no_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        FileError, match=r"is not a session; choose the folder that contains journal"
    ):
        Session.open(tmp_path)
    with pytest.raises(FileError, match="cannot lock"):
        Session(tmp_path / "missing")


def test_names_of_its_own_events_and_nan_are_refused(session: Session) -> None:
    with pytest.raises(ValueError, match="written by the session itself"):
        session.record("alignment_saved", number=1)
    with pytest.raises(ValueError, match="JSON compliant"):
        session.record("bad", value=float("nan"))
    assert len(Session.open(session.path).events) == 1


def test_a_closed_session_writes_no_more(session: Session) -> None:
    session.close()
    session.close()
    with pytest.raises(FileError, match="is closed; open the session again"):
        session.record("event")


def numbers(record: SessionRecord) -> tuple[list[int], list[int]]:
    """Return those kept and those deleted, after checking that they are what was saved so."""
    for number, alignment in {**record.alignments, **record.deleted_alignments}.items():
        assert alignment.t_b_ns == number
    return list(record.alignments), list(record.deleted_alignments)


def test_any_alignment_can_be_deleted_and_restored_at_its_place(
    session: Session, alignment: Alignment
) -> None:
    for number in (1, 2, 3):
        assert session.save_alignment(replace(alignment, t_b_ns=number)) == number
    for change, number in ((session.delete, 1), (session.delete, 2), (session.restore, 1)):
        session.save_results(RESULTS)
        assert Session.open(session.path).is_solved
        change("alignment", number)
        record = Session.open(session.path)
        assert record.results is None
        assert not record.is_solved
    assert numbers(record) == ([1, 3], [2])
    session.close()
    with Session(session.path) as again:
        again.delete("alignment", 3)
        assert again.save_alignment(replace(alignment, t_b_ns=4)) == 4
        assert numbers(Session.open(session.path)) == ([1, 4], [2, 3])
        again.restore("alignment", 3)
        again.restore("alignment", 2)
        for call, number in ((again.restore, 2), (again.delete, 5), (again.restore, 5)):
            with pytest.raises(ValueError, match=rf"there is no (deleted )?alignment {number}"):
                call("alignment", number)
    assert numbers(Session.open(session.path)) == ([1, 2, 3, 4], [])


def test_what_a_writer_holds_is_what_a_reader_finds(
    session: Session, alignment: Alignment, trial: Trial
) -> None:
    """The state in memory follows the events as the files do."""
    found = Verification((0.0, 0.0, 0.0), (1.0, -2.0), (0.001, 0.0, 0.0))
    for write in (
        lambda: session.record("cursor_made", points=5000),
        lambda: session.save_alignment(replace(alignment, t_b_ns=1)),
        lambda: session.save_alignment(replace(alignment, t_b_ns=2)),
        lambda: session.delete("alignment", 1),
        lambda: session.save_results(RESULTS),
        lambda: session.save_applied({"left": SHIFT_M}),
        lambda: session.save_facts(verified={"left": found}),
        lambda: session.restore("alignment", 1),
        lambda: session.save_trial(trial),
        lambda: session.delete("trial", 1),
        lambda: session.save_fine_tuned({"left": 2 * SHIFT_M}),
        lambda: session.save_notes("half a pair \ud800"),
        lambda: session.correct_wearer("Ada"),
        lambda: session.finish(),
    ):
        before = session.contents
        write()
        held, read = session.contents, Session.open(session.path)
        assert held is not before
        assert session.contents is held
        for field in fields(SessionRecord):
            assert _plain(getattr(held, field.name)) == _plain(getattr(read, field.name)), field


def _plain(value: object) -> object:
    """Return a value in a form that compares by contents."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if is_dataclass(value):
        return [_plain(getattr(value, field.name)) for field in fields(value)]
    return value


def test_trials_come_back_can_be_deleted_and_are_limited(session: Session, trial: Trial) -> None:
    assert [session.save_trial(trial) for _ in range(3)] == [1, 2, 3]
    session.delete("trial", 1)
    session.delete("trial", 2)
    session.restore("trial", 1)
    record = Session.open(session.path)
    assert (list(record.trials), list(record.deleted_trials)) == ([1, 3], [2])
    for stored in (*record.trials.values(), record.deleted_trials[2]):
        assert trial_json(stored) == trial_json(trial)
    assert [stored.time for stored in record.trials.values()] == [
        record.events[1].time,
        record.events[3].time,
    ]
    with pytest.raises(ValueError, match="there is no trial 2"):
        session.delete("trial", 2)
    with pytest.raises(ValueError, match="there is no deleted trial 3"):
        session.restore("trial", 3)
    for _ in range(MAX_TRIALS - 2):  # the deleted one does not count
        session.save_trial(trial)
    with pytest.raises(FileError, match="full: no room for more than 1000 trials"):
        session.save_trial(trial)


def test_a_session_reports_if_it_is_solved_and_applied(
    session: Session, alignment: Alignment
) -> None:
    def now() -> tuple[bool, bool]:
        record = Session.open(session.path)
        return record.is_solved, record.is_applied

    assert now() == (False, False)
    session.save_alignment(alignment)
    session.save_results(RESULTS)
    assert now() == (True, False)
    session.save_applied({"left": SHIFT_M})
    assert now() == (True, True)
    session.save_alignment(alignment)
    assert now() == (False, False)
    assert Session.open(session.path).results == RESULTS  # of the first
    session.save_results(RESULTS)
    assert now() == (True, False)


def test_a_verification_is_of_the_alignments_so_far(session: Session, alignment: Alignment) -> None:
    found = Verification((0.0, 0.0, 0.0), (1.0, -2.0), (0.001, 0.0, 0.0))
    session.save_alignment(alignment)
    session.save_facts(verified={"left": found})
    assert Session.open(session.path).verified_now == {"left"}
    session.save_alignment(replace(alignment, t_b_ns=3))
    record = Session.open(session.path)
    assert record.verified_now == frozenset()
    assert set(record.facts.verified) == {"left"}
    session.delete("alignment", 2)
    assert Session.open(session.path).verified_now == {"left"}


def test_going_back_is_not_setting_by_hand(session: Session) -> None:
    session.save_applied({"left": SHIFT_M, "right": SHIFT_M})
    session.save_fine_tuned({"left": 2 * SHIFT_M, "right": SHIFT_M})
    assert set(Session.open(session.path).set_by_hand_m) == {"left", "right"}
    session.record(WENT_BACK, to="former")
    session.save_fine_tuned({"left": 2 * SHIFT_M, "right": 3 * SHIFT_M})
    record = Session.open(session.path)
    assert record.went_back
    assert set(record.set_by_hand_m) == {"left"}, "as set before"
    session.save_results(RESULTS)
    record = Session.open(session.path)
    assert not record.went_back
    assert not record.set_by_hand_m


@pytest.mark.parametrize("data", [{}, {"shift_m": {"left": ["x"]}}, {"shift_m": 3}])
def test_a_damaged_fine_tuning_costs_only_itself(session: Session, data: dict[str, object]) -> None:
    session.save_fine_tuned({"left": SHIFT_M})
    number = len(Session.open(session.path).events) + 1
    with (session.path / JOURNAL).open("ab") as journal:
        journal.write(journal_line(happens_now(number, SessionEvent.FINE_TUNED, data)))
    record = Session.open(session.path)
    assert len(record.damaged) == 1
    assert set(record.set_by_hand_m) == {"left"}


def test_a_shift_set_by_hand_is_kept_until_the_next_results(session: Session) -> None:
    session.save_applied({"left": SHIFT_M, "right": SHIFT_M})
    assert Session.open(session.path).fine_tuned is None
    session.save_fine_tuned({"right": 2 * SHIFT_M})
    session.save_fine_tuned({"right": 3 * SHIFT_M})
    record = Session.open(session.path)
    assert record.fine_tuned is not None
    assert set(record.fine_tuned) == {"right"}
    assert (record.fine_tuned["right"] == 3 * SHIFT_M).all()
    session.save_results(RESULTS)
    record = Session.open(session.path)
    assert record.fine_tuned is None
    assert (record.applied_shift_m["left"] == SHIFT_M).all()
    assert (record.applied_shift_m["right"] == 3 * SHIFT_M).all()
    for wrong in ({"middle": SHIFT_M}, {"left": SHIFT_M[:2]}, {"left": [0.0, 0.0, np.inf]}):
        with pytest.raises(ValueError, match=r"middle|shape|finite"):
            session.save_fine_tuned(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("wearer", ["", "P07", "  Ana María Öz\t", "x" * 100])
def test_the_wearer_comes_back(tmp_path: Path, wearer: str) -> None:
    with Session.create(tmp_path, example_rig(), {}, name="one", wearer=wearer) as session:
        assert Session.open(session.path).wearer == wearer.strip()


@pytest.mark.parametrize(
    "wearer", ["x" * 101, "two\nlines", "bell\x07", "\ud800", "two\u2028lines"]
)
def test_what_is_no_name_is_refused_and_leaves_nothing(tmp_path: Path, wearer: str) -> None:
    with pytest.raises(ValueError, match=r"a wearer's name (may have|must not)"):
        Session.create(tmp_path, example_rig(), {}, name="one", wearer=wearer)
    assert list(tmp_path.iterdir()) == []


def test_notes_are_kept_beside_the_journal(session: Session) -> None:
    before = Session.open(session.path)
    assert before.notes == ""
    text = "Größe passt.\r\nLinks nochmal – φ?\n" + "ü" * (MAX_NOTES_CHARACTERS - 100)
    session.save_notes("first")
    session.save_notes(text)
    record = Session.open(session.path)
    assert record.notes == text
    names = [event.name for event in record.events[len(before.events) :]]
    assert names == ["notes_saved", "notes_saved"]
    with pytest.raises(ValueError, match="20,000 characters"):
        session.save_notes("x" * (MAX_NOTES_CHARACTERS + 1))
    assert Session.open(session.path).notes == text
    session.save_notes("half a pair \ud800")
    assert Session.open(session.path).notes == "half a pair ?"


def test_it_is_finished_until_something_happens(session: Session) -> None:
    assert not Session.open(session.path).is_finished
    session.finish()
    session.save_notes("later")
    assert Session.open(session.path).is_finished
    session.record("went_on")
    assert not Session.open(session.path).is_finished


def test_a_file_that_was_replaced_is_no_longer_damaged(session: Session) -> None:
    session.save_results({"a": 1})
    session.save_notes("before")
    session.close()
    for name in ("results.json", "notes.txt"):
        (session.path / name).write_bytes(b"{")
    with Session(session.path) as again:
        assert {one.file for one in again.contents.damaged} == {"results.json", "notes.txt"}
        again.save_notes("after")
        assert {one.file for one in again.contents.damaged} == {"results.json"}
        again.save_results({"a": 2})
        assert again.contents.damaged == ()


def test_no_log_has_the_wearer_s_name(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    with Session.create(tmp_path, example_rig(), {}, wearer="Zdenka Quorvath") as session:
        session.save_notes("sits well")
    Session.open(session.path)
    assert "Zdenka" not in caplog.text


def test_a_verification_only_begun_is_worth_resuming(session: Session) -> None:
    session.record("cursor_made")
    assert not Session.open(session.path).is_worth_resuming
    session.record(VERIFYING, eye="left")
    assert Session.open(session.path).is_worth_resuming
