"""The calibration as other programs read it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.conventions import opengl_projection, openxr_view, unity_camera
from handcal.core.types import EYES, Rig
from handcal.export.calibration_file import write_calibration_json, write_calibration_yaml
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.session.session import SessionRecord


def test_filestorage_gives_every_double_back(tmp_path: Path, outcome: SessionOutcome) -> None:
    path = tmp_path / "calibration.yaml"
    write_calibration_yaml(path, outcome)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("handcal_calibration").real() == 1
    assert storage.getNode("wearer").string() == outcome.record.wearer
    assert outcome.results is not None
    assert [drawn.kind for drawn in outcome.drawn.values()] == ["set by hand", "solved"]
    for eye, drawn in outcome.drawn.items():
        node, display = storage.getNode(eye), outcome.record.rig.eyes[eye]
        covariance_m2 = outcome.results.eyes[eye].covariance_m2
        assert node.getNode("final").string() == drawn.kind
        assert node.getNode("is_applied").real() == 1
        assert np.array_equal(node.getNode("P").mat(), outcome.projection(eye).P)
        assert np.array_equal(node.getNode("K").mat(), display.K)
        assert np.array_equal(node.getNode("H0").mat(), display.H0)
        assert np.array_equal(node.getNode("shift_m").mat()[:, 0], drawn.shift_m)
        assert np.array_equal(node.getNode("solved_covariance_m2").mat(), covariance_m2)
        assert node.getNode("width_px").real() == display.width_px
        solved_m = outcome.shifts_m[eye]["solved"]
        assert np.array_equal(node.getNode("solved_shift_m").mat()[:, 0], solved_m)
    assert storage.getNode("right").getNode("set_by_hand_shift_m").empty()


def test_what_is_not_printable_is_replaced(tmp_path: Path, outcome: SessionOutcome) -> None:
    hostile = 'a"\n\x00\ud800' + "b" * 10_000
    named = replace(outcome, record=replace(outcome.record, wearer=hostile))
    write_calibration_yaml(tmp_path / "c.yaml", named)
    storage = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("wearer").string() == 'a"\ufffd\ufffd\ufffd' + "b" * 995
    assert not storage.getNode("right").getNode("P").empty()


@pytest.mark.parametrize("wearer", ["", "true", '"\\', "a: b # c", "../../x", "µ Ω", "x" * 1000])
def test_any_name_comes_back(tmp_path: Path, outcome: SessionOutcome, wearer: str) -> None:
    named = replace(outcome, record=replace(outcome.record, wearer=wearer))
    write_calibration_yaml(tmp_path / "c.yaml", named)
    storage = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("wearer").string() == wearer
    assert not storage.getNode("right").getNode("P").empty()
    write_calibration_json(tmp_path / "c.json", named, 0.1, 10.0)
    assert json.loads((tmp_path / "c.json").read_text())["wearer"] == wearer


def test_json_holds_every_origin_in_every_convention(
    tmp_path: Path, outcome: SessionOutcome
) -> None:
    write_calibration_json(tmp_path / "c.json", outcome, 0.2, 50.0)
    data = json.loads((tmp_path / "c.json").read_text())
    assert data["simulated"] == outcome.record.simulated
    assert (data["near_m"], data["far_m"], data["alignments"]) == (0.2, 50.0, 2)
    assert outcome.results is not None
    assert data["solved_eye_distance_m"] == outcome.results.eye_distance_m
    for eye in EYES:
        found = data["eyes"][eye]
        assert found["final"] == outcome.drawn[eye].kind
        assert list(found["calibrations"]) == list(outcome.shifts_m[eye])
        for origin, each in found["calibrations"].items():
            projection = outcome.projection(eye, origin)
            pose, fov = openxr_view(projection)
            clip = opengl_projection(projection, 0.2, 50.0)
            assert each["shift_m"] == outcome.shifts_m[eye][origin].tolist()
            assert each["opencv"]["P"] == projection.P.tolist()
            assert each["opengl"]["projection"] == clip.tolist()
            unity = unity_camera(projection, outcome.record.rig.eyes[eye].T_V_H, 0.2, 50.0)
            assert each["unity"]["projection"] == unity.projection.tolist()
            assert each["unity"]["view_from_head"] == unity.view_from_head.tolist()
            assert each["openxr"]["position_m"] == pose.position_m.tolist()
            assert each["openxr"]["left_rad"] == fov.left_rad
            assert ("verdict" in each) == (origin == "solved")


def test_a_point_lands_on_the_same_pixel_by_opencv_and_by_opengl(
    tmp_path: Path, outcome: SessionOutcome
) -> None:
    write_calibration_json(tmp_path / "c.json", outcome, 0.1, 100.0)
    found = json.loads((tmp_path / "c.json").read_text())["eyes"]["left"]
    each = found["calibrations"]["set by hand"]
    x, y, z = 0.03, -0.02, 0.5
    u, v, depth = np.array(each["opencv"]["P"]) @ [x, y, z, 1.0]
    clip_x, clip_y, _, clip_w = np.array(each["opengl"]["projection"]) @ [x, -y, -z, 1.0]
    pixel = [
        (clip_x / clip_w + 1.0) / 2.0 * found["width_px"] - 0.5,
        (1.0 - clip_y / clip_w) / 2.0 * found["height_px"] - 0.5,
    ]
    np.testing.assert_allclose(pixel, [u / depth, v / depth], rtol=1e-9)


def test_what_openxr_cannot_express_is_null_with_the_reason(
    tmp_path: Path, record: SessionRecord
) -> None:
    skewed = np.array([[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    eyes = {eye: replace(display, H0=skewed) for eye, display in record.rig.eyes.items()}
    rig = Rig("skewed", eyes, record.rig.T_H_D, record.rig.depth_intrinsics)
    write_calibration_json(tmp_path / "c.json", load_outcome(replace(record, rig=rig)), 0.1, 10.0)
    each = json.loads((tmp_path / "c.json").read_text())["eyes"]["right"]["calibrations"]["solved"]
    assert each["openxr"] is None
    assert "skew" in each["openxr_reason"]


def test_without_alignments_it_is_the_offline_calibration(
    tmp_path: Path, empty: SessionRecord
) -> None:
    outcome = load_outcome(empty)
    write_calibration_json(tmp_path / "c.json", outcome, 0.1, 10.0)
    write_calibration_yaml(tmp_path / "c.yaml", outcome)
    data = json.loads((tmp_path / "c.json").read_text())
    assert data["eyes"]["left"]["final"] == "offline"
    assert data["solved_eye_distance_m"] is None
    storage = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("left").getNode("shift_m").mat().tolist() == [[0.0], [0.0], [0.0]]
