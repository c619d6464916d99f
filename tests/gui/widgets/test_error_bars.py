"""The picture of a session's result."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QColor, QImage

from handcal.core.types import Eye
from handcal.session.judged_trials import EyeTrials
from handcal.session.library import EyeOutcome
from handcal_gui.app.theme import colors
from handcal_gui.widgets.error_bars import PICTURE_PX, error_bars, error_text

pytestmark = pytest.mark.usefixtures("qtbot")


def drawn(image: QImage, shade: str) -> int:
    """Return the number of pixels of a colour."""
    places = [(x, y) for x in range(image.width()) for y in range(image.height())]
    return sum(image.pixelColor(x, y) == QColor(shade) for x, y in places)


def bars(eyes: dict[Eye, EyeOutcome]) -> QImage:
    return error_bars(eyes).toImage()


def test_bars_are_as_long_as_the_errors_and_only_an_accepted_one_is_full() -> None:
    accepted = bars({"left": EyeOutcome("accept", 20.0, 10.0, None)})
    assert drawn(accepted, colors().muted) == pytest.approx(
        2 * drawn(accepted, colors().good), abs=4
    )
    doubted = EyeOutcome("accept", 20.0, 10.0, None, trials=EyeTrials(1, 20.7, 8.0))
    assert drawn(bars({"left": doubted}), colors().good) == 0
    assert drawn(bars({"left": doubted}), colors().warning) > 0
    measured = bars({"left": EyeOutcome("accept", 20.0, 10.0, 5.0)})
    assert drawn(measured, colors().good) < drawn(accepted, colors().good)
    repeated = bars({"left": EyeOutcome("repeat", 20.0, 10.0, None)})
    assert 0 < drawn(repeated, colors().warning) < drawn(accepted, colors().good)
    assert drawn(repeated, colors().good) == 0


def test_errors_beyond_the_scale_and_unknown_verdicts_are_drawn_within_the_picture() -> None:
    huge = EyeOutcome("nonsense", 1e300, -5.0, None)
    image = bars({"left": huge, "right": huge})
    assert drawn(image, colors().muted) > 0
    assert image.size() == PICTURE_PX * image.devicePixelRatio()


def test_a_session_without_results_has_no_picture() -> None:
    image = bars({})
    assert all(
        image.pixelColor(x, y).alpha() == 0
        for x in range(image.width())
        for y in range(image.height())
    )
    assert error_text({}) == ""
