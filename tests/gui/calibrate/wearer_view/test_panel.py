from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtWidgets import QCheckBox, QLabel
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES, Eye
from handcal.register.results import Results
from handcal.station.snapshot import Snapshot
from handcal.station.wearer_view import EyeView
from handcal_gui.calibrate.guide.picture import GuidePicture
from handcal_gui.calibrate.guide.view import Step
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas
from handcal_gui.calibrate.wearer_view.panel import WearerViewPanel
from tests.gui.helpers import show

MakeSnapshot = Callable[..., Snapshot]
UNKNOWN = ["–"] * 4


@pytest.fixture
def panel(qtbot: QtBot) -> WearerViewPanel:
    return show(qtbot, WearerViewPanel(), 380, 300)


def _canvas(panel: WearerViewPanel, eye: Eye) -> EyeCanvas:
    canvas = panel.findChild(EyeCanvas, f"{eye}-eye")
    assert canvas is not None
    return canvas


def _texts(panel: WearerViewPanel, eye: Eye) -> list[str]:
    """Return the title and the numbers of an eye, now and before."""
    column = _canvas(panel, eye).parentWidget()
    assert column is not None
    texts = [label.text() for label in column.findChildren(QLabel)]
    return [text for text in texts if text not in ("Error", "Before")]


def _predicted(snapshot: Snapshot) -> dict[Eye, EyeView]:
    return {eye: replace(view, is_true=False) for eye, view in snapshot.views.items()}


def test_empty_it_says_what_will_appear(panel: WearerViewPanel) -> None:
    for eye in EYES:
        assert "will appear here" in _canvas(panel, eye).accessibleDescription()
        assert _texts(panel, eye)[1:] == UNKNOWN


def test_simulated_eyes_show_their_errors(panel: WearerViewPanel, snapshot: MakeSnapshot) -> None:
    now = snapshot()
    panel.show_snapshot(now)
    for eye in EYES:
        drawn = now.views[eye].drawn
        assert drawn.error_px is not None
        assert drawn.error_px > 1.0
        title, px, arcmin, *before = _texts(panel, eye)
        assert title == f"{eye.capitalize()} eye, simulated"
        assert px == f"{drawn.error_px:.1f} px"
        assert arcmin == f"{drawn.error_arcmin:.1f}′"
        assert before == [px, arcmin]  # nothing is applied yet
        assert _canvas(panel, eye).accessibleDescription() == ""


def test_a_comparison_is_no_missing_hand(
    qtbot: QtBot, panel: WearerViewPanel, snapshot: MakeSnapshot
) -> None:
    picture = show(qtbot, GuidePicture(), 600, 500)
    picture.step = Step.VERIFY
    compared = replace(snapshot(State.APPLIED, views={}), comparing="first")
    panel.show_snapshot(compared)
    picture.show_snapshot(compared)
    for shown in (panel, picture):
        for canvas in shown.findChildren(EyeCanvas):
            assert canvas.accessibleDescription() == "Hidden while the wearer compares"


def test_eye_that_is_not_known_has_no_error(
    panel: WearerViewPanel, snapshot: MakeSnapshot, results: Results
) -> None:
    panel.show_snapshot(snapshot(views=_predicted(snapshot())))
    assert _texts(panel, "left") == ["Left eye, not solved yet", *UNKNOWN]
    solved = snapshot(State.SOLVED, procedure={"results": results}, views=_predicted(snapshot()))
    panel.show_snapshot(solved)
    title, name, px, *_ = _texts(panel, "left")
    assert (title, name) == ("Left eye, predicted", "Against solved φ")
    assert px == f"{solved.views['left'].drawn.error_px:.1f} px"


def test_eye_that_is_closed_says_so(panel: WearerViewPanel, snapshot: MakeSnapshot) -> None:
    panel.show_snapshot(snapshot(procedure={"eyes": ("left",)}))
    assert _canvas(panel, "left").accessibleDescription() == ""
    assert "Closed" in _canvas(panel, "right").accessibleDescription()
    assert _texts(panel, "right")[1:] == UNKNOWN
    # Without a cursor both eyes are open.
    panel.show_snapshot(snapshot(State.SHOW_HAND, procedure={"eyes": ("left",)}))
    assert _canvas(panel, "right").accessibleDescription() == ""


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"observation": {"hand": None, "cloud": None, "problem": "no hand in view; raise it"}},
            "In the camera's image: no hand in view; raise it",
        ),
        ({"observation": {"hand": None, "problem": "no pose yet"}}, "No pose yet"),
        ({"observation": None, "camera": {"problem": "no camera is connected"}}, "No image"),
    ],
)
def test_problem_takes_the_place_of_the_view(
    panel: WearerViewPanel, snapshot: MakeSnapshot, changes: dict[str, object], message: str
) -> None:
    panel.show_snapshot(snapshot())
    panel.show_snapshot(snapshot(**changes))
    for eye in EYES:
        assert _canvas(panel, eye).accessibleDescription() == message
        assert _texts(panel, eye)[1:] == UNKNOWN


def test_options_change_both_eyes(panel: WearerViewPanel, snapshot: MakeSnapshot) -> None:
    panel.show_snapshot(snapshot())
    crops = [_canvas(panel, eye).crop_px for eye in EYES]
    before = panel.findChild(LegendEntry, "legend-offline")
    assert before is not None
    assert before.isVisible()
    for name in ("wearer-view-whole", "wearer-view-before"):
        option = panel.findChild(QCheckBox, name)
        assert option is not None
        option.click()
    assert not before.isVisible()
    for eye, crop in zip(EYES, crops, strict=True):
        assert _canvas(panel, eye).crop_px != crop
        assert _canvas(panel, eye).crop_px.width() == snapshot().views[eye].width_px


def test_both_eyes_are_shown_in_one_scale(panel: WearerViewPanel, snapshot: MakeSnapshot) -> None:
    now = snapshot()
    right = now.views["right"]
    left_part = right.hand_px[right.hand_px[:, 0] < np.median(right.hand_px[:, 0])]
    drawn = replace(right.drawn, outline_px=left_part)
    cut = replace(right, hand_px=left_part, drawn=drawn)  # by the edge of its display
    panel.show_snapshot(replace(now, views={**now.views, "right": cut}))
    left_px, right_px = (_canvas(panel, eye).crop_px.size() for eye in EYES)
    assert left_px == right_px
