"""The judge of the segmentation, on masks and changes that are known."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from handcal.camera.images import write_frame
from handcal.cli.main import main
from handcal.core.errors import FileError, HandError
from handcal.core.types import Frame, HandCloud
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.io.images import read_image
from handcal.lab.evaluate.masked_frames import (
    MaskedFrame,
    cropped,
    read_masked_frames,
    read_masked_names,
    scaled,
    subsampled,
)
from handcal.lab.evaluate.segmentation import evaluate_frame, evaluation
from handcal.sim.camera import simulated_frame

GATE = SegmentSettings()
KEYS = {
    "frames", "refused", "iou_mean", "iou_min", "kept_min", "wrist_sd_mm", "wrist_max_step_mm",
    "area_change_max", "area_changes_over_10_percent", "rows",
}  # fmt: skip


@pytest.fixture(scope="module")
def shot() -> MaskedFrame:
    """Return a simulated frame with its own segmentation as the truth."""
    frame = scaled(simulated_frame(seed=1), 0.5)
    found = segment_hand(frame, GATE)
    cut_m = found.contour_m[found.contour_is_cut].mean(axis=0)
    return MaskedFrame("7", frame, found.mask > 0, cut_m - [0.0, 0.01, 0.0], np.array([0.0, 1, 0]))


def by_depth(frame: Frame) -> HandCloud:
    return segment_hand(frame, GATE)


def changed(find: Callable[[Frame], HandCloud], edit: Callable[[HandCloud], HandCloud]) -> Any:
    return lambda frame: edit(find(frame))


def test_the_truth_itself_is_perfect_and_stable(shot: MaskedFrame) -> None:
    row, mask = evaluate_frame(shot, by_depth)
    assert mask is not None
    assert (row.name, row.refused, row.iou, row.kept) == ("7", None, 1.0, 1.0)
    assert row.beyond_wrist_mm == pytest.approx(10.0, abs=0.1)
    assert row.area_change is not None
    assert row.area_change < 0.05
    assert row.centroid_change_mm is not None
    assert row.centroid_change_mm < 5.0


def test_half_a_mask_is_half_as_good(shot: MaskedFrame) -> None:
    columns = np.nonzero(shot.is_hand)[1]
    half = shot.is_hand.copy()
    half[:, int(np.median(columns)) :] = False
    halved = np.count_nonzero(half) / np.count_nonzero(shot.is_hand)
    row, _ = evaluate_frame(replace(shot, is_hand=half), by_depth)
    assert row.iou == pytest.approx(halved)
    assert row.kept == 1.0
    lost = changed(by_depth, lambda cloud: replace(cloud, mask=np.where(half, cloud.mask, 0)))
    first = [lost]  # later frames differ in size
    row, _ = evaluate_frame(shot, lambda frame: first.pop()(frame) if first else by_depth(frame))
    assert row.iou == row.kept == pytest.approx(halved)
    assert row.area_change == pytest.approx(1 / halved - 1, rel=0.1)


def test_what_is_refused_is_counted_with_its_reason(shot: MaskedFrame) -> None:
    def refuse(frame: Frame) -> HandCloud:
        raise HandError("too far")

    row, mask = evaluate_frame(shot, refuse)
    assert mask is None
    assert (row.refused, row.iou, row.area_change) == ("too far", None, None)

    def only_whole(frame: Frame) -> HandCloud:
        return by_depth(frame) if frame is shot.frame else refuse(frame)

    unstable, _ = evaluate_frame(shot, only_whole)
    assert unstable.area_change == 1.0
    figures = evaluation([row, unstable])
    assert figures.keys() == KEYS
    assert (figures["frames"], figures["refused"], figures["iou_mean"]) == (2, 1, 1.0)
    assert figures["area_changes_over_10_percent"] == 1
    assert figures["wrist_sd_mm"] is figures["wrist_max_step_mm"] is None
    json.dumps(figures, allow_nan=False)


def test_steps_at_the_wrist_are_between_neighbours(shot: MaskedFrame) -> None:
    row, _ = evaluate_frame(shot, by_depth)
    rows = [replace(row, beyond_wrist_mm=mm) for mm in (10.0, 14.0, None, 30.0, 29.0)]
    figures = evaluation(rows)
    assert figures["wrist_max_step_mm"] == 4.0
    assert figures["wrist_sd_mm"] == pytest.approx(np.std([10, 14, 30, 29], ddof=1))


@pytest.mark.parametrize("way", ["crop", "scale", "sample"])
def test_a_varied_frame_shows_the_same_points(shot: MaskedFrame, way: str) -> None:
    varied = {
        "crop": lambda: cropped(shot.frame, 3, 5, 2, 7),
        "scale": lambda: scaled(shot.frame, 0.8),
        "sample": lambda: subsampled(shot.frame, 2, 1, 0),
    }[way]()
    x = np.array([0.01, -0.02])
    for frame in (shot.frame, varied):
        camera = frame.depth_intrinsics
        column, row = np.rint(np.array([camera.fx, camera.fy]) * x / 0.5 + [camera.cx, camera.cy])
        assert frame.depth[int(row), int(column)] * frame.depth_scale_m == pytest.approx(
            shot.frame.depth[
                round(shot.frame.depth_intrinsics.fy * x[1] / 0.5 + shot.frame.depth_intrinsics.cy),
                round(shot.frame.depth_intrinsics.fx * x[0] / 0.5 + shot.frame.depth_intrinsics.cx),
            ]
            * shot.frame.depth_scale_m,
            abs=0.006,
        )


@pytest.fixture
def folder(tmp_path: Path, shot: MaskedFrame) -> Path:
    """Return a folder of two frames, the second a wall that is refused."""
    about = {}
    for name, depth in (("10", shot.frame.depth), ("9", np.full_like(shot.frame.depth, 20000))):
        color, depth_path, _ = write_frame(tmp_path / "one", replace(shot.frame, depth=depth))
        color.rename(tmp_path / f"{name}_color.png")
        depth_path.rename(tmp_path / f"{name}_depth.png")
        cv2.imwrite(str(tmp_path / f"{name}_handmask.png"), shot.is_hand.astype(np.uint8) * 255)
        camera = shot.frame.depth_intrinsics
        about[name] = {
            "intrinsics": [camera.fx, camera.fy, camera.cx, camera.cy],
            "width": camera.width,
            "height": camera.height,
            "depth_unit_m": shot.frame.depth_scale_m,
        }
    (tmp_path / "meta.json").write_text(json.dumps(about))
    return tmp_path


def test_a_folder_is_judged_by_the_command(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figures, sheet = tmp_path / "out" / "figures.json", tmp_path / "out" / "sheet.png"
    options = ["--roi", "depth", "--json", str(figures), "--sheet", str(sheet)]
    options += ["--output", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", ["handcal", "evaluate", "segmentation", str(folder), *options])
    main()
    result = json.loads(figures.read_text())
    assert result.keys() == KEYS
    assert (result["frames"], result["refused"], result["iou_min"]) == (2, 1, 1.0)
    assert [row["name"] for row in result["rows"]] == ["9", "10"]
    assert read_image(sheet, cv2.IMREAD_COLOR).shape == (320, 4 * 320, 3)
    assert {path.name for path in sheet.parent.glob("report.*")} == {"report.pdf", "report.html"}
    assert "9: no hand-sized object" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        ({"intrinsics": [1, 2]}, "intrinsics"),
        ({"depth_unit_m": 7}, "depth_unit_m"),
        ({"joints3d_mm": [[1, 2, 3]]}, "21 points"),
        ({"joints3d_mm": [["a"]]}, "21 points"),
        ({"depth_aligned_to_color": False}, "aligned"),
        ({"width": 639}, "pixels"),
    ],
)
def test_a_wrong_description_is_one_clear_line(
    folder: Path, edit: dict[str, Any], reason: str
) -> None:
    about = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps({"9": about["9"] | edit}))
    with pytest.raises(FileError, match=reason):
        list(read_masked_frames(folder, read_masked_names(folder)))


def test_a_folder_of_no_frames_is_known_before_they_are_read(folder: Path) -> None:
    named = {"fx": 1.0, "fy": 1.0, "cx": 1.0, "cy": 1.0}
    about = json.loads((folder / "meta.json").read_text())
    read_masked_names(folder)
    (folder / "meta.json").write_text(json.dumps({"9": about["9"] | {"intrinsics": named}}))
    with pytest.raises(FileError, match=r"a list of four numbers without names, \[fx, fy, cx, cy"):
        read_masked_names(folder)
    (folder / "meta.json").write_text(json.dumps({"8": about["9"]}))
    with pytest.raises(FileError, match=r"there is no .*8_depth\.png"):
        read_masked_names(folder)
    (folder / "meta.json").unlink()
    with pytest.raises(FileError, match=r"holds no meta\.json"):
        read_masked_names(folder)


def test_an_empty_mask_is_refused(folder: Path) -> None:
    mask = read_image(folder / "9_handmask.png", cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(folder / "9_handmask.png"), np.zeros_like(mask))
    with pytest.raises(FileError, match="empty"):
        list(read_masked_frames(folder, read_masked_names(folder)))
