"""Fields of forms: numbers with units, choices, buttons and rows of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from html import escape
from typing import TypeVar, cast

from PySide6.QtCore import QEvent, QLocale, QObject, Qt
from PySide6.QtGui import QAction, QValidator
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QPushButton,
    QSizePolicy,
    QSpinBox,
    QStackedWidget,
    QToolButton,
    QWidget,
)

from handcal.report.cells import MINUS, with_minus
from handcal_gui.app.keys import add_action, native
from handcal_gui.app.theme import SPACING_PX, scale_font, set_style
from handcal_gui.widgets.layouts import hbox

Field = TypeVar("Field", bound=QWidget)
Spin = TypeVar("Spin", bound=QAbstractSpinBox)
Option = TypeVar("Option", bound=str)

_FIXED = QSizePolicy.Policy.Fixed


def with_name(field: Field, name: str, label: str = "", help_text: str = "") -> Field:
    """Give a widget its object name, its name for screen readers, and its tooltip."""
    field.setObjectName(name)
    field.setAccessibleName(label)
    field.setToolTip(help_text)
    return field


def plain_tooltip(text: str) -> str:
    """Return a tooltip that shows a text from a file as it is: Qt takes tags for markup."""
    return _as_it_is(text, "pre")


def plain_message(text: str) -> str:
    """Return a text for a message box, which shows it as it is and breaks its lines."""
    return _as_it_is(text, "pre-wrap")


class NumberField(QDoubleSpinBox):
    """A field for a number, with a point and a minus as in every other number shown.

    A comma becomes a point, and a hyphen is read as a minus: in some locales a comma or a point
    separates thousands, and 0,5 was read as 5. A number out of range can be typed, and the nearest
    one takes its place: otherwise its last digits would be dropped, and 99 became 9.
    """

    def __init__(self, decimals: int) -> None:
        super().__init__(decimals=decimals)
        self.setLocale(QLocale.c())

    def textFromValue(self, value: float) -> str:
        """Return a number as it is shown."""
        return with_minus(super().textFromValue(value))

    def valueFromText(self, text: str) -> float:
        """Return the number that was typed."""
        return super().valueFromText(text.replace(MINUS, "-"))

    def validate(self, text: str, place: int) -> tuple[QValidator.State, str, int]:
        """Return whether a text is a number, or may become one."""
        text = text.replace(",", ".")
        state, _, place = super().validate(text.replace(MINUS, "-"), place)
        pattern = rf"-?\d+(\.\d{{0,{self.decimals()}}})?"
        return _allowing(state, _typed(self, text), pattern), text, place

    def fixup(self, text: str) -> str:
        """Return the nearest number that is allowed."""
        return _nearest(self, text) or super().fixup(text)


class WholeNumberField(QSpinBox):
    """A field for a whole number, without separators: it showed 1,5 and was 15.

    For a number out of range, the nearest one is taken, as in `NumberField`.
    """

    def __init__(self, low: int, high: int) -> None:
        super().__init__(minimum=low, maximum=high)
        self.setLocale(QLocale.c())

    def validate(self, text: str, place: int) -> tuple[QValidator.State, str, int]:
        """Refuse a point or a comma."""
        if {".", ","} & set(_typed(self, text)):
            return QValidator.State.Invalid, text, place
        state, text, place = super().validate(text, place)
        return _allowing(state, _typed(self, text), r"-?\d{1,18}"), text, place

    def fixup(self, text: str) -> str:
        """Return the nearest number that is allowed."""
        return _nearest(self, text) or super().fixup(text)


def number(
    name: str, low: float, high: float, step: float, unit: str, help_text: str
) -> NumberField:
    """Return a field for a number, right-aligned and with its unit."""
    field = with_name(NumberField(1 if step >= 0.1 else 2), name, help_text=help_text)
    field.setRange(low, high)
    field.setSingleStep(step)
    field.setSuffix(unit)
    return _settle(field)


def whole_number(name: str, low: int, high: int, help_text: str) -> WholeNumberField:
    """Return a field for a whole number, right-aligned."""
    return _settle(with_name(WholeNumberField(low, high), name, help_text=help_text))


def choice(name: str, label: str, options: Mapping[Option, str], help_text: str = "") -> QComboBox:
    """Return a field for a choice of options, given their labels."""
    field = with_name(QComboBox(), name, label, help_text)
    for option, text in options.items():
        field.addItem(text, option)
    field.setSizePolicy(_FIXED, _FIXED)
    field.setMinimumWidth(20 * SPACING_PX)
    _CalmWheel(field)
    return field


def button(name: str, text: str = "", label: str = "", help_text: str = "") -> QPushButton:
    """Return a button that Enter also presses while it has the focus."""
    label = label or text.replace("&", "")
    return with_name(QPushButton(text, autoDefault=True), name, label, help_text)


class MainButton(QPushButton):
    """The main button of a page; the theme gives this class the accent colour."""


def main_button(name: str, text: str = "") -> MainButton:
    """Return a page's main button: large, and pressed by Enter."""
    made = with_name(MainButton(text, autoDefault=True), name, text.replace("&", ""))
    scale_font(made, 1.2, is_bold=True)
    made.setMinimumHeight(5 * SPACING_PX)
    made.setDefault(True)
    return made


def tool_button(action: QAction) -> QToolButton:
    """Return an action's tool button, which stands out while checked."""
    made = QToolButton()
    if "&" in action.text():
        action.setIconText(action.text())  # Qt leaves the letter out of its own
    made.setDefaultAction(action)
    made.setAccessibleName(action.text().replace("&", ""))
    stand_out_while_checked(made)
    return made


def stand_out_while_checked(widget: QAbstractButton) -> None:
    """Give a button the accent colour while it is checked, also in the dark theme."""
    set_style(
        widget,
        "*:checked { background: palette(highlight); color: palette(highlighted-text);"
        " border: 1px solid palette(text); border-radius: 2px; }",
    )


def paragraph(name: str = "", text: str = "") -> QLabel:
    """Return a wrapped plain-text label that takes the available width."""
    label = QLabel(text, wordWrap=True, textFormat=Qt.TextFormat.PlainText)
    label.setObjectName(name)
    policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
    policy.setHeightForWidth(True)
    label.setSizePolicy(policy)
    return label


def make_linked(label: QLabel) -> QLabel:
    """Let a label show HTML with links, which keys reach, too."""
    by = Qt.TextInteractionFlag
    label.setTextFormat(Qt.TextFormat.RichText)
    label.setTextInteractionFlags(by.LinksAccessibleByMouse | by.LinksAccessibleByKeyboard)
    return label


def one_of(texts: Mapping[str, str]) -> QStackedWidget:
    """Return paragraphs by their names, one of which is shown; as high as the highest of them.

    Nothing beside them moves when another is shown.
    """
    stack = QStackedWidget()
    for name, text in texts.items():
        stack.addWidget(paragraph(name, text))
    return stack


def label_for(field: QWidget, text: str) -> QLabel:
    """Return the label of a field, whose letter leads to that part of it that takes the keyboard.

    Qt leads to no buddy that only passes the keyboard on.
    """
    label = QLabel(text)
    parts = filter(None, (field, field.focusProxy(), *field.findChildren(QWidget)))
    label.setBuddy(next(one for one in parts if one.focusPolicy() != Qt.FocusPolicy.NoFocus))
    return label


def let_keys_choose(box: QComboBox, panel: QWidget, text: str, keys: str) -> None:
    """Add a key that chooses the next entry of a list from anywhere in its panel.

    After the last entry comes the first. The tooltip names the key.
    """

    def choose_next() -> None:
        box.setCurrentIndex((box.currentIndex() + 1) % box.count())

    add_action(panel, text, keys, choose_next)
    box.setToolTip(f"{box.toolTip()} ({native(keys)})")


def make_equally_wide(fields: Iterable[QWidget]) -> None:
    """Make the fields of a column as wide as the widest of them."""
    column = list(fields)
    widest_px = max((max(one.sizeHint().width(), one.minimumWidth()) for one in column), default=0)
    for one in column:
        one.setMinimumWidth(widest_px)


def fill_row(row: QWidget, *widgets: QWidget, grows: QWidget) -> None:
    """Lay out widgets in a row without margins, from the left; one of them may stretch."""
    items = [(widget, 1 if widget is grows else 0) for widget in widgets]
    hbox(*items, 0, on=row, margins=0, spacing=SPACING_PX)


def _as_it_is(text: str, white_space: str) -> str:
    is_like_markup = "<" in text or "&" in text
    return f"<p style='white-space: {white_space}'>{escape(text)}</p>" if is_like_markup else text


def _typed(field: QDoubleSpinBox | QSpinBox, text: str) -> str:
    return text.removesuffix(field.suffix()).strip().replace(MINUS, "-")


def _allowing(state: QValidator.State, typed: str, pattern: str) -> QValidator.State:
    """Return a state in which a number out of range can be typed in full."""
    is_number = re.fullmatch(pattern, typed, re.ASCII) is not None
    is_refused = state == QValidator.State.Invalid
    return QValidator.State.Intermediate if is_refused and is_number else state


def _nearest(field: QDoubleSpinBox | QSpinBox, text: str) -> str:
    """Return the text of the allowed number nearest to the one typed; empty if there is none."""
    try:
        number = float(_typed(field, text))
    except ValueError:
        return ""
    nearest = min(max(number, field.minimum()), field.maximum())
    shown = (
        field.textFromValue(round(nearest))
        if isinstance(field, QSpinBox)
        else field.textFromValue(nearest)
    )
    return f"{shown}{field.suffix()}"


def _settle(field: Spin) -> Spin:
    """Align a number to the right, with a constant width."""
    field.setAlignment(Qt.AlignmentFlag.AlignRight)
    field.setSizePolicy(_FIXED, _FIXED)
    field.setMinimumWidth(12 * SPACING_PX)
    _CalmWheel(field)
    return field


class _CalmWheel(QObject):
    """Lets the wheel scroll the page instead of the value, unless the field has the focus."""

    def __init__(self, field: QWidget) -> None:
        super().__init__(field)
        field.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # not by the wheel
        field.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        is_meant = event.type() != QEvent.Type.Wheel or cast(QWidget, watched).hasFocus()
        if not is_meant:
            event.ignore()
        return not is_meant
