"""Frames from image files, good and bad."""

from __future__ import annotations

import json
import time
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from handcal.camera.images import read_frame
from handcal.core.errors import FileError

INTRINSICS = {
    "width": 40,
    "height": 30,
    "fx": 35.5,
    "fy": 36,
    "cx": 19.5,
    "cy": 14.5,
    "depth_scale": 0.00025,
}
DEPTH = np.arange(1200, dtype=np.uint16).reshape(30, 40) * 50
COLOR = np.random.default_rng(0).integers(0, 255, (30, 40, 3), np.uint8)


def write(path: Path, image: np.ndarray[Any, Any]) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    intrinsics = tmp_path / "intrinsics.json"
    intrinsics.write_text(json.dumps(INTRINSICS))
    color = write(tmp_path / "color.png", COLOR[..., ::-1])
    return color, write(tmp_path / "depth.png", DEPTH), intrinsics


def test_frame_holds_what_the_files_hold(files: tuple[Path, Path, Path]) -> None:
    frame = read_frame(*files)
    np.testing.assert_array_equal(frame.depth, DEPTH)
    np.testing.assert_array_equal(frame.color, COLOR)
    camera = frame.depth_intrinsics
    assert (camera.width, camera.height, camera.fx, camera.cy) == (40, 30, 35.5, 14.5)
    assert frame.color_intrinsics == camera
    assert frame.depth_scale_m == 0.00025
    np.testing.assert_array_equal(frame.T_C_D, np.eye(4))


def test_jpeg_color_is_read(files: tuple[Path, Path, Path]) -> None:
    smooth = np.full((30, 40, 3), (10, 120, 240), np.uint8)
    jpeg = write(files[0].with_suffix(".jpg"), smooth[..., ::-1])
    frame = read_frame(jpeg, *files[1:])
    assert frame.color is not None
    np.testing.assert_allclose(frame.color, smooth, atol=4)


@pytest.mark.parametrize(("color", "depth"), [("c.tiff", "d.tiff"), ("c.bmp", "d.pgm")])
def test_other_kinds_of_images_are_read(
    files: tuple[Path, Path, Path], color: str, depth: str
) -> None:
    folder = files[0].parent
    write(folder / color, COLOR[..., ::-1])
    frame = read_frame(folder / color, write(folder / depth, DEPTH), files[2])
    np.testing.assert_array_equal(frame.depth, DEPTH)
    np.testing.assert_array_equal(frame.color, COLOR)


@pytest.mark.parametrize("missing", range(3))
def test_missing_file_is_named(files: tuple[Path, Path, Path], missing: int) -> None:
    files[missing].unlink()
    with pytest.raises(FileError, match=f"cannot read .*{files[missing].name}"):
        read_frame(*files)


@pytest.mark.parametrize(
    "image", [DEPTH.astype(np.uint8), np.repeat(DEPTH[..., None], 3, axis=2)], ids=["8bit", "rgb"]
)
def test_depth_must_be_16_bit_grey(
    files: tuple[Path, Path, Path], image: np.ndarray[Any, Any]
) -> None:
    write(files[1], image)
    with pytest.raises(FileError, match="16-bit image of one channel"):
        read_frame(*files)


@pytest.mark.parametrize(("which", "image"), [(0, COLOR[:20]), (1, DEPTH[:, :20])])
def test_sizes_must_agree(
    files: tuple[Path, Path, Path], which: int, image: np.ndarray[Any, Any]
) -> None:
    write(files[which], np.ascontiguousarray(image))
    with pytest.raises(FileError, match=r"pixels, but its camera's intrinsics say 40x30"):
        read_frame(*files)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fx", None),
        ("fx", "500"),
        ("fx", True),
        ("fx", 0),
        ("fy", float("nan")),
        ("cx", 1e9),
        ("cy", [1]),
        ("width", 40.5),
        ("width", -1),
        ("height", 10**9),
        ("depth_scale", 0),
        ("depth_scale", 1.0),
    ],
)
def test_nonsense_intrinsics_are_refused(
    files: tuple[Path, Path, Path], key: str, value: object
) -> None:
    files[2].write_text(json.dumps(INTRINSICS | {key: value}))
    with pytest.raises(FileError, match=rf"intrinsics\.json.*{key}"):
        read_frame(*files)


def png_header(width: int, height: int) -> bytes:
    chunk = b"IHDR" + width.to_bytes(4) + height.to_bytes(4) + bytes([16, 0, 0, 0, 0])
    return b"\x89PNG\r\n\x1a\n" + (13).to_bytes(4) + chunk + zlib.crc32(chunk).to_bytes(4)


def test_huge_image_is_refused_before_it_is_decoded(files: tuple[Path, Path, Path]) -> None:
    files[1].write_bytes(png_header(60_000, 60_000))
    with pytest.raises(FileError, match="60000x60000 pixels, more than is allowed"):
        read_frame(*files)


def test_a_png_that_unpacks_to_gigabytes_is_refused_at_once(files: tuple[Path, Path, Path]) -> None:
    packer = zlib.compressobj(9)
    first, again = (
        packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2)
    )
    packed = first + 79 * again + packer.flush()
    assert len(packed) > 2**20
    chunk = b"IDAT" + packed
    bomb = len(packed).to_bytes(4) + chunk + zlib.crc32(chunk).to_bytes(4)
    files[1].write_bytes(png_header(640, 480) + bomb + bytes(4) + b"IEND\xaeB`\x82")
    start_s = time.process_time()
    with pytest.raises(FileError, match="unpacks to more than its 640x480 pixels"):
        read_frame(*files)
    assert time.process_time() - start_s < 1.0


@given(data=st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_images_give_one_error(files: tuple[Path, Path, Path], data: st.DataObject) -> None:
    whole = cv2.imencode(data.draw(st.sampled_from([".png", ".jpg"])), COLOR)[1].tobytes()
    keep = data.draw(st.integers(0, 40))
    damaged = files[0].with_name("damaged")
    damaged.write_bytes(whole[:keep] + data.draw(st.binary(max_size=40)))
    with pytest.raises(FileError, match="damaged"):
        read_frame(damaged, *files[1:])
