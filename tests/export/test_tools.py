"""The files for single tools, read back by the rules of each tool's own loader."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handcal.cli.main import main
from handcal.core.conventions import slicer_points_mm
from handcal.core.errors import FileError
from handcal.core.geometry import invert, project, transform
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.export.clouds import write_clouds
from handcal.export.export import ExportSettings, export_session
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.tools import write_openxr, write_slicer, write_unity
from handcal.session.session import SessionRecord

POINTS_H_M = np.array([[0.02, 0.06, 0.4], [-0.05, 0.12, 0.6], [0.06, 0.25, 2.0]])
UP = np.diag([1.0, -1.0, -1.0])  # OpenGL's axes from OpenCV's


def wanted_px(outcome: SessionOutcome, eye: Eye) -> Float64:
    T_V_H = outcome.record.rig.eyes[eye].T_V_H
    P = outcome.projection(eye).P
    return project(P, transform(T_V_H, POINTS_H_M))


def pixels(outcome: SessionOutcome, eye: Eye, u: Float64, v: Float64) -> Float64:
    """Return pixels from shares of the display, v down."""
    display = outcome.record.rig.eyes[eye]
    return np.column_stack([u * display.width_px - 0.5, v * display.height_px - 0.5])


def test_unity_draws_each_point_on_its_pixel(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_unity(tmp_path / "unity.json", outcome, 0.1, 50.0)
    data = json.loads((tmp_path / "unity.json").read_text())
    points = np.column_stack([POINTS_H_M * [1.0, -1.0, 1.0], np.ones(3)])  # Unity's y is up
    for eye in EYES:
        # JsonUtility reads float[] only, and Matrix4x4's index runs down its columns.
        assert all(isinstance(one, float) for one in data[eye]["projection"])
        clip = np.array(data[eye]["projection"], dtype=np.float32).reshape(4, 4).T
        view = np.array(data[eye]["viewFromHead"], dtype=np.float32).reshape(4, 4).T
        x, y, _, w = (clip @ view @ points.T.astype(np.float32)).astype(np.float64)
        found = pixels(outcome, eye, (x / w + 1.0) / 2.0, (1.0 - y / w) / 2.0)
        np.testing.assert_allclose(found, wanted_px(outcome, eye), atol=2e-3)
        assert data[eye]["focusDistanceM"] == outcome.record.rig.eyes[eye].z_C0_S_m


def test_openxr_view_draws_each_point_on_its_pixel(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_openxr(tmp_path / "openxr.json", outcome)
    views = json.loads((tmp_path / "openxr.json").read_text())["views"]
    assert [view["eye"] for view in views] == list(EYES)
    for eye, view in zip(EYES, views, strict=True):
        turn = Rotation.from_quat([view["pose"]["orientation"][axis] for axis in "xyzw"])
        eye_m = np.array([view["pose"]["position"][axis] for axis in "xyz"])
        seen = turn.inv().apply(POINTS_H_M @ UP - eye_m)
        edge = {side: np.tan(angle) for side, angle in view["fov"].items()}
        x, y = seen[:, 0] / -seen[:, 2], seen[:, 1] / -seen[:, 2]
        u = (x - edge["angleLeft"]) / (edge["angleRight"] - edge["angleLeft"])
        v = (edge["angleUp"] - y) / (edge["angleUp"] - edge["angleDown"])
        np.testing.assert_allclose(pixels(outcome, eye, u, v), wanted_px(outcome, eye), atol=1e-6)


def test_openxr_refuses_a_skewed_projection(tmp_path: Path, record: SessionRecord) -> None:
    skewed = np.array([[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    eyes = {eye: replace(display, H0=skewed) for eye, display in record.rig.eyes.items()}
    rig = Rig("skewed", eyes, record.rig.T_H_D, record.rig.depth_intrinsics)
    with pytest.raises(FileError, match=r"skew or rotation .left eye.; export json"):
        write_openxr(tmp_path / "openxr.json", load_outcome(replace(record, rig=rig)))


def test_every_cloud_and_pose_says_what_was_simulated(
    tmp_path: Path, record: SessionRecord
) -> None:
    for headset, expected in (("virtual", True), ("network", False)):
        settings = {**record.settings, "station": {"source": "realsense", "headset": headset}}
        outcome = load_outcome(replace(record, settings=settings))
        write_slicer(tmp_path / headset, outcome)
        write_clouds(tmp_path / headset, outcome)
        files = list((tmp_path / headset).iterdir())
        assert {path.suffix for path in files} == {".tfm", ".vtk", ".ply"}
        for path in files:
            told = b"simulated: headset and wearer" in path.read_bytes()[:200]
            assert told == expected, path.name


def read_itk(path: Path) -> Float64:
    """Return Slicer's transform to parent, in RAS, as it reads an ITK affine file."""
    lines = path.read_text().splitlines()
    assert lines[0] == "#Insight Transform File V1.0"
    fields = dict(line.split(": ", 1) for line in lines if not line.startswith("#"))
    assert fields["Transform"] == "AffineTransform_double_3_3"
    numbers = [float(word) for word in fields["Parameters"].split()]
    assert [float(word) for word in fields["FixedParameters"].split()] == [0.0, 0.0, 0.0]
    from_parent = np.eye(4)
    from_parent[:3, :3] = np.reshape(numbers[:9], (3, 3))
    from_parent[:3, 3] = numbers[9:]
    lps = np.diag([-1.0, -1.0, 1.0, 1.0])
    return invert(lps @ from_parent @ lps)


def read_vtk(path: Path) -> tuple[Float64, NDArray[np.int32]]:
    """Return points and vertices of a legacy VTK file in RAS."""
    data = path.read_bytes()
    head, rest = data.split(b" double\n", 1)
    *lines, points = head.decode().splitlines()
    assert lines[0] == "# vtk DataFile Version 3.0"
    assert lines[1].endswith(". SPACE=RAS")  # Slicer looks for it in the whole line
    assert lines[2:] == ["BINARY", "DATASET POLYDATA"]
    count = int(points.removeprefix("POINTS "))
    cloud = np.frombuffer(rest, ">f8", 3 * count).reshape(-1, 3)
    line, cells = rest[24 * count + 1 :].split(b"\n", 1)
    assert line == f"VERTICES {count} {2 * count}".encode()
    return cloud, np.frombuffer(cells, ">i4", 2 * count).reshape(-1, 2)


def test_slicer_finds_eyes_and_clouds(tmp_path: Path, outcome: SessionOutcome) -> None:
    write_slicer(tmp_path, outcome)
    for eye in EYES:
        display = outcome.record.rig.eyes[eye]
        T = read_itk(tmp_path / f"{eye.capitalize()}EyeToHead.tfm")
        P_H = outcome.projection(eye).P @ display.T_V_H
        eye_H_m = -np.linalg.solve(P_H[:, :3], P_H[:, 3])
        np.testing.assert_allclose(T[:3, 3], slicer_points_mm(eye_H_m), atol=1e-9)
        ahead_H = display.T_V_H[:3, :3].T @ [0.0, 0.0, 1.0]  # anterior of the eye's frame
        np.testing.assert_allclose(T[:3, 1], slicer_points_mm(ahead_H) / 1e3, atol=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    for number, alignment in outcome.record.alignments.items():
        for kind, points_m in (("hand", alignment.hand_m), ("cursor", alignment.cursor_m)):
            cloud, cells = read_vtk(tmp_path / f"alignment-{number}-{kind}.vtk")
            np.testing.assert_allclose(
                cloud, 1e3 * points_m[:, [0, 2, 1]] * [1.0, 1.0, -1.0], atol=1e-9
            )
            assert np.array_equal(cells[:, 1], np.arange(len(points_m)))
            assert (cells[:, 0] == 1).all()


def test_they_are_written_only_if_named(
    tmp_path: Path, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = ExportSettings()
    assert not {"unity", "openxr", "northstar", "slicer"} & set(settings.formats)
    words = [f"--format={name}" for name in ("unity", "openxr", "northstar", "slicer")]
    words = ["handcal", "export", str(record.path), *words, f"--output={tmp_path}"]
    monkeypatch.setattr("sys.argv", words)
    main()
    written = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert written == {
        "unity.json", "openxr.json", "northstar.json", "northstar_mesh.json",
        "slicer/LeftEyeToHead.tfm", "slicer/RightEyeToHead.tfm", *(
            f"slicer/alignment-{number}-{kind}.vtk"
            for number in record.alignments for kind in ("hand", "cursor")
        ),
    }  # fmt: skip
    again = export_session(record, tmp_path, ExportSettings(("slicer",)))
    assert len(again) == 2 + 2 * len(record.alignments)
