"""Image files: untrusted ones are read with their size checked before decoding."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError
from handcal.core.types import UInt8
from handcal.io.files import read_limited, require_suffix, write_atomic

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm")
IMAGE_KINDS = "PNG, JPEG, TIFF, BMP or PGM"
_MAX_FILE_BYTES = 64 * 2**20
MAX_SIDE_PX = 8192
_MAX_PIXELS = 16 * 2**20
PNG_START = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Values of a pixel by the colour type in a PNG's header."""
_MOST_CHUNKS = 65_536
_PIECE_BYTES = 2**20
_HARMLESS_BYTES = 2**20
"""A shorter PNG cannot unpack to more than 1 GB, in about two seconds."""
_JPEG = b"\xff\xd8"
_TIFF = b"II*\x00", b"MM\x00*"
_TIFF_SIDES = ((256, 322), (257, 323))
"""Tags with width and height of the image, and of its tiles, for which memory is taken, too."""
_TIFF_CHANNELS, _MOST_CHANNELS = 277, 4
_PNM = re.compile(rb"P[1-6](?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})(?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})\s")
# Start-of-frame segments, which hold a JPEG's size; C4, C8 and CC among them are something else.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_SEGMENTS = frozenset(range(0xC0, 0xFF)) - set(range(0xD0, 0xDA))
"""Those that begin with their length."""
_JPEG_SCAN = b"\xff\xda"
_MOST_SCANS = 100
"""Each takes time for all pixels, and as little as 60 bytes; usual are up to 12."""


def read_image(path: Path, flags: int) -> NDArray[Any]:
    """Read an image; parameters and errors are those of `decode_image`."""
    return decode_image(read_limited(path, _MAX_FILE_BYTES), path, flags)


def decode_image(data: bytes, name: object, flags: int) -> NDArray[Any]:
    """Decode an image as `cv2.imdecode` with `flags` does, its sizes checked before.

    OpenCV allocates what the header of an image or of a chunk announces, whatever follows.

    Parameters
    ----------
    data : bytes
    name : object
        The image in error messages, such as its path.
    flags : int

    Raises
    ------
    FileError
        If it is damaged, too large or none of `IMAGE_KINDS`.
    """
    width, height = _image_size(data, name)
    if width * height > _MAX_PIXELS or max(width, height) > MAX_SIDE_PX:
        raise FileError(f"{name} is {width}x{height} pixels, more than is allowed")
    if data.startswith(PNG_START):
        chunks = _png_chunks(data, name)
        if len(data) > _HARMLESS_BYTES:
            _require_pixels_only(data, chunks, name, width, height)
    if data.startswith(_JPEG) and data.count(_JPEG_SCAN) > _MOST_SCANS:
        raise FileError(f"{name} has more than {_MOST_SCANS} scans", "save it as a plain JPEG")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise FileError(f"{name} cannot be decoded: {error.err}") from error
    if image is None:
        raise FileError(f"{name} is damaged")
    return image


def read_grey(path: Path) -> UInt8:
    """Read an image as grey, as stored, also of 10 to 16 bits or of floats; raises `read_image`'s.

    More than 8 bits are scaled to the brightest pixel: files do not say how many a camera has.
    """
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    image = read_image(path, flags)
    if image.dtype == np.uint8:
        return image
    values = np.nan_to_num(image.astype(np.float32), posinf=0.0, neginf=0.0)
    return np.asarray(
        np.clip(values * (255.0 / max(float(values.max()), 1e-9)), 0.0, 255.0), np.uint8
    )


def image_named(folder: Path, name: str) -> Path:
    """Return the image of a name in a folder, whatever its kind; of none, that of a PNG."""
    paths = [folder / f"{name}{suffix}" for suffix in IMAGE_SUFFIXES]
    return next((path for path in paths if path.exists()), paths[0])


def write_png(path: Path, image: UInt8) -> None:
    """Write an image, (H, W) grey or (H, W, 3) RGB, atomically.

    Raises
    ------
    FileError
        If `path` does not end in ``.png``, or cannot be written.
    """
    require_suffix(path, ".png")
    write_atomic(path, png_bytes(image))


def png_bytes(image: UInt8) -> bytes:
    """Return an image, (H, W) grey or (H, W, 3) RGB, as `write_png` stores it."""
    stored = image[..., ::-1] if image.ndim == 3 else image
    return cv2.imencode(".png", stored)[1].tobytes()


def _png_chunks(data: bytes, name: object) -> list[tuple[bytes, slice]]:
    """Return type and place of a PNG's chunks; FileError if one announces more than follows."""
    chunks: list[tuple[bytes, slice]] = []
    at = len(PNG_START) - 8
    while at + 12 <= len(data) and len(chunks) < _MOST_CHUNKS:
        content = slice(at + 8, at + 8 + int.from_bytes(data[at : at + 4]))
        chunks.append((data[at + 4 : at + 8], content))
        at = content.stop + 4
        if chunks[-1][0] == b"IEND" and at <= len(data):
            return chunks
    raise FileError(f"{name} is damaged: its parts are not as long or as many as it says")


def _require_pixels_only(
    data: bytes, chunks: Iterable[tuple[bytes, slice]], name: object, width: int, height: int
) -> None:
    """Raise FileError if a PNG unpacks to more than the pixels that its header announces.

    The decoder would unpack all of it, for seconds, after the last pixel.
    """
    values = _PNG_CHANNELS.get(data[25], 0) * data[24]
    # Interlaced rows are shorter, but up to twice as many; each begins with a byte of its own.
    left_bytes = 2 * height * (1 + (width * values + 7) // 8) + width
    unpacker = zlib.decompressobj()
    for packed in (data[content] for kind, content in chunks if kind == b"IDAT"):
        while packed and not unpacker.eof:
            try:
                left_bytes -= len(unpacker.decompress(packed, _PIECE_BYTES))
            except zlib.error:
                return  # the decoder says what is wrong
            if left_bytes < 0:
                raise FileError(f"{name} unpacks to more than its {width}x{height} pixels")
            packed = unpacker.unconsumed_tail


def _image_size(data: bytes, name: object) -> tuple[int, int]:
    """Return the size in an image's header, as its decoder finds it, without decoding it."""
    if data.startswith(PNG_START) and len(data) > len(PNG_START) + 10:
        return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    if data.startswith(_JPEG):
        at = 2
        while at + 9 <= len(data) and data[at] == 0xFF:
            if data[at + 1] in _JPEG_FRAMES:
                return int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
            if data[at + 1] in _JPEG_SEGMENTS:
                at += 1 + int.from_bytes(data[at + 2 : at + 4])
            elif data[at + 1] != 0xFF:  # which only fills
                break
            at += 1
    if data.startswith(b"BM") and len(data) >= 26:
        ends = (20, 22) if data[14] == 12 else (22, 26)  # OS/2's header is shorter
        width, height = (
            int.from_bytes(data[start:end], "little", signed=end == 26)
            for start, end in ((18, ends[0]), (ends[0], ends[1]))
        )
        return width, abs(height)  # negative: the upper row comes first
    if match := _PNM.match(data[:4096]):
        return int(match[1]), int(match[2])
    if data[:4] in _TIFF:
        return _tiff_size(data, name)
    raise FileError(f"{name} is not a {IMAGE_KINDS} image")


def _tiff_size(data: bytes, name: object) -> tuple[int, int]:
    """Return the size of a TIFF's first image, or of its tiles if they are larger."""

    def number(at: int, size: int) -> int:
        return int.from_bytes(data[at : at + size], "little" if data[0] == 0x49 else "big")

    first = number(4, 4)
    tags: dict[int, int] = {}
    for at in range(first + 2, first + 2 + 12 * number(first, 2), 12):
        value = number(at + 8, 2 if number(at + 2, 2) == 3 else 4)
        tags[number(at, 2)] = max(tags.get(number(at, 2), 0), value)
    if tags.get(_TIFF_CHANNELS, 1) > _MOST_CHANNELS:
        raise FileError(f"{name} has {tags[_TIFF_CHANNELS]} channels, more than is allowed")
    width, height = (max(tags.get(tag, 0) for tag in side) for side in _TIFF_SIDES)
    if not width or not height:
        raise FileError(f"{name} is damaged")
    return width, height
