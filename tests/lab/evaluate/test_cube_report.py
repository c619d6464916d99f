import numpy as np
from matplotlib.figure import Figure as Canvas

from handcal.core.types import Intrinsics
from handcal.lab.evaluate.cube_test import (
    CubeMisalignment,
    CubeTest,
    cube_report,
    cube_row,
    cube_summary,
)
from handcal.report.document import Table
from handcal.report.html import draw_figure
from handcal.rig.cube import Cube

CAMERA = Intrinsics(640, 360, 900.0, 900.0, 320.0, 180.0)


def made_up() -> CubeTest:
    rng = np.random.default_rng(1)
    rows = []
    for position in ("centre", "up"):
        for pose in ("1", "2"):
            for drawn, size in (("offline", 3e-3), ("solved", 5e-4)):
                offset_m = rng.normal(0.0, size, (8, 2))
                found = CubeMisalignment(
                    2, 0.5, offset_m, offset_m / 0.5, rng.normal(0.0, size), rng.normal(0, 0.01, 3)
                )
                whose = {"position": position, "pose": pose, "drawn": drawn}
                rows.append({**whose, **cube_row(found)})
    return CubeTest(rows, {"up/3": "there is no real.png"})


def test_the_report_holds_what_the_summary_says() -> None:
    test = made_up()
    summary = cube_summary(test.rows)
    report = cube_report(test, summary, Cube(), CAMERA)
    tables = [
        item for section in report.sections for item in section.items if isinstance(item, Table)
    ]
    errors = {table.caption: {row[0]: row[1] for row in table.rows} for table in tables}
    z = summary["solved"]["err_t_z_mm"].spread
    shown = f"{z.mean:.2f}\u00a0±\u00a0{z.sd:.2f}"
    assert errors["solved, 4 pairs of captures"]["err_t z, mm"] == shown
    assert f"solved {summary['solved']['err_t_xy_arcmin'].spread.mean:.2f}" in report.lead
    published = next(table for table in tables if table.columns[0].title == "study")
    assert published.rows[1][3] == shown
    assert published.rows[2][:2] == ("Hu et al. 2021", "0.85 ± 0.52")
    assert ("up/3", "there is no real.png") in [
        tuple(row) for table in tables for row in table.rows
    ]
    assert all(figure.rows == test.rows for figure in report.figures)
    assert [draw_figure(figure).svg[:5] for figure in report.figures] == 2 * [b"<?xml"]


def test_drawings_differ_by_more_than_their_colours() -> None:
    test = made_up()
    report = cube_report(test, cube_summary(test.rows), Cube(), CAMERA)
    for figure in report.figures:
        axes = [Canvas().add_subplot() for _ in range(figure.columns)]
        figure.draw(axes)
        for ax in axes:
            named = {line.get_label(): line.get_linestyle() for line in ax.get_lines()}
            assert named["offline"] != named["solved"]
            boxes = [
                line.get_linestyle() for line in ax.get_lines() if np.size(line.get_xdata()) > 2
            ]
            assert set(boxes) >= {named["offline"], named["solved"]}
