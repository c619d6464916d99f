from dataclasses import replace

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QImage
from pytestqt.qtbot import QtBot

from handcal.core.types import Float64, UInt8
from handcal.hand.outline import contour_px
from handcal.rig.example import example_rig
from handcal.station.wearer_view import EyeView, render_eye_view
from handcal_gui.app.theme import colors
from handcal_gui.calibrate.parts.splat import rgb
from handcal_gui.calibrate.wearer_view.eye_canvas import EyeCanvas, show_alike, simplified
from tests.gui.conftest import Shots

DISPLAY = example_rig().eyes["left"]
ANGLE_RAD = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
RING_M = np.column_stack([0.05 * np.cos(ANGLE_RAD), 0.05 * np.sin(ANGLE_RAD), np.full(100, 0.5)])
SIZE = (300, 300)


def _view(
    outline_m: Float64 = RING_M, drawn_shift_m: Float64 | None = None, image: UInt8 | None = None
) -> EyeView:
    drawn_m = np.zeros(3) if drawn_shift_m is None else drawn_shift_m
    return render_eye_view(
        "left", DISPLAY, np.zeros(3), drawn_m, outline_m, RING_M[:0], is_true=True, image=image
    )


@pytest.fixture
def canvas(qtbot: QtBot) -> EyeCanvas:
    canvas = EyeCanvas("Left eye")
    qtbot.addWidget(canvas)
    canvas.resize(*SIZE)
    canvas.show()
    return canvas


def _pixels(canvas: EyeCanvas) -> UInt8:
    """Return (h, w, 3) RGB of what is shown."""
    image = canvas.grab().toImage().convertToFormat(QImage.Format.Format_RGBA8888)
    pixels = np.frombuffer(image.constBits(), np.uint8).copy()
    return pixels.reshape(image.height(), image.width(), 4)[..., :3]


def _has(canvas: EyeCanvas, color: str) -> bool:
    return bool((np.abs(_pixels(canvas).astype(int) - rgb(color)).max(axis=2) < 10).any())


def test_message_stands_alone(canvas: EyeCanvas) -> None:
    canvas.show_view(None, "Nothing yet")
    assert canvas.accessibleDescription() == "Nothing yet"
    assert not _has(canvas, colors().live)
    canvas.show_view(_view())
    assert _has(canvas, colors().live)
    canvas.show_view(_view(), "No hand in view")
    assert not _has(canvas, colors().live)


def test_a_message_lies_on_the_picture_not_below_it(canvas: EyeCanvas) -> None:
    canvas.resize(300, 700)
    image = np.full((int(DISPLAY.height_px), int(DISPLAY.width_px), 3), 200, np.uint8)
    canvas.show_view(_view(image=image), " ")
    canvas.show_whole(True)
    empty = _pixels(canvas).astype(int)
    canvas.show_view(_view(image=image), "Hand cut by the image border")
    rows = np.flatnonzero((_pixels(canvas) != empty).any(axis=(1, 2)))
    picture_px = 300 * DISPLAY.height_px / DISPLAY.width_px
    assert (rows[0] + rows[-1]) / 2 == pytest.approx(picture_px / 2, abs=10)


def test_two_displays_show_the_same_rows_at_one_scale(qtbot: QtBot) -> None:
    canvases = [EyeCanvas(f"{side} eye") for side in ("Left", "Right")]
    for canvas, off_m in zip(canvases, ([0.0, 0.0, 0.0], [0.03, 0.05, 0.2]), strict=True):
        qtbot.addWidget(canvas)
        canvas.show_view(_view(RING_M + off_m))
    own = [canvas.crop_px for canvas in canvases]
    show_alike(canvases)
    one, other = (canvas.crop_px for canvas in canvases)
    assert (one.top(), one.height(), one.width()) == (other.top(), other.height(), other.width())
    assert one.top() != own[0].top() or other.top() != own[1].top()
    for canvas, crop in zip(canvases, own, strict=True):
        assert canvas.crop_px.contains(crop.adjusted(0.1, 0.1, -0.1, -0.1))
    show_alike([EyeCanvas("Nothing shown")])


def test_a_hand_at_the_edge_of_a_display_is_shown_as_large_as_the_other(qtbot: QtBot) -> None:
    canvases = [EyeCanvas(f"{side} eye") for side in ("Left", "Right")]
    for canvas, off_m in zip(canvases, ([0.0, 0.0, 0.0], [0.12, 0.06, 0.0]), strict=True):
        qtbot.addWidget(canvas)
        canvas.show_view(_view(RING_M + off_m))
    show_alike(canvases)
    one, other = (canvas.crop_px for canvas in canvases)
    assert one.size() == other.size()
    assert all(canvas.display_px.contains(canvas.crop_px) for canvas in canvases)


def test_crop_holds_the_hand_and_stays_while_it_does(canvas: EyeCanvas) -> None:
    canvas.show_view(_view())
    crop = QRectF(canvas.crop_px)
    ring_px = _view().hand_px
    assert all(crop.contains(x, y) for x, y in ring_px.tolist())
    assert crop.width() < 1.5 * np.ptp(ring_px[:, 0])
    canvas.show_view(_view(RING_M + np.array([0.002, 0.0, 0.0])))
    assert canvas.crop_px == crop
    canvas.show_view(_view(RING_M + np.array([0.03, 0.0, 0.0])))
    assert canvas.crop_px != crop
    canvas.show_view(_view(0.3 * RING_M + [0.0, 0.0, 0.35]))
    assert canvas.crop_px.width() < 0.5 * crop.width()


def test_a_cropped_picture_is_framed_on_all_sides_and_shows_the_cursor_too(
    canvas: EyeCanvas,
) -> None:
    view = _view()
    canvas.show_view(replace(view, cursor_px=view.hand_px + 40.0))
    assert canvas.crop_px.contains(QPointF(*(view.hand_px.max(axis=0) + 40.0)))
    assert canvas.crop_px != canvas.display_px
    place = canvas._place().toRect()
    pixels = _pixels(canvas)[place.top() : place.bottom() + 1, place.left() : place.right() + 1]
    is_frame = np.abs(pixels.astype(int) - rgb(colors().muted)).max(axis=2) < 10
    for side in (is_frame[0], is_frame[-1], is_frame[:, 0], is_frame[:, -1]):
        assert side.all()


def test_whole_display_is_shown_on_demand(canvas: EyeCanvas) -> None:
    whole = QRectF(-0.5, -0.5, DISPLAY.width_px, DISPLAY.height_px)
    canvas.show_view(_view())
    canvas.show_whole(True)
    assert canvas.crop_px == whole
    canvas.show_whole(False)
    assert canvas.crop_px != whole
    canvas.show_view(_view(RING_M[:0]))
    assert canvas.crop_px == whole


def test_world_and_outline_lie_where_the_display_has_them(canvas: EyeCanvas) -> None:
    ring_m = 0.2 * RING_M + np.array([0.03, -0.02, 0.4])
    world = np.full((DISPLAY.height_px // 2, DISPLAY.width_px // 2, 3), 128, np.uint8)
    ring_px = _view(ring_m).hand_px
    column, row = (ring_px.mean(axis=0) / 2.0).astype(int)
    world[row - 1 : row + 2, column - 1 : column + 2] = (255, 0, 0)
    canvas.show_view(_view(ring_m, image=world))

    pixels = _pixels(canvas).astype(int)
    is_dot = (pixels[..., 0] > 190) & (pixels[..., 1] < 65)
    is_line = np.abs(pixels - rgb(colors().live)).max(axis=2) < 40
    crop = canvas.crop_px
    scale = SIZE[0] / max(crop.width(), crop.height())
    dot_px = 2.0 * np.array([column, row]) + 0.5  # each of the image's pixels covers two by two
    ring_px = 0.5 * (ring_px.min(axis=0) + ring_px.max(axis=0))
    for where, place_px in ((is_dot, dot_px), (is_line, ring_px)):
        rows, columns = np.nonzero(where)
        seen = np.array([columns.min() + columns.max(), rows.min() + rows.max()]) / 2.0
        middle = [crop.center().x(), crop.center().y()]
        np.testing.assert_allclose(seen, 149.5 + scale * (place_px - middle), atol=1.0)


def test_target_is_shown_as_seen_and_as_drawn(canvas: EyeCanvas) -> None:
    none_m, corners_m = RING_M[:0], RING_M[::25]  # slanting lines have pixels of full colour
    eye_m, drawn_m = np.zeros(3), np.array([0.02, 0.0, 0.0])
    view = render_eye_view("left", DISPLAY, eye_m, drawn_m, none_m, none_m, corners_m, is_true=True)
    canvas.show_view(view)
    corners_px = np.vstack([view.target_px, view.drawn_target_px])
    assert all(canvas.crop_px.contains(x, y) for x, y in corners_px.tolist())
    assert _has(canvas, colors().live)
    assert _has(canvas, canvas.palette().windowText().color().name())
    canvas.show_view(_view(none_m))
    assert not _has(canvas, colors().live)


def test_offline_outline_is_shown_on_demand(canvas: EyeCanvas) -> None:
    canvas.show_view(_view(drawn_shift_m=np.array([0.01, 0.0, 0.0])))
    before = _pixels(canvas)
    canvas.show_offline(True)
    assert (_pixels(canvas) != before).any()
    canvas.show_offline(False)
    np.testing.assert_array_equal(_pixels(canvas), before)


def test_a_picture_that_fits_stays_in_the_middle_wherever_the_hand_is(canvas: EyeCanvas) -> None:
    canvas.resize(900, 200)
    image = np.full((int(DISPLAY.height_px), int(DISPLAY.width_px), 3), 200, np.uint8)
    for aside_m in (-0.04, 0.04):
        canvas.show_view(_view(RING_M + np.array([aside_m, 0.0, 0.0]), image=image))
        columns = np.flatnonzero((_pixels(canvas) == 200).all(axis=2).any(axis=0))
        assert (columns[0] + columns[-1]) / 2 == pytest.approx(450, abs=2)


@pytest.mark.parametrize(("spacing_px", "most_px"), [(6.0, 2.0), (12.0, 3.0)])
def test_the_drawn_outline_follows_the_webs_between_the_fingers(
    shots: Shots, spacing_px: float, most_px: float
) -> None:
    outline_px, _ = contour_px(shots.live.cloud, shots.frame)
    drawn = simplified(outline_px, spacing_px)
    assert len(drawn) < 1.8 * len(outline_px) / spacing_px
    line = drawn.astype(np.float32).reshape(-1, 1, 2)
    away_px = [abs(cv2.pointPolygonTest(line, (x, y), True)) for x, y in outline_px.tolist()]
    assert np.mean(away_px) < most_px / 4.0  # every eighteenth point missed webs by 5.7
    assert max(away_px) < most_px


def test_an_outline_of_few_points_is_drawn_as_it_is() -> None:
    np.testing.assert_array_equal(simplified(RING_M[::25, :2], 1.0), RING_M[::25, :2])


def test_the_cursor_keeps_its_colour_over_an_image(canvas: EyeCanvas) -> None:
    world = np.full((DISPLAY.height_px // 2, DISPLAY.width_px // 2, 3), 128, np.uint8)
    eye_m, corners_m = np.zeros(3), RING_M[::25]  # a square on its corner
    view = render_eye_view(
        "left", DISPLAY, eye_m, eye_m, RING_M[:0], corners_m, is_true=True, image=world
    )
    canvas.show_view(view)
    canvas.show_whole(True)
    sides_px = np.diff(np.vstack([view.cursor_px, view.cursor_px[:1]]), axis=0)
    long_px = SIZE[0] / canvas.crop_px.width() * np.linalg.norm(sides_px, axis=1).sum()
    is_cursor = np.abs(_pixels(canvas).astype(int) - rgb(colors().cursor)).max(axis=2) < 10
    assert is_cursor.sum() > 1.5 * long_px
