"""Fields keep their value when the wheel only scrolls the page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QLocale, QPoint, QPointF
from PySide6.QtGui import Qt, QTextDocument, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QDoubleSpinBox, QSpinBox
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.fields import (
    NumberField,
    choice,
    number,
    plain_message,
    whole_number,
)

Field = QComboBox | QDoubleSpinBox | QSpinBox


def turn_wheel(field: Field) -> None:
    middle = QPointF(field.rect().center())
    event = QWheelEvent(
        middle,
        field.mapToGlobal(middle),
        QPoint(),
        QPoint(0, -120),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(field, event)


def shown(field: Field) -> float:
    return field.currentIndex() if isinstance(field, QComboBox) else field.value()


@pytest.mark.parametrize("kind", ["choice", "number", "whole_number"])
def test_the_wheel_changes_only_the_field_with_the_focus(qtbot: QtBot, kind: str) -> None:
    fields: dict[str, Field] = {
        "choice": choice("x", "X", {"a": "A", "b": "B", "c": "C"}),
        "number": number("x", -10.0, 10.0, 0.5, " m", ""),
        "whole_number": whole_number("x", -10, 10, ""),
    }
    field = fields[kind]
    for one in fields.values():
        qtbot.addWidget(one)
    field.show()
    field.clearFocus()
    before = shown(field)
    turn_wheel(field)
    assert shown(field) == before
    field.setFocus()
    qtbot.waitUntil(field.hasFocus)
    turn_wheel(field)
    assert shown(field) != before


@pytest.fixture(params=["C", "de_DE", "de_CH", "ar_EG"])
def locale(request: pytest.FixtureRequest) -> Iterator[QLocale]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield QLocale()
    QLocale.setDefault(before)


@pytest.mark.usefixtures("locale")
@pytest.mark.parametrize("typed", ["12.5", "12,5"])
def test_a_number_is_the_same_in_every_language(qtbot: QtBot, typed: str) -> None:
    field, whole = number("x", -100.0, 2000.0, 0.01, " mm", ""), whole_number("y", 0, 2000, "")
    for one in (field, whole):
        qtbot.addWidget(one)
        one.show()
        one.selectAll()
        QTest.keyClicks(one.lineEdit(), typed)
    assert (field.value(), field.text()) == (12.5, "12.5 mm")
    QApplication.clipboard().setText(typed)
    field.setValue(1500.0)
    assert field.text() == "1500.00 mm"
    field.selectAll()
    field.lineEdit().paste()
    assert field.value() == 12.5
    assert (whole.value(), whole.text()) == (125, "125")  # the separator is not taken


@pytest.mark.parametrize("typed", ["-2.5", "−2.5"])
def test_a_minus_is_shown_and_a_hyphen_read_too(qtbot: QtBot, typed: str) -> None:
    field = NumberField(2)
    qtbot.addWidget(field)
    field.setRange(-9.0, 9.0)
    field.selectAll()
    field.lineEdit().insert(typed)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert (field.value(), field.text()) == (-2.5, "−2.50")
    field.stepBy(-1)
    assert field.text() == "−3.50"


@pytest.mark.parametrize(
    ("typed", "taken"), [("99", "30.00 mm"), ("-31", "−30.00 mm"), ("99.5", "30.00 mm")]
)
def test_a_number_out_of_range_is_typed_in_full_and_the_nearest_is_taken(
    qtbot: QtBot, typed: str, taken: str
) -> None:
    field = number("x", -30.0, 30.0, 0.01, " mm", "")
    qtbot.addWidget(field)
    field.show()
    field.selectAll()
    QTest.keyClicks(field.lineEdit(), typed)
    assert field.cleanText() == typed
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == taken


@pytest.mark.parametrize(("typed", "taken"), [("0", "2"), ("12345", "10000")])
def test_a_whole_number_out_of_range_is_not_replaced_by_the_former_one(
    qtbot: QtBot, typed: str, taken: str
) -> None:
    field = whole_number("x", 2, 10_000, "")
    qtbot.addWidget(field)
    field.show()
    field.setValue(100)
    field.selectAll()
    QTest.keyClicks(field.lineEdit(), typed)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == taken


@pytest.mark.parametrize("typed", ["1.234", "1e3", "nan", "x"])
def test_what_is_no_number_is_not_typed(qtbot: QtBot, typed: str) -> None:
    field = number("x", -30.0, 30.0, 0.01, " mm", "")
    qtbot.addWidget(field)
    field.selectAll()
    QTest.keyClicks(field.lineEdit(), typed)
    assert field.cleanText() != typed


@pytest.mark.parametrize("text", ["cannot write /a/<b>x</b>\n\nMake room.", "a&lt;b", "no markup"])
def test_a_message_shows_tags_as_they_are(text: str) -> None:
    document, message = QTextDocument(), plain_message(text)
    if Qt.mightBeRichText(message):
        document.setHtml(message)
    else:
        document.setPlainText(message)
    assert document.toPlainText() == text
