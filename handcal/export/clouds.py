"""The clouds of every alignment as PLY files, and clouds from files of any program."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from handcal.core.errors import FileError, HandcalError, extra_advice
from handcal.core.progress import Progress
from handcal.core.types import Bool, Float64
from handcal.export.outcome import SessionOutcome
from handcal.io.files import make_folder, read_limited, write_ply
from handcal.register.solve import MAX_POINTS

_FORMATS = ".ply", ".pcd", ".xyz"
_MAX_CLOUD_BYTES = 256 * 2**20
_POINTS = re.compile(rb"^(?:element vertex|POINTS)\s+(\d{1,18})\s*$", re.MULTILINE)
_HEADER_END = re.compile(rb"^(?:end_header|DATA \w+)\s*?\n", re.MULTILINE)
_PROPERTIES = re.compile(rb"element vertex [^\n]*\n((?:(?:property|comment) [^\n]*\n)*)")
_OTHER_FIRST = re.compile(rb"^element (?!vertex)", re.MULTILINE)
_OVERLONG = re.compile(rb"\S{256}|[^\n]{1000}")  # longer words and lines abort Open3D 0.20
_PLY_BYTES = {
    b"char": 1, b"uchar": 1, b"short": 2, b"ushort": 2, b"int": 4, b"uint": 4,
    b"float": 4, b"double": 8, b"int8": 1, b"uint8": 1, b"int16": 2, b"uint16": 2,
    b"int32": 4, b"uint32": 4, b"float32": 4, b"float64": 8,
}  # fmt: skip


def write_clouds(folder: Path, outcome: SessionOutcome, progress: Progress = Progress()) -> None:
    """Write ``alignment-N-cursor.ply`` and ``alignment-N-hand.ply`` for each alignment.

    Points are doubles in W, in metres; `is_cut` is 1 at a cut edge. The hand's
    `residual_left_m` and `residual_right_m`, where solved, are each point's distance to its
    partner on the cursor, NaN for an outlier. A comment says what was simulated.
    """
    make_folder(folder)
    solved = outcome.results.alignments if outcome.results else {}
    simulated = outcome.record.simulated
    comments = [f"simulated: {simulated}"] if simulated else []
    for done, (number, shifts) in enumerate(solved.items()):
        progress.at(done / len(solved))
        alignment = outcome.record.alignments[number]
        write_ply(
            folder / f"alignment-{number}-cursor.ply",
            alignment.cursor_m,
            properties={"is_cut": alignment.cursor_is_cut.astype(np.uint8)},
            comments=comments,
        )
        residuals_m = {f"residual_{eye}_m": shift.residuals_m for eye, shift in shifts.items()}
        write_ply(
            folder / f"alignment-{number}-hand.ply",
            alignment.hand_m,
            properties={"is_cut": alignment.hand_is_cut.astype(np.uint8)} | residuals_m,
            comments=comments,
        )


def read_cloud(path: str | PathLike[str]) -> tuple[Float64, Bool | None]:
    """Read a cloud that handcal exported or another program made, with Open3D.

    Parameters
    ----------
    path : path
        A .ply, .pcd or .xyz file, in metres.

    Returns
    -------
    points_m : (N, 3) float64
    is_cut : (N,) bool or None
        The file's property `is_cut`, points beside a cut edge; None if it has none.

    Raises
    ------
    FileError
        If the file is missing, malformed, too large or without points.
    HandcalError
        If Open3D is not installed.

    Examples
    --------
    Solve an alignment from its exported clouds, as after editing them:

    >>> import handcal
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from handcal.export.clouds import write_clouds
    >>> from handcal.export.outcome import load_outcome
    >>> session = handcal.example_session()
    >>> with TemporaryDirectory() as folder:
    ...     write_clouds(Path(folder), load_outcome(session))
    ...     cursor_m, cursor_cut = handcal.read_cloud(f"{folder}/alignment-1-cursor.ply")
    ...     hand_m, hand_cut = handcal.read_cloud(f"{folder}/alignment-1-hand.ply")
    >>> shift = handcal.solve_eye_shift(
    ...     cursor_m,
    ...     hand_m,
    ...     display_distance_m=session.rig.eyes["left"].z_C0_S_m,
    ...     T_E_W=session.alignments[1].T_E_W["left"],
    ...     cursor_cut=cursor_cut,
    ...     hand_cut=hand_cut,
    ... )
    >>> print(shift)
    φ = (+5.20 ± 0.92, -4.64 ± 0.54, +3.84 ± 1.99) mm; rms 1.55 mm, 97 % inliers, converged
    """
    path = Path(path)
    if path.suffix.lower() not in _FORMATS:
        raise FileError(f"{path} is not a cloud", f"its name must end in {', '.join(_FORMATS)}")
    data = read_limited(path, _MAX_CLOUD_BYTES)
    table = None if path.suffix.lower() == ".xyz" else _require_all_points(path, data)
    try:
        import open3d
    except ImportError as error:
        raise HandcalError(
            "reading clouds needs Open3D, which is not installed", extra_advice("3d")
        ) from error
    if path.suffix.lower() == ".xyz":
        return _parse_xyz(path, data), None
    if table is not None and path.suffix.lower() == ".ply":
        return _parse_ply(path, data, table)
    try:
        with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
            cloud = open3d.t.io.read_point_cloud(path)
    except RuntimeError as error:
        raise FileError(f"{path} is damaged, or not a cloud of its format") from error
    if "positions" not in cloud.point or not len(cloud.point.positions):
        raise FileError(f"{path} is damaged, or holds no points")
    points_m = _require_plausible(path, cloud.point.positions.numpy().astype(np.float64))
    if "is_cut" not in cloud.point:
        return points_m, None
    return points_m, cloud.point["is_cut"].numpy().ravel() > 0


def _parse_xyz(path: Path, data: bytes) -> Float64:
    """Return the points of an XYZ file.

    Open3D 0.19 drops the last point of a file that ends without a line break, and writes it beyond
    its memory.
    """
    try:
        rows = [line.split()[:3] for line in data.splitlines() if line.strip()]
        points_m = np.array(rows, np.float64).reshape(-1, 3)
    except ValueError as error:
        raise FileError(f"{path} is damaged, or not a cloud of its format") from error
    if not len(points_m):
        raise FileError(f"{path} is damaged, or holds no points")
    return _require_plausible(path, points_m)


def _require_plausible(path: Path, points_m: Float64) -> Float64:
    if len(points_m) > MAX_POINTS or not np.isfinite(points_m).all():
        raise FileError(f"{path} has more than {MAX_POINTS:,} points, or one without a position")
    return points_m


def _parse_ply(path: Path, data: bytes, table: Float64) -> tuple[Float64, Bool | None]:
    """Return points and `is_cut` of a PLY file of text.

    From the first word that is not a number of its type, Open3D 0.20 returns what its memory holds.
    """
    found = _PROPERTIES.search(data)
    names = re.findall(rb"^property +\w+ +(\w+)", found[1], re.MULTILINE) if found else []
    if table.shape[1] != len(names) or not {b"x", b"y", b"z"} <= set(names):
        raise FileError(f"{path} is damaged, or not a cloud of its format")
    points_m = _require_plausible(
        path, table[:, [names.index(axis) for axis in (b"x", b"y", b"z")]]
    )
    return points_m, table[:, names.index(b"is_cut")] > 0 if b"is_cut" in names else None


def _require_all_points(path: Path, data: bytes) -> Float64 | None:
    """Return the numbers of a PLY or PCD file of text, None for a binary one.

    Raises
    ------
    FileError
        If the file ends early or a word of its points is not a number; Open3D would invent points.
    """
    announced, end = _POINTS.search(data), _HEADER_END.search(data)
    if announced is None or end is None or _OVERLONG.search(data, 0, end.end()):
        raise FileError(f"{path} is damaged, or not a cloud of its format")
    if _OTHER_FIRST.search(data, 0, announced.start()):
        raise FileError(f"{path} does not begin with its points")
    count, header, body = int(announced[1]), data[: end.end()], data[end.end() :]
    if count > MAX_POINTS:
        raise FileError(f"{path} announces more than {MAX_POINTS:,} points")
    if b"format ascii" in header or b"DATA ascii" in header:
        return _read_table(path, body.split(b"\n", count)[:count], count)
    if found := _PROPERTIES.search(header):
        kinds = re.findall(rb"^property (\w+)", found[1], re.MULTILINE)
        if len(body) < count * sum(_PLY_BYTES.get(kind, 1) for kind in kinds):
            raise FileError(f"{path} is damaged: it ends before its last point")
    return None  # Open3D sees where a binary PCD file ends


def _read_table(path: Path, rows: list[bytes], count: int) -> Float64:
    """Return rows of numbers."""
    widths = {len(row.split()) for row in rows}
    if len(rows) != count or len(widths) != 1 or 0 in widths:
        raise FileError(f"{path} is damaged: it ends before its last point")
    try:
        return np.loadtxt(rows, ndmin=2, comments=None)
    except ValueError as error:
        raise FileError(f"{path} is damaged: a point has a word that is no number") from error
