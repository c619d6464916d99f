"""Tasks of the library: sessions checked, repaired and deleted, with progress and a message."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from handcal.errors import FileError
from handcal.progress import Progress
from handcal.session.library import correct_wearer, delete_session, restore_session
from handcal.session.repair import check_session, repair_session
from handcal_gui.translation import tr
from handcal_gui.widgets.numbers import pluralize

_MOST_NAMED = 3
_MOST_LINES = 8


def check_sessions(paths: Sequence[Path], progress: Progress) -> str:
    """Read every file of some sessions; return which are damaged, as a message."""
    lines = []
    for done, path in enumerate(paths):
        progress.at(done / len(paths), tr("Checking {}").format(path.name))
        found = check_session(path)
        if found.state == "sound":
            continue
        damaged = found.damaged[:_MOST_NAMED]
        # Where nothing can be read, the reason names the folder itself.
        named = "; ".join(one.what if found.state == "none" else str(one) for one in damaged)
        more = len(found.damaged) - _MOST_NAMED
        others = tr(" (and {} more)").format(more) if more > 0 else ""
        lines.append(f"{path.name}: {named}{others}")
    sound = len(paths) - len(lines)
    count = pluralize(sound, tr("session"), tr("sessions"))
    return _with_lines(tr("{} sound, every file read.").format(count), lines)


def repair_beside(path: Path, progress: Progress) -> str:
    """Copy what is sound of a damaged session to a new one beside it; return a message."""
    progress.at(0.0, tr("Repairing {}").format(path.name))
    if check_session(path).state == "sound":
        return tr("{} is sound: there is nothing to repair.").format(path.name)
    output = _free(path.with_name(f"{path.name}-repaired"))
    made = repair_session(path, output)
    kept = pluralize(len(made.alignments), tr("alignment"), tr("alignments"))
    return tr("{}: a copy with {} and {}.").format(
        output.name, kept, pluralize(len(made.trials), tr("trial"), tr("trials"))
    )


def delete_sessions(paths: Sequence[Path], progress: Progress) -> str:
    """Delete some sessions, each of which can be restored; return a message."""
    failed = _each(paths, delete_session, tr("Deleting {}"), progress)
    count = pluralize(len(paths) - len(failed), tr("session"), tr("sessions"))
    return _with_lines(tr("{} deleted.").format(count), failed)


def correct_names(names: Mapping[Path, str], progress: Progress) -> str:
    """Correct the names of the wearers of some sessions; return a message."""
    failed = _each(
        list(names), lambda path: correct_wearer(path, names[path]), tr("Correcting {}"), progress
    )
    count = pluralize(len(names) - len(failed), tr("session"), tr("sessions"))
    return _with_lines(tr("Name corrected in {}.").format(count), failed)


def _each(
    paths: Sequence[Path], do: Callable[[Path], object], doing: str, progress: Progress
) -> list[str]:
    """Do something to each session; return those for which it failed, with the reasons."""
    failed = []
    for done, path in enumerate(paths):
        progress.at(done / len(paths), doing.format(path.name))
        try:
            do(path)
        except (FileError, ValueError) as error:  # a name may be invalid
            failed.append(f"{path.name}: {error}")
    return failed


def restore_deleted(path: Path, _progress: Progress) -> str:
    """Restore a deleted session; return a message."""
    return tr("{} restored.").format(restore_session(path).name)


def _with_lines(said: str, lines: Sequence[str]) -> str:
    """Return a message with a line for each session, as many as the window has room for."""
    more = len(lines) - _MOST_LINES
    others = [tr("and {} more").format(more)] if more > 0 else []
    return "\n".join((said, *lines[:_MOST_LINES], *others))


def _free(path: Path) -> Path:
    """Return a path that does not exist, with a number if needed."""
    number = 2
    found = path
    while found.exists():
        found, number = path.with_name(f"{path.name}-{number}"), number + 1
    return found
