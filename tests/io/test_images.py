import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.io.images import image_named, read_grey, read_image

GREY = np.arange(60 * 40, dtype=np.uint16).reshape(40, 60)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".tiff", ".bmp", ".pgm", ".ppm"])
def test_an_image_comes_back_whatever_its_kind(tmp_path: Path, suffix: str) -> None:
    image = np.dstack([GREY % 251] * 3).astype(np.uint8)
    cv2.imwrite(str(tmp_path / f"a{suffix}"), image[..., 0] if suffix == ".pgm" else image)
    path = image_named(tmp_path, "a")
    np.testing.assert_array_equal(read_image(path, cv2.IMREAD_COLOR), image)
    np.testing.assert_array_equal(read_grey(path), image[..., 0])


@pytest.mark.parametrize("name", ["a.tiff", "a.pgm", "a.png"])
def test_twelve_bits_in_sixteen_are_scaled(tmp_path: Path, name: str) -> None:
    cv2.imwrite(str(tmp_path / name), GREY)
    expected = GREY * (255.0 / GREY.max())
    assert np.abs(read_grey(tmp_path / name) - expected).max() <= 1.0


@pytest.mark.parametrize("scale", [1.0 / GREY.max(), 1.0])
def test_floats_are_scaled(tmp_path: Path, scale: float) -> None:
    values = (scale * GREY).astype(np.float32)
    values[0, 0] = np.nan
    cv2.imwrite(str(tmp_path / "a.tiff"), values)
    expected = GREY * (255.0 / GREY.max())
    assert np.abs(read_grey(tmp_path / "a.tiff") - expected).max() <= 1.0


def _tiff(order: str, tags: dict[int, int]) -> bytes:
    entries = [struct.pack(f"{order}HHII", tag, 4, 1, value) for tag, value in tags.items()]
    start = b"II*\x00" if order == "<" else b"MM\x00*"
    return start + struct.pack(f"{order}IH", 8, len(tags)) + b"".join(entries) + bytes(4)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"P5\n# a comment\n 60000 60000\n255\n", "60000x60000 pixels, more than"),
        (b"P5\n60", "is not a PNG, JPEG, TIFF, BMP or PGM image"),
        (b"BM" + bytes(12) + struct.pack("<Iii", 40, 9000, -9000), "9000x9000 pixels"),
        (_tiff("<", {256: 60000, 257: 60000}), "60000x60000 pixels"),
        (_tiff(">", {256: 60000, 257: 60000}), "60000x60000 pixels"),
        (_tiff("<", {256: 8, 257: 8, 322: 2**24, 323: 64}), "16777216x64 pixels"),
        (_tiff("<", {256: 8, 257: 8, 277: 500}), "500 channels"),
        (_tiff("<", {256: 8}), "is damaged"),
        (_tiff("<", {256: 8, 257: 8}), "is damaged|cannot be decoded"),
        (b"II*\x00\xff\xff\xff\xff", "is damaged"),
        (b"GIF89a", "is not a PNG"),
    ],
)
def test_size_is_checked_before_decoding(tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / "image").write_bytes(data)
    with pytest.raises(FileError, match=said):
        read_image(tmp_path / "image", cv2.IMREAD_GRAYSCALE)


def test_the_field_images_are_as_the_png(shared_data: Path) -> None:
    for number in (0, 1):
        png = read_grey(shared_data / "field/bent_board/flat" / f"view0{number}.png")
        for suffix in ("tiff", "bmp", "pgm"):
            path = shared_data / "field/image_formats" / f"v{number}.{suffix}"
            np.testing.assert_array_equal(read_grey(path), png)
