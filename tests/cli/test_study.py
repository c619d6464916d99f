"""``handcal study …`` as its user meets it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from handcal.cli.main import main
from handcal.lab.study import noise, studies

TINY = replace(
    noise.QUICK_NOISE,
    hands=1,
    trials=1,
    coarse_deg=(0.0, 9.0),
    fine_deg=(0.0,),
    kept_deg=(),
    shift_max_m=(),
    depth_sigmas_m=(),
    forearms_m=(),
    counts=(),
    shapes=0,
    slips=(),
)


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., None]:
    """Run ``handcal study noise``, a tiny one, into a folder."""
    monkeypatch.setattr(studies, "QUICK_NOISE", TINY)

    def run(*arguments: str) -> None:
        command = ["handcal", "study", "noise", "--quick", "--output", str(tmp_path / "study")]
        monkeypatch.setattr(sys, "argv", [*command, "--workers", "1", *arguments])
        main()

    return run


def fails(study: Callable[..., None], *arguments: str) -> int:
    with pytest.raises(SystemExit) as raised:
        study(*arguments)
    assert isinstance(raised.value.code, int)
    return raised.value.code


def test_a_study_ends_with_rows_and_a_report(
    study: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study("--json", str(tmp_path / "noise.json"))
    folder = tmp_path / "study"
    for file in ("rows.csv", "report.pdf", "report.html", "figures/rotation.png"):
        assert (folder / file).stat().st_size > 100
    figures = json.loads((tmp_path / "noise.json").read_text())["figures"]
    assert {row["value"] for row in figures["rotation"]} == {0.0, 9.0}
    output = capsys.readouterr().out
    assert "published: 9°" not in output, "a quick look has no headline"
    assert str(folder / "report.pdf") in output.replace("\n", "")


def test_an_interrupted_study_goes_on(
    study: Callable[..., None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    asked = 0

    @contextmanager
    def interrupted() -> Iterator[Callable[[], bool]]:
        def ask() -> bool:
            nonlocal asked
            asked += 1
            return asked > 1  # there are two cases: a quick machine asks no more often

        yield ask

    with monkeypatch.context() as patch:
        patch.setattr("handcal.cli.study.until_interrupted", interrupted)
        assert fails(study) == 130
    assert "run it again to resume it" in capsys.readouterr().err
    assert not (tmp_path / "study" / "rows.csv").exists()
    chunks = set((tmp_path / "study" / "chunks").iterdir())
    monkeypatch.setattr("handcal.lab.study.studies.write_report", lambda *_: ())
    study()
    assert chunks < set((tmp_path / "study" / "chunks").iterdir())
    assert (tmp_path / "study" / "rows.csv").exists()


def test_a_folder_of_another_seed_is_refused(
    study: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.json").write_text('{"name": "noise", "settings": {"seed": 7}}')
    assert fails(study) == 1
    assert "seed 7 there, 1 here" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--workers", "0"), "'0' is not a whole number from 1 to 1024"),
        (("--workers", "many"), "'many' is not a whole number"),
        (("--seed", "-1"), "'-1' is not a whole number"),
    ],
)
def test_wrong_arguments(
    study: Callable[..., None],
    arguments: tuple[str, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert fails(study, *arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.process
def test_a_cluster_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    words = "study", "noise", "--quick", "--scheduler", "nowhere", "--output", str(tmp_path)
    run = subprocess.run(
        [sys.executable, "-m", "handcal", *words], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
    assert run.stderr.startswith("handcal: no Dask scheduler answers at 'nowhere'")
    assert run.stderr.count("\n") == 1


def test_open3d_solves_too_where_it_is_requested(
    study: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("open3d")
    monkeypatch.setattr(studies, "write_report", lambda *_: ())  # that of the study above
    study("--open3d")
    rows = (tmp_path / "study/rows.csv").read_text()
    assert rows.count(",icp-open3d,") == rows.count(",icp,") > 0


def test_open3d_that_is_missing_is_one_line(
    study: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    assert fails(study, "--open3d") == 1
    error = capsys.readouterr().err
    assert "pip install 'handcal[3d]'" in error
    assert error.count("\n") == 1
