"""The library of sessions: what each holds, unharmed by what is damaged; deleting and restoring."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.types import Alignment, HeadsetIdentity
from handcal.rig.example import example_rig
from handcal.session.library import (
    DELETED,
    correct_wearer,
    delete_session,
    deleted_sessions,
    deleted_together,
    read_library,
    restore_session,
)
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal.session.trial import make_trial

RESULTS = {
    "version": 2,
    "eyes": {
        "left": {
            "verdict": "accept",
            "benefit": {"without_arcmin": 28.0, "after_arcmin": 7.5},
            "measured_arcmin": [11.0, 4.5],
        },
        "right": {"verdict": "repeat", "benefit": {"after_arcmin": 16.0}},
    },
}


@pytest.fixture
def make(tmp_path: Path, alignment: Alignment) -> Callable[..., Path]:
    def make(name: str, wearer: str, *, solved: bool = True) -> Path:
        rig = example_rig()
        with Session.create(tmp_path, rig, {}, name=name, wearer=wearer) as session:
            session.save_facts(headset=HeadsetIdentity("00000000000000aa", "Lab 9"))
            session.save_alignment(alignment)
            if solved:
                session.save_results(RESULTS)
            for x_m in (1e-3, 3e-3):
                shift_m = np.array([x_m, 0.0, 0.0])
                session.save_trial(make_trial(rig.eyes["left"], "left", 0.5, np.zeros(3), shift_m))
            session.finish()
        return session.path

    return make


def test_an_entry_says_what_the_session_holds(make: Callable[..., Path], tmp_path: Path) -> None:
    path = make("one", "Ada")
    (entry,) = read_library(tmp_path)
    assert (entry.path, entry.wearer, entry.headset) == (path, "Ada", "Lab 9")
    assert entry.rig == example_rig().name
    assert (entry.alignments, entry.trials, entry.is_finished) == (1, 2, True)
    left, right = entry.eyes["left"], entry.eyes["right"]
    assert (left.verdict, left.expected_arcmin, left.remaining_arcmin) == ("accept", 7.5, 4.5)
    assert left.found_arcmin == 11.0
    assert (right.verdict, right.expected_arcmin, right.remaining_arcmin) == ("repeat", 16.0, None)
    assert (entry.problem, entry.damaged, entry.is_simulated) == ("", 0, False)


def test_the_trials_of_an_eye_are_those_of_its_calibration(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    path = make("one", "Ada", solved=False)
    means = [float(one.error_arcmin.mean()) for one in Session.open(path).trials.values()]

    def found(**results: object) -> float | None:
        with Session(path) as session:
            session.save_results({"eyes": {"left": results}})
        trials = read_library(tmp_path)[0].eyes["left"].trials
        assert trials is None or (trials.count, trials.is_over) == (2, False), "no target is known"
        return None if trials is None else trials.mean_arcmin

    mean = pytest.approx(np.mean(means))
    assert found(verdict="accept", shift_m=[0.0, 0.0, 0.0]) == mean
    assert found(verdict="keep", shift_m=[0.001, 0.0, 0.0]) == mean, "offline is kept"
    assert found(verdict="accept", shift_m=[0.001, 0.0, 0.0]) is None
    wrong: object
    for wrong in (["?"], [0, 0], [[0], 0, 0], {}):
        assert found(verdict="accept", shift_m=wrong) is None
    assert found(verdict="accept") is None


@pytest.mark.parametrize("name", ["shift_m", "measured_arcmin"])
def test_a_number_too_large_for_a_float_hides_no_other_session(
    make: Callable[..., Path], tmp_path: Path, name: str
) -> None:
    make("sound", "Bo")
    with Session(make("one", "Ada", solved=False)) as session:
        session.save_results({"eyes": {"left": {"verdict": "accept", name: [10**400, 0, 0]}}})
    entries = {entry.wearer: entry for entry in read_library(tmp_path)}
    assert entries["Ada"].damaged == 1
    assert not entries["Bo"].damaged


@pytest.mark.parametrize(
    ("settings", "target_arcmin"),
    [
        ({"calibration": {"solve": {"verdict": {"target_arcmin": 6.0}}}}, 6.0),
        ({"calibration": {"solve": {"verdict": {}}}}, None),
        ({"calibration": []}, None),
    ],
)
def test_an_entry_has_the_target_of_its_session(
    tmp_path: Path, settings: dict[str, Any], target_arcmin: float | None
) -> None:
    Session.create(tmp_path, example_rig(), settings, name="one").close()
    (entry,) = read_library(tmp_path)
    assert entry.target_arcmin == target_arcmin


def test_an_eye_that_keeps_the_offline_calibration_has_its_error(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    kept = {"benefit": {"without_arcmin": 6.2, "after_arcmin": 2.7}, "measured_arcmin": [5, 2.7]}
    with Session(make("one", "Ada", solved=False)) as session:
        session.save_results({"eyes": {"right": {"verdict": "keep", **kept}}})
    (entry,) = read_library(tmp_path)
    right = entry.eyes["right"]
    assert (right.before_arcmin, right.expected_arcmin, right.remaining_arcmin) == (6.2, 6.2, None)


def test_results_that_no_longer_hold_are_not_shown(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    with Session(make("one", "Ada")) as session:
        session.delete("alignment", 1)
    (entry,) = read_library(tmp_path)
    assert entry.eyes == {}
    assert not entry.is_finished


def test_a_damaged_session_says_so_and_spares_the_others(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    sound, torn, lost = make("sound", "A"), make("torn", "B"), make("lost", "C")
    lines = (torn / "journal.jsonl").read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b"sha256", b"sha255")
    (torn / "journal.jsonl").write_bytes(b"".join(lines))
    (lost / "journal.jsonl").write_bytes(b"nonsense\n")
    other = make("other", "D")
    (other / "alignments" / "1.npz").unlink()
    (other / "rig.yaml").write_text("nonsense")
    found = {entry.path: entry for entry in read_library(tmp_path)}
    assert set(found) == {sound, torn, lost, other}
    assert found[other].damaged == 2
    assert found[other].rig == example_rig().name  # the journal's copy
    assert found[sound].damaged == 0
    assert found[torn].damaged > 0
    assert found[torn].wearer == "B"
    assert "does not begin as the journal" in found[lost].problem


@pytest.mark.parametrize(
    "eyes", [None, [], {"left": 1}, {"left": {"benefit": [], "measured_arcmin": [1, True]}}]
)
def test_strange_results_are_no_obstacle(
    make: Callable[..., Path], tmp_path: Path, eyes: object
) -> None:
    with Session(make("one", "Ada", solved=False)) as session:
        session.save_results({"eyes": eyes})
    (entry,) = read_library(tmp_path)
    for outcome in entry.eyes.values():
        assert outcome.remaining_arcmin is None
        assert outcome.expected_arcmin is None


def test_only_changed_sessions_are_read_again(make: Callable[..., Path], tmp_path: Path) -> None:
    make("one", "Ada"), make("two", "Bea")
    before = read_library(tmp_path)
    with Session(tmp_path / "two") as session:
        session.save_notes("changed")
    after = {entry.path.name: entry for entry in read_library(tmp_path, before)}
    kept = {entry.path.name: entry for entry in before}
    assert after["one"] is kept["one"]
    assert after["two"] is not kept["two"]


def test_a_deleted_session_can_be_restored(make: Callable[..., Path], tmp_path: Path) -> None:
    path = make("one", "Ada")
    gone = delete_session(path)
    assert gone == tmp_path / DELETED / "one"
    assert read_library(tmp_path) == ()
    assert deleted_sessions(tmp_path) == (gone,)
    make("one", "Bea")
    second = delete_session(tmp_path / "one")
    assert second.name == "one-2"
    assert deleted_sessions(tmp_path) == (gone, second)
    make("one", "Cid")
    with pytest.raises(FileError, match="exists; rename it"):
        restore_session(gone)
    assert restore_session(second) == tmp_path / "one-2"
    assert {entry.wearer for entry in read_library(tmp_path)} == {"Bea", "Cid"}
    with pytest.raises(FileError, match="not in a folder"):
        restore_session(tmp_path / "one")


def test_what_was_deleted_together_is_known_after_a_restart(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    paths = [make(name, "Ada") for name in ("one", "two", "three")]
    delete_session(paths[0], 1_000_000_000)
    for path in paths[1:]:
        delete_session(path, 2_000_000_000)
    deleted = deleted_sessions(tmp_path)
    assert {path.name for path in deleted_together(deleted)} == {"two", "three"}
    for path in deleted_together(deleted):
        restore_session(path)
    assert [path.name for path in deleted_together(deleted_sessions(tmp_path))] == ["one"]
    assert deleted_together(()) == ()


def test_a_session_in_which_nothing_was_done_is_empty(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    make("full", "Ada", solved=False)
    for name in ("empty", "noted"):
        with Session.create(tmp_path, example_rig(), {}, name=name) as session:
            session.record("refused", reason="no hand")
            if name == "noted":
                session.save_notes("Glasses\noff")
    entries = {entry.path.name: entry for entry in read_library(tmp_path)}
    assert {name for name, entry in entries.items() if entry.is_empty} == {"empty"}
    assert entries["noted"].notes == "Glasses off"


def test_a_wearers_name_is_corrected_and_the_former_one_kept(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    path = make("one", "Adda")
    (known,) = read_library(tmp_path)
    correct_wearer(path, " Ada ")
    correct_wearer(path, "Ada")  # nothing to correct
    (entry,) = read_library(tmp_path, [known])
    assert (entry.wearer, entry.former_wearers, entry.damaged) == ("Ada", ("Adda",), 0)
    assert entry.is_finished
    assert entry.eyes
    assert Session.open(path).events[-1].data == {"wearer": "Ada", "before": "Adda"}
    correct_wearer(path, entry.former_wearers[-1])  # undone
    assert Session.open(path).wearer == "Adda"
    with pytest.raises(ValueError, match="line breaks"):
        correct_wearer(path, "A\nB")
    with Session(path), pytest.raises(FileError, match="in use by process"):
        correct_wearer(path, "Ada")
    with pytest.raises(FileError, match="no longer there"):
        correct_wearer(tmp_path / "gone", "Ada")


def test_a_repaired_copy_keeps_the_names(make: Callable[..., Path], tmp_path: Path) -> None:
    path = make("one", "Adda")
    correct_wearer(path, "Ada")
    (path / "alignments" / "1.npz").unlink()
    repair_session(path, tmp_path / "copy")
    copy = next(entry for entry in read_library(tmp_path) if entry.is_repaired)
    names = {entry.path.name: entry.repaired_as for entry in read_library(tmp_path)}
    assert names == {"one": "copy", "copy": ""}
    assert (copy.wearer, copy.former_wearers, copy.damaged) == ("Ada", ("Adda",), 0)


def test_a_crash_leaves_the_former_or_the_corrected_name(
    make: Callable[..., Path], tmp_path: Path
) -> None:
    journal = make("one", "Adda") / "journal.jsonl"
    begun = len(journal.read_bytes())
    correct_wearer(journal.parent, "Ada")
    complete = journal.read_bytes()
    for length in range(begun, len(complete) + 1):
        journal.write_bytes(complete[:length])
        record = Session.open(journal.parent)
        assert record.wearer == ("Ada" if length == len(complete) else "Adda")


def test_a_deleted_session_that_vanishes_while_listed_is_no_obstacle(
    make: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = delete_session(make("one", "Ada"))
    stat = Path.stat

    def vanished(path: Path, **options: bool) -> object:
        if path == gone:
            raise FileNotFoundError(path)
        return stat(path, **options)

    monkeypatch.setattr(Path, "stat", vanished)
    assert deleted_sessions(tmp_path) == (gone,)


def test_an_open_session_is_not_deleted(make: Callable[..., Path], tmp_path: Path) -> None:
    path = make("one", "Ada")
    with Session(path), pytest.raises(FileError):
        delete_session(path)
    assert len(read_library(tmp_path)) == 1
    with pytest.raises(FileError, match="not a session"):
        delete_session(tmp_path)
    with pytest.raises(FileError, match="no longer there: another program moved or deleted it"):
        delete_session(tmp_path / "gone")
