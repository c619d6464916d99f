"""A page to print at its true size, with a ruler to check the print with."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.types import Float64
from handcal.io.files import require_suffix, write_atomic

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
_INCH_M = 0.0254
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
        One line of text.
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
    # Imported late: matplotlib is slow to import, and the commands' options need only PAPERS.
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    page_m = _page(size_m, paper)
    origin_m = (page_m - size_m - [0.0, _CAPTION_M]) / 2
    black_m = [*(rectangles_m + np.tile(origin_m, 2)), *_ruler(page_m)]
    figure = Figure(figsize=tuple(page_m / _INCH_M))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, page_m[0]), ylim=(page_m[1], 0))
    axes.set_axis_off()
    patches = [Rectangle((x0, y0), x1 - x0, y1 - y0) for x0, y0, x1, y1 in black_m]
    axes.add_collection(PatchCollection(patches, facecolor="black", linewidth=0))
    text = f"{caption}. Print at 100 %; the ruler is 100 mm long."
    axes.text(_EDGE_M + _RULER_M + 0.005, page_m[1] - _EDGE_M, text, fontsize=8, parse_math=False)
    data = BytesIO()
    figure.savefig(data, format="pdf", metadata={"CreationDate": None})
    write_atomic(path, data.getvalue())


def _page(size_m: Float64, paper: Paper) -> Float64:
    """Return the page's width and height, in the orientation in which the print fits."""
    if paper not in PAPERS:
        raise ValueError(f"unknown paper {paper}; choose from {', '.join(PAPERS)}")
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
