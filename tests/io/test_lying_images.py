"""Image files that announce more than they hold."""

from __future__ import annotations

import struct
import time
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.io.images import decode_image, read_image

IMAGE = np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8)
PNG = cv2.imencode(".png", IMAGE)[1].tobytes()
HEADER, REST = PNG[:33], PNG[33:]
JPEG = cv2.imencode(".jpg", IMAGE)[1].tobytes()
SCANS = cv2.imencode(".jpg", IMAGE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
MANY_BYTES = 2**28
"""Enough to be seen, if OpenCV allocates it; 2**32 - 1 is possible."""


def chunk(kind: bytes, content: bytes, size: int | None = None) -> bytes:
    announced = len(content) if size is None else size
    return struct.pack(">I", announced) + kind + content + struct.pack(">I", zlib.crc32(content))


@pytest.mark.parametrize("kind", [b"IDAT", b"tEXt", b"PLTE", b"fdAT", b"abCd"])
@pytest.mark.parametrize("place", ["first", "last"])
def test_a_chunk_longer_than_its_file_is_refused(tmp_path: Path, kind: bytes, place: str) -> None:
    lying = chunk(kind, b"abc", MANY_BYTES)
    path = tmp_path / "lying.png"
    path.write_bytes(HEADER + (lying + REST if place == "first" else REST[:-12] + lying))
    with pytest.raises(FileError, match="not as long or as many as it says"):
        read_image(path, cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize(
    "data",
    [
        PNG[:-1],
        PNG[:-12],
        PNG[: len(PNG) // 2],
        HEADER,
        HEADER + chunk(b"abCd", b"") * 10**5 + REST,
    ],
    ids=["end cut", "no end", "half", "header", "many"],
)
def test_a_png_that_is_cut_short_or_endless_is_refused(data: bytes) -> None:
    with pytest.raises(FileError, match="not as long or as many as it says"):
        decode_image(data, "x", cv2.IMREAD_COLOR)


def test_a_png_with_other_chunks_and_bytes_after_its_end_is_read() -> None:
    data = HEADER + chunk(b"abCd", b"") + chunk(b"tEXt", b"Author\0nobody") + REST + bytes(8)
    np.testing.assert_array_equal(decode_image(data, "x", cv2.IMREAD_UNCHANGED), IMAGE)


def test_a_png_whose_header_is_not_its_first_chunk_is_refused() -> None:
    small_first = PNG[:8] + chunk(b"tEXt", bytes(3) + b"\1" + bytes(3) + b"\1") + PNG[8:]
    with pytest.raises(FileError, match="is not a PNG, JPEG"):
        decode_image(small_first, "x", cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize("before", [b"\xff", b"\xff\xd0", b"\xff\x01"], ids=["fill", "RST", "TEM"])
def test_the_size_of_a_jpeg_is_that_which_its_decoder_finds(before: bytes) -> None:
    frame = JPEG.index(b"\xff\xc0")
    huge = JPEG[2 : frame + 5] + struct.pack(">HH", 16_000, 16_000) + JPEG[frame + 9 :]
    hidden = JPEG[:2] + before + b"\xff\xfe\x00\x04ab" + huge
    at = 4 + int.from_bytes(hidden[4:6])  # whoever takes the first two bytes for a segment
    small = hidden.ljust(at, b"\0") + JPEG[frame : frame + 9]
    with pytest.raises(FileError, match=r"more than is allowed|is not a PNG, JPEG"):
        decode_image(small, "x", cv2.IMREAD_UNCHANGED)


def test_fill_bytes_in_a_jpeg_are_skipped() -> None:
    filled = JPEG[:2] + b"\xff\xff" + JPEG[2:]
    expected = decode_image(JPEG, "x", cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decode_image(filled, "x", cv2.IMREAD_UNCHANGED), expected)


def test_a_jpeg_of_endless_scans_is_refused() -> None:
    assert decode_image(SCANS, "x", cv2.IMREAD_UNCHANGED).shape == IMAGE.shape
    last = SCANS[SCANS.rindex(b"\xff\xda") : -2]
    with pytest.raises(FileError, match="more than 100 scans"):
        decode_image(SCANS[:-2] + 200 * last + SCANS[-2:], "x", cv2.IMREAD_UNCHANGED)


def test_a_png_that_unpacks_to_gigabytes_is_refused_at_once() -> None:
    packer = zlib.compressobj(9)
    first, again = (
        packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2)
    )
    header = chunk(b"IHDR", struct.pack(">IIB", 640, 480, 16) + bytes(4))
    bomb = PNG[:8] + header + chunk(b"IDAT", first + 79 * again + packer.flush()) + REST[-12:]
    start_s = time.process_time()
    with pytest.raises(FileError, match="unpacks to more than its 640x480 pixels"):
        decode_image(bomb, "x", cv2.IMREAD_UNCHANGED)
    assert time.process_time() - start_s < 1.0
