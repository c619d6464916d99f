import contextlib
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.errors import FileError
from handcal.core.types import (
    EYES,
    RIG_PARTS,
    CameraIdentity,
    DepthCheck,
    HeadsetIdentity,
    HeadsetView,
    Origin,
    Rig,
)
from handcal.rig.example import example_rig
from handcal.rig.plausible import check_rig
from handcal.rig.rig_file import MAX_RIG_BYTES, read_rig, write_rig
from tests.rig.any_rig import RIGS


def assert_equal(a: Any, b: Any, atol: float = 0.0, name: str = "rig") -> None:
    """Compare two values field by field, with numbers equal within `atol`."""
    if dataclasses.is_dataclass(a):
        for field in dataclasses.fields(a):
            ours, theirs = getattr(a, field.name), getattr(b, field.name)
            assert_equal(ours, theirs, atol, f"{name}.{field.name}")
    elif isinstance(a, Mapping):
        assert isinstance(b, Mapping)
        assert set(a) == set(b), name
        for key in a:
            assert_equal(a[key], b[key], atol, f"{name}.{key}")
    elif isinstance(a, np.ndarray):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=atol, err_msg=name)
    else:
        assert a == b, name


@given(RIGS)
@settings(deadline=None)
def test_a_rig_comes_back_exactly(tmp_path_factory: pytest.TempPathFactory, rig: Rig) -> None:
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    write_rig(path, rig)
    assert_equal(read_rig(path), rig)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    write_rig(path, example_rig())
    return path


def test_opencv_itself_reads_the_file(path: Path) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    K = storage.getNode("right").getNode("model").getNode("K").mat()
    storage.release()
    assert np.array_equal(K, example_rig().eyes["right"].K)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("%YAML", "#", "not a YAML file as OpenCV and handcal write it"),
        ("handcal_rig: 3", "other: 3", "handcal_rig must be a whole number"),
        ("left:", "links:", "left must be a map"),
        ("      H0:", "      H1:", r"left\.model\.H0 must be a 3×3 opencv-matrix of type d"),
        ("rows: 3", "rows: 1000000000", r"left\.model\.K must be a 3×3"),
        ("2456.,", "-2456.,", r"left\.K .* positive focal lengths"),
        ("z_C0_S_m: 2.", "z_C0_S_m: two", r"left\.model\.z_C0_S_m must be a number"),
        (
            '"homography"',
            '"spline"',
            "the display model 'spline' is not known, only 'homography': ",
        ),
        (
            'serial_number: ""',
            'serial_number: "1\\t2"',
            r"depth_camera\.serial_number must be one l",
        ),
        ("width_px: 1280", "width_px: 0", "depth_camera: width_px"),
        ("distortion: []", "distortion: [ 0.1 ]", r"depth_camera\.distortion must hold"),
    ],
)
def test_a_bad_field_is_named(path: Path, old: str, new: str, problem: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=f"{path.name}: {problem}"):
        read_rig(path)


@pytest.mark.parametrize("content", ["%YAML 1.2\n---\n[", "%YAML", "%YAML\0", "%YAML 1.2\n---\n"])
def test_garbage_is_a_file_error(path: Path, content: str) -> None:
    path.write_text(content)
    with pytest.raises(FileError, match=path.name):
        read_rig(path)


def test_the_deepest_nesting_that_fits_does_not_overflow_the_parser(path: Path) -> None:
    head = "%YAML 1.2\n---\nA: "
    path.write_text(head + "[" * (MAX_RIG_BYTES - len(head)))
    with pytest.raises(FileError, match=path.name):
        read_rig(path)


def test_a_file_too_large_or_missing_is_a_file_error(path: Path) -> None:
    path.write_text(path.read_text() + "#" * MAX_RIG_BYTES)
    with pytest.raises(FileError, match="larger than"):
        read_rig(path)
    path.unlink()
    with pytest.raises(FileError, match="cannot read"):
        read_rig(path)


@given(st.data())
@settings(deadline=None, max_examples=300)
def test_damaged_bytes_give_a_plausible_rig_or_a_file_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    write_rig(path, data.draw(st.sampled_from([example_rig(), FULL])))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(start, min(start + 20, len(content))))
        content[start:end] = data.draw(st.binary(max_size=4))
    path.write_bytes(content)
    with contextlib.suppress(FileError):
        check_rig(read_rig(path))


@pytest.mark.parametrize("version", [0, 2, 4])
def test_another_version_is_refused_in_one_line(path: Path, version: int) -> None:
    path.write_text(path.read_text().replace("handcal_rig: 3", f"handcal_rig: {version}", 1))
    with pytest.raises(FileError) as refused:
        read_rig(path)
    assert str(refused.value) == (
        f"{path}: the rig's version is {version}, not 3: use the handcal that wrote this file, or "
        "calibrate the rig again"
    )


def test_unknown_fields_are_ignored(path: Path) -> None:
    text = path.read_text()
    rig = read_rig(path)
    path.write_text(text + "more:\n   K: 1\n   list: [ 1, two ]\n")
    assert_equal(rig, read_rig(path))


CHECK = DepthCheck(
    made="2026-11-23T01:00:00+00:00",
    views=12,
    scale=1.002,
    offset_m=-0.001,
    covariance=np.array([[1e-6, -4e-7], [-4e-7, 2e-7]]),
    ranges_m=np.array([[0.3, 0.5], [0.5, 0.8]]),
    flatness_m=np.array([0.0011, 0.0023]),
    flatness_sigma_m=np.array([0.0001, 0.0003]),
)
HEADSET = HeadsetIdentity(
    "0a1b2c",
    name="Ward 3",
    runtime="Unity OpenXR 1.10",
    app="handcal 2",
    protocol=2,
    views={"left": HeadsetView(np.eye(4), np.array([-0.5, 0.4, -0.3, 0.3]), 1268, 720)},
    eye_distance_m=0.0631,
    moves_views=True,
)
FULL = dataclasses.replace(
    example_rig(),
    depth_camera=CameraIdentity("Intel RealSense D415", "817512071792", "5.16.0.1"),
    headset=HEADSET,
    depth_check=CHECK,
    origins={
        part: Origin("grid", "today", 3, 0.2, "good", "so it is", ("x_m",), np.eye(1))
        for part in RIG_PARTS
    },
)


def test_a_rig_of_which_everything_is_known_comes_back_exactly(path: Path) -> None:
    write_rig(path, FULL)
    assert_equal(read_rig(path), FULL)
    views = dict.fromkeys(EYES, HEADSET.views["left"])
    headset = dataclasses.replace(HEADSET, views=views, eye_distance_m=None, name="", app="")
    twenty = np.arange(40).reshape(20, 2) / 40
    check = dataclasses.replace(
        CHECK, ranges_m=twenty, flatness_m=np.zeros(20), flatness_sigma_m=np.ones(20) / 7
    )
    largest = dataclasses.replace(FULL, headset=headset, depth_check=check)
    write_rig(path, largest)
    assert path.stat().st_size < 0.75 * MAX_RIG_BYTES
    assert_equal(read_rig(path), largest)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"817512071792"', "817512071792", r"depth_camera\.serial_number must be a text"),
        ('"0a1b2c"', '"0a1b2g"', r"headset\.device_id must be 1 to 128 hexadecimal digits"),
        ("protocol: 2", "protocol: -2", r"headset\.protocol must lie between 0 and 65535"),
        ("eye_distance_m: 0.06", "eye_distance_m: 0.6", r"headset\.eye_distance_m must lie"),
        ("-0.5, 0.4", "0.5, 0.4", r"headset\.left\.tangents must be left, right, up and down"),
        ("scale: 1.002", "scale: 0.1", r"depth_check\.scale must lie"),
        ("views: 12", "views: 0", r"depth_check\.views must be above 0"),
        (
            "rows: 2\n      cols: 4",
            "rows: 200\n      cols: 4",
            r"depth_check\.flatness must be a N×4",
        ),
    ],
)
def test_a_bad_field_of_what_may_be_known_is_named(
    path: Path, old: str, new: str, problem: str
) -> None:
    write_rig(path, FULL)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=problem):
        read_rig(path)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"ranges_m": -CHECK.ranges_m[::-1, ::-1]}, "1 to 20 ranges of depth, ascending"),
        ({"flatness_m": np.array([0.001, -0.001])}, "flatness must be at least 0 and below 1"),
        ({"covariance": np.array([[1.0, 0.0], [0.5, 1.0]])}, "must be finite and symmetric"),
    ],
)
def test_an_implausible_depth_check_is_not_written(
    path: Path, changes: dict[str, object], problem: str
) -> None:
    check = dataclasses.replace(CHECK, **changes)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=problem):
        write_rig(path, dataclasses.replace(example_rig(), depth_check=check))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"views": 0}, r"origins\.left\.views must be above 0"),
        ({"reason": "two\nlines"}, r"origins\.left\.reason must be one line"),
        ({"parameters": (), "covariance": np.empty((0, 0))}, "parameters must hold 1 to"),
        ({"covariance": [[-1.0]]}, "variances that are not negative"),
    ],
)
def test_an_implausible_origin_is_named(
    path: Path, changes: dict[str, object], problem: str
) -> None:
    origin = Origin("grid", "today", 3, 0.2, "good", "so it is", ("x_m",), np.eye(1))
    changed = dataclasses.replace(origin, **changes)  # type: ignore[arg-type]
    rig = dataclasses.replace(example_rig(), origins={"left": changed})
    with pytest.raises(ValueError, match=problem):
        write_rig(path, rig)


def test_an_implausible_rig_is_not_written(path: Path) -> None:
    before = path.read_bytes()
    with pytest.raises(ValueError, match="T_H_D"):
        write_rig(path, dataclasses.replace(example_rig(), T_H_D=np.zeros((4, 4))))
    assert path.read_bytes() == before
