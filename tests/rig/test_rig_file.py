import contextlib
import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.errors import FileError
from handcal.geometry import rigid
from handcal.rig.check import check_rig
from handcal.rig.example import example_rig
from handcal.rig.rig_file import MAX_RIG_BYTES, read_rig, write_rig
from handcal.types import EYES, RIG_PARTS, EyeDisplay, Intrinsics, Origin, Rig

FOCAL = st.floats(1.0, 1e5)
OFFSET = st.floats(-0.05, 0.05)
VECTORS = st.tuples(OFFSET, OFFSET, OFFSET)
TRANSFORMS = st.builds(rigid, st.tuples(*[st.floats(-3, 3)] * 3), VECTORS)
SIDE = st.integers(1, 16384)
DISPLAYS = st.builds(
    EyeDisplay,
    K=st.builds(lambda f, c: np.array([[f, 0, c], [0, f, c], [0, 0, 1]]), FOCAL, OFFSET),
    H0=st.builds(lambda x: np.array([[1 + x, 0, x], [0, 1 - x, x], [0, 0, 1]]), OFFSET),
    t_C0_V_m=VECTORS,
    z_C0_S_m=st.floats(0.1, 100),
    width_px=SIDE,
    height_px=SIDE,
    T_V_H=TRANSFORMS,
)
LINES = st.text(st.characters(categories=["L", "N", "P"]), min_size=1, max_size=40)
ORIGINS = st.builds(
    Origin,
    method=LINES,
    made=st.just("2026-11-21T16:00:00+00:00"),
    views=st.integers(1, 500),
    rms_px=st.floats(0, 10),
    verdict=st.sampled_from(["good", "needs more views", "bad"]),
    reason=LINES,
    parameters=st.just(("x_m", "turn: rad")),
    covariance=st.builds(lambda a, b: np.array([[a, b], [b, a]]), st.floats(0, 1), OFFSET),
)
CHARACTERS = st.characters(categories=["L", "N", "P", "S"], include_characters=" ")
RIGS = st.builds(
    Rig,
    name=st.text(CHARACTERS, min_size=1, max_size=200)
    | st.sampled_from(["true", "null", "12", '"quoted"', "'quoted'", "back\\slash", " end "]),
    eyes=st.fixed_dictionaries({"left": DISPLAYS, "right": DISPLAYS}),
    T_H_D=TRANSFORMS,
    depth_intrinsics=st.builds(
        Intrinsics,
        SIDE,
        SIDE,
        FOCAL,
        FOCAL,
        FOCAL,
        FOCAL,
        distortion=st.sampled_from([0, 4, 5, 8, 12, 14]).flatmap(
            lambda n: st.tuples(*[st.floats(-10, 10)] * n)
        ),
    ),
    origins=st.dictionaries(st.sampled_from(RIG_PARTS), ORIGINS),
)


def assert_equal(a: Rig, b: Rig) -> None:
    assert a.name == b.name
    assert a.depth_intrinsics == b.depth_intrinsics
    assert np.array_equal(a.T_H_D, b.T_H_D)
    assert set(a.origins) == set(b.origins)
    for part, origin in a.origins.items():
        for field in dataclasses.fields(Origin):
            ours, theirs = getattr(origin, field.name), getattr(b.origins[part], field.name)
            assert np.array_equal(ours, theirs), f"{part}.{field.name}"
    for eye in EYES:
        for field in dataclasses.fields(EyeDisplay):
            ours, theirs = getattr(a.eyes[eye], field.name), getattr(b.eyes[eye], field.name)
            assert np.array_equal(ours, theirs), f"{eye}.{field.name}"


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
    K = storage.getNode("right").getNode("K").mat()
    storage.release()
    assert np.array_equal(K, example_rig().eyes["right"].K)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("%YAML", "#", "not a YAML file as OpenCV and handcal write it"),
        ("handcal_rig: 2", "handcal_rig: 3", "rig version 3 is unknown; versions 1 to 2"),
        ("handcal_rig: 2", "other: 2", "handcal_rig must be a whole number"),
        ("name: ", "label: ", "name must be a text"),
        ("left:", "links:", "left must be a map"),
        ("   H0:", "   H1:", r"left\.H0 must be a 3×3 opencv-matrix of type d"),
        ("rows: 3", "rows: 2", r"left\.K must be a 3×3"),
        ("rows: 3", "rows: 1000000000", r"left\.K must be a 3×3"),
        ("dt: d", "dt: f", r"left\.K must be a 3×3 opencv-matrix of type d"),
        ("2456.,", "", r"left\.K must be a 3×3"),
        ("2456.,", "-2456.,", r"left\.K .* positive focal lengths"),
        ("2456.,", ".nan,", r"left\.K .* finite"),
        ("z_C0_S_m: 2.", "z_C0_S_m: two", r"left\.z_C0_S_m must be a number"),
        ("width_px: 1268", "width_px: 1268.5", r"left\.width_px must be a whole number"),
        ("width_px: 1280", "width_px: 0", "depth_camera: width_px"),
        ("distortion: []", "distortion: [ 0.1 ]", r"depth_camera\.distortion must hold"),
        ("distortion: []", "distortion: [ a, b, c, d ]", r"depth_camera\.distortion must be a num"),
        ("distortion: []", "distortion: 1.", r"depth_camera\.distortion must be a list"),
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
    write_rig(path, example_rig())
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(start, min(start + 20, len(content))))
        content[start:end] = data.draw(st.binary(max_size=4))
    path.write_bytes(content)
    with contextlib.suppress(FileError):
        check_rig(read_rig(path))


def test_a_rig_of_version_1_is_read_and_written_as_version_2(path: Path, tmp_path: Path) -> None:
    path.write_text(path.read_text().replace("handcal_rig: 2", "handcal_rig: 1"))
    rig = read_rig(path)
    assert_equal(rig, example_rig())
    assert rig.origins == {}
    write_rig(tmp_path / "new.yaml", rig)
    assert "handcal_rig: 2\n" in (tmp_path / "new.yaml").read_text()
    assert_equal(read_rig(tmp_path / "new.yaml"), rig)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"views": 0}, r"origins\.left\.views must be above 0"),
        ({"rms_px": np.nan}, r"origins\.left\.rms_px must be a number"),
        ({"reason": "two\nlines"}, r"origins\.left\.reason must be one line"),
        ({"parameters": (), "covariance": np.empty((0, 0))}, "parameters must hold 1 to"),
        ({"covariance": [[-1.0]]}, "variances that are not negative"),
        ({"covariance": [[np.inf]]}, r"origins\.left\.covariance must be finite"),
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


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("views: 3", "views: 3.5", r"origins\.left\.views must be a whole number"),
        ('parameters: [ "x_m" ]', "parameters: []", r"parameters must be a list of texts"),
        ('parameters: [ "x_m" ]', "parameters: [ 1 ]", r"parameters must be a list of texts"),
        ('[ "x_m" ]', '[ "x_m", "y_m" ]', r"origins\.left\.covariance must be a 2×2"),
    ],
)
def test_a_bad_field_of_an_origin_is_named(path: Path, old: str, new: str, problem: str) -> None:
    origin = Origin("grid", "today", 3, 0.2, "good", "so it is", ("x_m",), np.eye(1))
    write_rig(path, dataclasses.replace(example_rig(), origins={"left": origin}))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=problem):
        read_rig(path)


def test_an_implausible_rig_is_not_written(path: Path) -> None:
    before = path.read_bytes()
    with pytest.raises(ValueError, match="T_H_D"):
        write_rig(path, dataclasses.replace(example_rig(), T_H_D=np.zeros((4, 4))))
    assert path.read_bytes() == before
