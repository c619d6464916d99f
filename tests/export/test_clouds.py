"""The PLY files, read back to the last bit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from handcal.core.errors import FileError, HandcalError
from handcal.core.progress import Progress
from handcal.export.clouds import read_cloud, write_clouds
from handcal.export.outcome import SessionOutcome

KINDS = {"double": "<f8", "uchar": "u1"}


def read(path: Path) -> NDArray[Any]:
    header, body = path.read_bytes().split(b"end_header\n", 1)
    fields = [line.split()[1:] for line in header.decode().splitlines() if line[:8] == "property"]
    return np.frombuffer(body, [(name, KINDS[kind]) for kind, name in fields])


def test_clouds_and_residuals_come_back(tmp_path: Path, outcome: SessionOutcome) -> None:
    shares: list[float] = []
    write_clouds(tmp_path / "clouds", outcome, Progress(lambda _what, share: shares.append(share)))
    assert shares == [0.0, 0.5]
    assert sorted(path.name for path in (tmp_path / "clouds").iterdir()) == [
        f"alignment-{number}-{which}.ply" for number in (1, 3) for which in ("cursor", "hand")
    ]
    assert outcome.results is not None
    assert list(outcome.record.alignments) == list(outcome.results.alignments) == [1, 3]
    for number, alignment in outcome.record.alignments.items():
        shifts = outcome.results.alignments[number]
        cursor = read(tmp_path / "clouds" / f"alignment-{number}-cursor.ply")
        hand = read(tmp_path / "clouds" / f"alignment-{number}-hand.ply")
        for points, expected_m in ((cursor, alignment.cursor_m), (hand, alignment.hand_m)):
            assert np.array_equal(np.column_stack([points[axis] for axis in "xyz"]), expected_m)
        assert np.array_equal(hand["is_cut"], alignment.hand_is_cut)
        names = [f"residual_{eye}_m" for eye in shifts]
        assert list(hand.dtype.names or ()) == ["x", "y", "z", "is_cut", *names]
        for eye, shift in shifts.items():
            residuals_m = hand[f"residual_{eye}_m"]
            assert np.array_equal(residuals_m, shift.residuals_m, equal_nan=True)


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
def test_a_cloud_written_by_open3d_comes_back(
    suffix: str, tmp_path: Path, outcome: SessionOutcome
) -> None:
    open3d = pytest.importorskip("open3d")
    write_clouds(tmp_path, outcome)
    cloud = open3d.t.io.read_point_cloud(str(tmp_path / "alignment-1-hand.ply"))
    path = tmp_path / f"edited.{suffix}"
    assert open3d.t.io.write_point_cloud(str(path), cloud)
    points_m, is_cut = read_cloud(path)
    alignment = outcome.record.alignments[1]
    assert np.array_equal(points_m, alignment.hand_m)
    assert is_cut is not None
    assert np.array_equal(is_cut, alignment.hand_is_cut)


def test_a_text_of_numbers_is_a_cloud_without_cuts(tmp_path: Path) -> None:
    pytest.importorskip("open3d")
    expected_m = np.random.default_rng(0).normal(size=(50, 3))
    text = "\n".join(" ".join(map(repr, row)) for row in expected_m.tolist())
    (tmp_path / "cloud.xyz").write_text(text)  # Open3D drops a last line without a break
    points_m, is_cut = read_cloud(tmp_path / "cloud.xyz")
    assert points_m == pytest.approx(expected_m, rel=1e-6)
    assert is_cut is None


PLY = b"""ply
format ascii 1.0
element vertex %s
property float x
property float y
property float z
end_header
%s
"""
PCD = b"""VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH 1
HEIGHT 1
POINTS 1
DATA ascii
%s
"""


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.ply", None, "cannot read"),
        ("cloud.stl", b"", "must end in"),
        ("text.ply", b"garbage", "damaged"),
        ("text.pcd", b"x" * 100, "damaged"),
        ("text.xyz", b"hello", "damaged"),
        ("nan.xyz", b"1 2 nan\n3 4 5\n", "without a position"),
        (
            "large.ply",
            b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\n"
            b"property double x\nproperty double y\nproperty double z\nend_header\n",
            "announces more than 2,000,000 points",
        ),
        ("digits.ply", PLY % (b"9" * 5000, b"1 2 3"), "damaged"),
        ("word.ply", b"ply\ncomment " + b"x" * 5000 + PLY[3:] % (b"1", b"1 2 3"), "damaged"),
        ("comma.ply", PLY % (b"1", b"1,5 2 3"), "no number"),
        ("comma.pcd", PCD % b"1,5 2 3", "no number"),
        ("long.ply", PLY % (b"1", b"1" * 400 + b" 2 3"), "without a position"),
        (
            "faces.ply",
            b"ply\nformat ascii 1.0\nelement face 1\nproperty int a"
            + PLY[20:] % (b"1", b"1\n1 2 3"),
            "does not begin with its points",
        ),
        ("wide.ply", PLY % (b"1", b"1 2 3 4"), "damaged"),
        (
            "large.pcd",
            b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\n"
            b"HEIGHT 1\nPOINTS 4000000000\nDATA binary\n",
            "announces more than 2,000,000 points",
        ),
    ],
)
def test_what_is_no_cloud_is_refused_in_one_line(
    name: str, content: bytes | None, message: str, tmp_path: Path
) -> None:
    pytest.importorskip("open3d")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=message) as raised:
        read_cloud(tmp_path / name)
    assert "\n" not in str(raised.value)


def test_a_ply_file_of_text_with_cuts_and_other_properties(tmp_path: Path) -> None:
    pytest.importorskip("open3d")
    header = PLY.replace(b"end_header", b"property uchar is_cut\nproperty float r\nend_header")
    (tmp_path / "a.ply").write_bytes(header % (b"2", b"1 2 3 1.0 nan\n4 5 6 0 0.1"))
    points_m, is_cut = read_cloud(tmp_path / "a.ply")
    assert points_m.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert is_cut is not None
    assert is_cut.tolist() == [True, False]


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
@pytest.mark.parametrize("is_text", [False, True])
def test_a_file_that_ends_early_is_refused(suffix: str, is_text: bool, tmp_path: Path) -> None:
    open3d = pytest.importorskip("open3d")
    points_m = np.random.default_rng(0).normal(size=(40, 3))
    whole, short = tmp_path / f"whole.{suffix}", tmp_path / f"short.{suffix}"
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(points_m))
    assert open3d.t.io.write_point_cloud(str(whole), cloud, write_ascii=is_text)
    assert read_cloud(whole)[0] == pytest.approx(points_m, abs=1e-5)  # texts are rounded
    data = whole.read_bytes()
    for share in (0.3, 0.5, 0.9):
        short.write_bytes(data[: int(share * len(data))])
        with pytest.raises(FileError, match="damaged"):
            read_cloud(short)


def test_without_open3d_reading_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    (tmp_path / "cloud.xyz").write_text("0 0 0\n")
    with pytest.raises(HandcalError, match=r"pip install 'handcal\[3d\]'"):
        read_cloud(tmp_path / "cloud.xyz")
    monkeypatch.setattr(sys, "frozen", True, raising=False)  # in the Debian package
    with pytest.raises(HandcalError, match="install the package handcal-open3d"):
        read_cloud(tmp_path / "cloud.xyz")
