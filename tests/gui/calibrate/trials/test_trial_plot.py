from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtWidgets import (
    QApplication,
    QTabWidget,
)

from handcal.core.types import Eye, Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.calibrate.trials.panel import TrialsPanel
from handcal_gui.calibrate.trials.trial_plot import TrialPlot
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child


def test_plot_table_and_text_have_one_statistic(
    panel: TrialsPanel, tried: SessionRecord, rig: Rig
) -> None:
    with Session(tried.path) as session:
        session.save_trial(make_trial(rig.eyes["right"], "right", 0.4, np.zeros(3), [3e-3, 0, 0]))
    tried = Session.open(tried.path)
    panel.show_record(tried)
    plot = child(panel, TrialPlot)
    means = {number: trial.error_arcmin.mean() for number, trial in tried.trials.items()}
    drawn = {line.name(): line.getData() for line in plot.item.listDataItems()}
    _, errors = drawn["Left eye"]
    np.testing.assert_allclose(errors[~np.isnan(errors)], [means[1], means[3]])
    at_m, marks = (values.reshape(-1, 3)[:, :2] for values in drawn["Mean ± SD (≥ 0)"])
    np.testing.assert_allclose(at_m.mean(axis=1), (0.4, 0.4, 0.6, 0.6))
    near = [means[1], means[4]]
    sd = np.std(near, ddof=1)
    np.testing.assert_allclose(marks[0], np.mean(near))
    np.testing.assert_allclose(marks[1], [np.mean(near) - sd, np.mean(near) + sd])
    np.testing.assert_allclose(marks[2:], means[3])  # one trial has no spread
    row = (
        child(panel, Table, "statistics-of-trials")
        .as_text()
        .split("0.4 m\t")[1]
        .splitlines()[0]
        .split("\t")
    )
    assert row[:3] == ["2", f"{np.mean(near):.1f}", f"{sd:.1f}"]
    [ticks] = plot.item.getAxis("bottom")._tickLevels
    assert [name for _, name in ticks] == ["0.4 (n = 2)", "0.5 (n = 0)", "0.6 (n = 1)"]


def test_the_plot_shows_whole_marks_and_bars(
    panel: TrialsPanel, record: SessionRecord, rig: Rig
) -> None:
    with Session(record.path) as session:
        shifts_m: dict[Eye, float] = {"left": 5e-3, "right": 0.0}
        for eye, shift_m in shifts_m.items():
            trial = make_trial(rig.eyes[eye], eye, 0.4, np.zeros(3), [shift_m, 0, 0])
            session.save_trial(trial)
    panel.resize(384, 300)
    panel.show_record(Session.open(record.path))
    child(panel, QTabWidget).setCurrentIndex(2)
    QApplication.processEvents()
    plot = child(panel, TrialPlot).item
    drawn = {line.name(): line for line in plot.listDataItems()}
    _, up = drawn["Mean ± SD (≥ 0)"].getData()
    _, (bottom, top) = plot.vb.viewRange()
    assert bottom < np.nanmin(up) == 0.0 < np.nanmax(up) < top, "no error is below 0"
    shown = plot.vb.mapRectToScene(plot.vb.boundingRect())
    for name in ("Left eye", "Right eye"):
        line = drawn[name]
        at_m, errors = (values[~np.isnan(values)] for values in line.getData())
        spot = plot.vb.mapViewToScene(QPointF(at_m[0], errors[0]))
        half_px = line.opts["symbolSize"] / 2
        mark = QRectF(spot.x() - half_px, spot.y() - half_px, 2 * half_px, 2 * half_px)
        assert shown.contains(mark), name


def test_the_legend_of_a_low_plot_is_above_it_and_whole(
    panel: TrialsPanel, tried: SessionRecord
) -> None:
    panel.resize(384, 300)
    panel.show_record(tried)
    child(panel, QTabWidget).setCurrentIndex(2)
    QApplication.processEvents()
    plot = child(panel, TrialPlot).item
    legend = plot.legend.mapRectToScene(plot.legend.boundingRect())
    assert [label.text for _, label in plot.legend.items] == [
        "Mean ± SD (≥ 0)",
        "Left eye",
        "Right eye",
    ]
    assert plot.scene().sceneRect().contains(legend)
    assert not legend.intersects(plot.vb.mapRectToScene(plot.vb.boundingRect()))
