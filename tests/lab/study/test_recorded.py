import json
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.errors import FileError
from handcal.lab.study.methods import MethodSettings
from handcal.lab.study.recorded import evaluate_recordings, read_recordings


@pytest.fixture
def folder(shared_data: Path) -> Path:
    return shared_data / "spaam_indica"


def test_spaam_is_the_authors_own_on_all_recordings(folder: Path) -> None:
    """To the digits in which the alignments are stored."""
    results = evaluate_recordings(read_recordings(folder))
    assert list(results) == ["Base", *map(str, range(1, 11))]
    for result in results.values():
        assert result.difference_px < 1e-3
        assert result.spaam_px == pytest.approx(result.authors_spaam_px, abs=1e-4)


def test_the_study_takes_its_wearers_errors_from_here(folder: Path) -> None:
    results = list(evaluate_recordings(read_recordings(folder)).values())
    freedom = [2 * result.alignments - 11 for result in results]
    squares = [result.pointing_sigma_arcmin**2 for result in results]
    settings = MethodSettings()
    assert np.sqrt(np.average(squares, weights=freedom)) == pytest.approx(
        settings.pointing_sigma_arcmin, abs=0.1
    )
    misses_mm = np.array([result.eye_miss_mm for result in results])
    np.testing.assert_allclose(
        misses_mm.std(axis=0, ddof=1)[:2],
        1e3 * np.array(settings.eye_tracker_sigma_m[:2]),
        atol=0.1,
    )


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("3/eye_positions.txt", None, "is missing"),
        ("3/eye_positions.txt", "1 2\n", "3 finite numbers in each line"),
        ("3/eye_positions.txt", "1 2 3\n", "two clusters"),
        ("3/MarkerSPAAM_DataSPAAM2D.txt", "here there", "not a table of numbers"),
        ("3/MarkerSPAAM_DataSPAAM3D.txt", "1 2 nan\n", "finite"),
        ("3/SPAAM_calibration.calib", "22 serialization", "Ubitrack"),
        ("3/SPAAM_calibration.calib", "1 2 3", "must end with 12"),
        ("PoseFromEyeCam2WorldCam.txt", "x" * 1_000_001, "larger than"),
        ("display_param_nonlinear.mat", "no matrices", "display parameters"),
    ],
)
def test_damaged_files_are_named(
    folder: Path, tmp_path: Path, file: str, content: str | None, message: str
) -> None:
    copy = tmp_path / "copy"
    copytree(folder, copy)
    for path in [copy, *copy.rglob("*")]:
        path.chmod(0o755 if path.is_dir() else 0o644)
    if content is None:
        (copy / file).unlink()
    else:
        (copy / file).write_text(content)
    with pytest.raises(FileError, match=message):
        read_recordings(copy)


def test_a_recording_that_tells_no_projection_is_named(folder: Path) -> None:
    data = read_recordings(folder)
    short = replace(data.recordings["7"], points_m=np.ones((3, 3)), pixels=np.ones((3, 2)))
    with pytest.raises(FileError, match="recording 7: points_m has 3 points"):
        evaluate_recordings(replace(data, recordings={**data.recordings, "7": short}))


def test_the_command_tells_every_recording(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "recorded.json"
    arguments = "handcal", "study", "recorded", str(folder), "--json", str(file)
    monkeypatch.setattr("sys.argv", arguments)
    main()
    shown = capsys.readouterr().out
    assert len(json.loads(file.read_text())) == 11
    assert "authors'" in shown
    assert "8.5′" in shown
