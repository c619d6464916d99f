"""``handcal study …`` as its user meets it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from handcal.cli.main import main, parse
from handcal.cli.terminal import settings_of
from handcal.lab.settings import ProcedureStudySettings
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


def test_open3d_solves_too_where_it_is_requested(
    study: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("open3d")
    monkeypatch.setattr(studies, "write_report", lambda *_: ())  # that of the study above
    study("--open3d")
    rows = (tmp_path / "study/rows.csv").read_text()
    assert rows.count(",icp-open3d,") == rows.count(",icp,") > 0


def test_every_option_reaches_the_study_of_procedures() -> None:
    line = (
        "study procedures --wearers 3 --seed 2 --plan paper spaam-9 --variant drift --scale 1 2 "
        "--eye-distance ruler --prior learned --wearer-prior learned --sensor ahat --fatten-px 1 "
        "--workers 2 --scheduler tcp://a:1 --output b"
    )
    expected = ProcedureStudySettings(
        *(3, 2, ("paper", "spaam-9"), ("drift",), (1.0, 2.0), "ruler", "learned", "learned"),
        *("ahat", 1.0, 2, "tcp://a:1", "b"),
    )
    assert settings_of(ProcedureStudySettings, parse(line.split())) == expected
