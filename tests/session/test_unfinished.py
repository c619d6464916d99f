import json
from pathlib import Path

import numpy as np

from handcal.core.types import Alignment
from handcal.rig.example import example_rig
from handcal.session.library import unfinished_and_repaired
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal.session.trial import COMPARED, Comparison, comparison_json, make_trial


def make(parent: Path, name: str, wearer: str = "") -> Session:
    return Session.create(parent, example_rig(), {}, name=name, wearer=wearer)


def test_only_those_not_finished_are_listed_the_newest_first(
    tmp_path: Path, alignment: Alignment
) -> None:
    with make(tmp_path, "b-first", "P7") as first:
        first.save_alignment(alignment)
        first.save_alignment(alignment)
        first.delete("alignment", 1)
        first.finish()
        first.record("went_on")
    with make(tmp_path, "c-done") as done:
        done.finish()
        done.save_notes("notes do not begin it again")
        trial = make_trial(example_rig().eyes["left"], "left", 0.5, np.zeros(3), np.zeros(3))
        done.save_fine_tuned({"left": np.zeros(3)})
        done.save_trial(trial)
        done.record(COMPARED, **comparison_json(Comparison("offline", "first", {})))
        done.delete("trial", 1)
        done.restore("trial", 1)
    assert Session.open(tmp_path / "c-done").is_finished
    make(tmp_path, "a-second").close()
    (tmp_path / "other").mkdir()
    (tmp_path / "file").write_text("not a folder")

    newest, oldest = unfinished_and_repaired(tmp_path)[0]
    assert (newest.path, oldest.path) == (tmp_path / "a-second", tmp_path / "b-first")
    assert (oldest.wearer, oldest.alignments, oldest.trials, oldest.problem) == ("P7", 1, 0, "")
    assert oldest.started == Session.open(oldest.path).events[0].time
    with Session(oldest.path):  # it can be resumed
        pass


def test_a_session_that_cannot_be_resumed_gives_the_reason(
    tmp_path: Path, alignment: Alignment
) -> None:
    for name in ("damaged", "foreign", "empty"):
        with make(tmp_path, name) as session:
            session.save_alignment(alignment)
    (tmp_path / "damaged" / "alignments" / "1.npz").write_bytes(b"nothing")
    event = json.dumps({"version": 9})
    (tmp_path / "foreign" / "journal.jsonl").write_text(event + "\n")
    (tmp_path / "empty" / "journal.jsonl").write_text("")
    with make(tmp_path, "running"):
        problems = {one.path.name: one.problem for one in unfinished_and_repaired(tmp_path)[0]}
        parts = {one.path.name: one.damaged for one in unfinished_and_repaired(tmp_path)[0]}
    assert set(problems) == {"damaged", "foreign", "empty", "running"}
    assert (problems["damaged"], parts["damaged"]) == ("", 1)
    assert "has version 9" in problems["foreign"]
    assert "does not begin" in problems["empty"]
    assert "in use by process" in problems["running"]


def test_a_damaged_session_knows_of_its_repaired_copy(tmp_path: Path, alignment: Alignment) -> None:
    with make(tmp_path, "one") as session:
        session.save_alignment(alignment)
        session.save_alignment(alignment)
    with make(tmp_path, "other") as other:
        other.save_alignment(alignment)
    for name in ("one", "other"):
        (tmp_path / name / "alignments" / "1.npz").unlink()
    repair_session(tmp_path / "one", tmp_path / "copy")
    found = {
        session.path.name: session.is_repaired for session in unfinished_and_repaired(tmp_path)[0]
    }
    assert found == {"one": True, "copy": False, "other": False}
    with Session(tmp_path / "copy") as copy:
        copy.finish()
    found = {
        session.path.name: session.is_repaired for session in unfinished_and_repaired(tmp_path)[0]
    }
    assert found == {"one": True, "other": False}


def test_a_folder_that_is_not_there_has_none(tmp_path: Path) -> None:
    assert unfinished_and_repaired(tmp_path / "missing")[0] == []
