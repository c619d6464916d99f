"""Export of several sessions: one that fails, or a cancellation, spares the others."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_sessions
from handcal.io.resources import resource_path

SETTINGS = ExportSettings(("csv", "yaml"))


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    example = resource_path("example_session")
    return [Path(shutil.copytree(example, tmp_path / "in" / name)) for name in ("a", "b", "c")]


def test_one_that_fails_is_named_and_spares_the_others(paths: list[Path], tmp_path: Path) -> None:
    (paths[1] / "journal.jsonl").write_text("nonsense\n")
    shown: list[tuple[str, float]] = []
    progress = Progress(lambda what, share: shown.append((what, share)))
    made = export_sessions(paths, tmp_path / "out", SETTINGS, progress)
    names = ("calibration.yaml", "parameters.csv", "trials.csv")
    assert {file.relative_to(tmp_path / "out").as_posix() for file in made.files} >= {
        f"{session}/{name}" for session in ("a", "c") for name in names
    }
    [missing] = made.missing
    assert missing.startswith("b: ")
    assert "does not begin as the journal" in missing
    assert not (tmp_path / "out" / "b").exists()
    whats, shares = zip(*shown, strict=True)
    assert all(what.startswith(("1 of 3: ", "2 of 3: ", "3 of 3: ")) for what in whats)
    solving = "3 of 3: Simulated wearer, exporting 1 of 2, Parameters and trials (CSV): solving"
    assert any(what.startswith(solving) for what in whats)
    assert list(shares) == sorted(shares)


def test_cancelling_within_a_session_keeps_those_before(paths: list[Path], tmp_path: Path) -> None:
    shown: list[str] = []
    progress = Progress(
        lambda what, _: shown.append(what), lambda: bool(shown and "2 of 3: Simulated" in shown[-1])
    )
    made = export_sessions(paths, tmp_path / "out", SETTINGS, progress)
    assert made.missing == ("b: cancelled", "c: cancelled")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a"]
    with pytest.raises(CancelledError):
        export_sessions(paths, tmp_path / "other", SETTINGS, Progress(is_cancelled=lambda: True))
    assert not (tmp_path / "other").exists()
