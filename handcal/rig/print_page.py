"""A page to print at its true size, with a ruler to check the print with."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from handcal.io.files import require_suffix, write_atomic
from handcal.types import Float64

Paper: TypeAlias = Literal["a4", "a3", "a2", "a1", "a0", "letter", "tabloid"]
# Width and height in metres, upright.
PAPERS: dict[Paper, tuple[float, float]] = {
    "a4": (0.210, 0.297),
    "a3": (0.297, 0.420),
    "a2": (0.420, 0.594),
    "a1": (0.594, 0.841),
    "a0": (0.841, 1.189),
    "letter": (0.2159, 0.2794),
    "tabloid": (0.2794, 0.4318),
}
_POINTS_PER_M = 72 / 0.0254
_EDGE_M = 0.005  # margin outside the printable area
_RULER_M, _CAPTION_M = 0.1, 0.012


def write_page(
    path: Path, size_m: Float64, rectangles_m: Float64, caption: str, paper: Paper
) -> None:
    """Write a PDF page with the print in its middle, and a ruler and a caption below.

    Parameters
    ----------
    path : Path
    size_m : (2,) float64
        Width and height of the print.
    rectangles_m : (N, 4) float64
        Black rectangles: left, top, right, bottom, from the upper left corner of the print.
    caption : str
        ASCII without parentheses: PDF's plain text.
    paper : Paper
        Used in landscape if necessary.

    Raises
    ------
    ValueError
        If it does not fit on the paper.
    FileError
        If `path` does not end in ``.pdf``, or cannot be written.
    """
    require_suffix(path, ".pdf")
    page_m = _page(size_m, paper)
    origin_m = (page_m - size_m - [0.0, _CAPTION_M]) / 2
    black_m = [*(rectangles_m + np.tile(origin_m, 2)), *_ruler(page_m)]
    drawn = "\n".join(_pdf_rectangle(rectangle, page_m[1]) for rectangle in black_m)
    x, y = _points(np.array([_EDGE_M + _RULER_M + 0.005, _EDGE_M]))
    text = f"{caption}. Print at 100 %; the ruler is 100 mm long."
    words = f"BT /F1 8 Tf {x:.3f} {y:.3f} Td ({text}) Tj ET"
    write_atomic(path, _pdf(_points(page_m), f"{drawn}\n{words}\n".encode("ascii")))


def _page(size_m: Float64, paper: Paper) -> Float64:
    """Return the page's width and height, in the orientation in which the print fits."""
    if paper not in PAPERS:
        raise ValueError(f"no paper {paper}; there is {', '.join(PAPERS)}")
    needed_m = size_m + 2 * _EDGE_M + [0.0, _CAPTION_M]
    upright = np.array(PAPERS[paper])
    for page_m in (upright, upright[::-1]):
        if (needed_m <= page_m).all():
            return page_m
    width_mm, height_mm = 1e3 * needed_m
    raise ValueError(
        f"with its margins this takes {width_mm:.0f}×{height_mm:.0f} mm, more than {paper} has"
    )


def _ruler(page_m: Float64) -> Float64:
    """Return a line of exactly 100 mm at the lower left, with a tick every 10 mm."""
    bottom = page_m[1] - _EDGE_M
    line = [_EDGE_M, bottom - 0.0003, _EDGE_M + _RULER_M, bottom]
    places = np.linspace(_EDGE_M, _EDGE_M + _RULER_M - 0.0002, 11)
    ticks = [[place, bottom - 0.004, place + 0.0002, bottom] for place in places]
    return np.array([line, *ticks])


def _points(lengths_m: Float64) -> Float64:
    return lengths_m * _POINTS_PER_M


def _pdf_rectangle(rectangle_m: Float64, page_height_m: float) -> str:
    """Return PDF operators for a filled rectangle; the page's y axis points up."""
    left, top, right, bottom = rectangle_m
    x, y = _points(np.array([left, page_height_m - bottom]))
    width, height = _points(np.array([right - left, bottom - top]))
    return f"{x:.4f} {y:.4f} {width:.4f} {height:.4f} re f"


def _pdf(size_points: Float64, content: bytes) -> bytes:
    """Return a PDF file of one page (ISO 32000-1, 7.5)."""
    width, height = size_points
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        b"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 %.4f %.4f] /Contents 5 0 R "
        b"/Resources << /Font << /F1 4 0 R >> >> >>" % (width, height),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
    ]
    data, offsets = b"%PDF-1.4\n", []
    for number, text in enumerate(objects, 1):
        offsets.append(len(data))
        data += b"%d 0 obj\n%s\nendobj\n" % (number, text)
    table = b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    head = b"xref\n0 %d\n0000000000 65535 f \n%s" % (len(objects) + 1, table)
    trailer = b"trailer << /Size %d /Root 1 0 R >>\n" % (len(objects) + 1)
    return data + head + trailer + b"startxref\n%d\n%%%%EOF\n" % len(data)
