"""All files of a report, and its figures by themselves."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.report.document import Report
from handcal.report.html import write_html, write_report


def test_a_report_is_all_its_files(tmp_path: Path, report: Report) -> None:
    shares: list[float] = []
    written = write_report(
        tmp_path / "new" / "out", report, Progress(lambda _, share: shares.append(share))
    )
    assert [path.name for path in written] == ["report.pdf", "report.html"]
    names = {
        path.relative_to(tmp_path / "new" / "out").as_posix()
        for path in tmp_path.rglob("*")
        if path.is_file()
    }
    figures = {f"figures/{name}.{kind}" for name in ("one", "two") for kind in ("png", "csv")}
    assert names == {"report.pdf", "report.html", *figures}
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_figure_is_as_wide_as_a_page_and_has_its_numbers(tmp_path: Path, report: Report) -> None:
    write_html(tmp_path / "report.html", report, Progress())
    picture = cv2.imread(str(tmp_path / "figures" / "one.png"))
    assert picture is not None
    assert picture.shape[:2] == (int(50.0 / 25.4 * 200), int(174.0 / 25.4 * 200))
    assert picture.min() < 100 < picture.max()
    lines = (tmp_path / "figures" / "one.csv").read_text().splitlines()
    assert lines == ["angle_deg,error_mm,method", "0,1.5,paper", "9,,"]


def test_giving_up_leaves_whole_files_only(tmp_path: Path, report: Report) -> None:
    def give_up(_what: str, share: float) -> None:
        if share > 0.5:
            raise CancelledError("enough")

    with pytest.raises(CancelledError):
        write_report(tmp_path, report, Progress(give_up))
    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]


def test_a_place_that_is_no_folder_is_refused(tmp_path: Path, report: Report) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot create the folder"):
        write_report(tmp_path / "file", report)
