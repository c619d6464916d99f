import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.types import UInt8
from handcal.hand.detect import Detections


class Seer:
    """A detector that sees the hand, and another that is not there."""

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        assert color.shape == (96, 128, 3)
        return Detections(
            np.array([[10.0, 10.0, 60.0, 60.0], [70.0, 70.0, 90.0, 90.0]]), np.array([0.9, 0.8])
        )


def evaluate(
    monkeypatch: pytest.MonkeyPatch, *arguments: object, command: str = "detector"
) -> None:
    monkeypatch.setattr("sys.argv", ["handcal", "evaluate", command, *map(str, arguments)])
    main()


def test_writes_the_figures_and_the_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((96, 128, 3), 127, np.uint8))
    box = [10, 10, 60, 60]
    quad = [[10, 10], [60, 10], [60, 60], [10, 60]]
    hands = [{"box": box, "quad": quad, "large": True}]
    annotations = tmp_path / "annotations.json"
    annotations.write_text(json.dumps({"a.png": {"width": 128, "height": 96, "hands": hands}}))
    figures, sheet = tmp_path / "out" / "figures.json", tmp_path / "out" / "sheet.png"
    files = ("--images", tmp_path, "--annotations", annotations)
    monkeypatch.setattr("handcal.hand.shipped.load_detector", lambda settings: Seer())
    evaluate(monkeypatch, *files, "--json", figures, "--sheet", sheet)
    result = json.loads(figures.read_text())
    assert result["ap50"] == result["ap50_large"] == result["ap50_rel15"] == 1.0
    assert result["curve"]["precision"] == [1.0]
    assert (result["images"], result["hands"]) == (1, 1)
    assert cv2.imread(str(sheet)) is not None


def test_a_missing_file_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "no.json"
    with pytest.raises(SystemExit) as ended:
        evaluate(monkeypatch, "--images", tmp_path, "--annotations", missing)
    assert ended.value.code == 1
    assert "no.json" in capsys.readouterr().err


def test_the_report_of_users_never_goes_into_a_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study.json").write_text("{}")
    with pytest.raises(SystemExit) as ended:
        evaluate(monkeypatch, tmp_path, "--output", tmp_path, command="users")
    assert ended.value.code == 1
    assert "holds a study" in capsys.readouterr().err
