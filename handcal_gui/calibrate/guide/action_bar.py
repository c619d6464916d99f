"""The action bar: the window's bottom strip, with the main button at the lower right."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QKeyEvent, QPalette
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QTextEdit,
    QWidget,
)

from handcal_gui.app.keys import add_action, native
from handcal_gui.app.theme import SPACING_PX, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.view import MOST_OTHERS, Action, ButtonSpec, WizardView
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import main_button, with_name
from handcal_gui.widgets.key_cap import KeyCap

_KEY, _TEXT_KEY = "Space", "Ctrl+Return"
_KEYS = {
    _KEY: tr("Press the large button, except from a text field"),
    f"{_TEXT_KEY} Ctrl+Enter": tr("Press the large button from anywhere"),
}
_LONGEST_LABEL = tr("Confirm for the wearer")
_ARMING_MS = 700
"""Delay before a new button can discard data: a click on its predecessor must not trigger it."""


class ActionBar(QWidget):
    """The buttons of a `WizardView`; its height and the main button's position never change.

    The space bar presses the main button, except while a text field has the focus; Ctrl+Return
    always does. The main button never has the focus, because a disabled button would pass it on.
    Buttons that discard data have no focus either; a click or Alt and a letter presses them.

    Attributes
    ----------
    do : callable
        Carries out the action of a button that was pressed.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("actionBar")
        self.do: Callable[[Action], object] = lambda _action: None
        self._view: WizardView | None = None
        self._is_repeat = False
        self._released = (0, 0)  # key, and time in ms
        self._main = main_button("wizardMain")
        self._main.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._main.setToolTip(
            tr("{}, or {} from a text field").format(native(_KEY), native(_TEXT_KEY))
        )
        self._key = KeyCap("wizardMainKey", _KEY, _TEXT_KEY)
        self._why_quiet = with_name(ElidedLabel(), "wizardMainQuiet")
        self._others = [with_name(QPushButton(), f"wizardOther{i}") for i in range(MOST_OTHERS)]
        self._arming = QTimer(self, interval=_ARMING_MS, singleShot=True)
        self._lay_out()
        self._main.clicked.connect(lambda: self._ask(self._view.main if self._view else None))
        for i, other in enumerate(self._others):
            other.clicked.connect(lambda _checked=False, i=i: self._ask(self._spec(i)))
        self._arming.timeout.connect(self._arm)
        for keys, text in _KEYS.items():
            # Always enabled: the key of a disabled action would go to the focused widget.
            window = Qt.ShortcutContext.WindowShortcut
            add_action(self, text, keys, self._on_key, context=window).setAutoRepeat(False)
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        app.focusChanged.connect(self._show_key)

    def show_view(self, view: WizardView | None, *, why_quiet: str = "") -> None:
        """Show the buttons of a view; if it is None, no button can be pressed.

        A main button that nobody here needs to press is quiet: it has no accent colour, and the
        reason beside it.
        """
        before, self._view = self._view, view
        if why_quiet != self._why_quiet.text():
            self._why_quiet.setText(why_quiet)
            self._color_main()
        self._main.setEnabled(view is not None and view.main.is_enabled)
        if view is not None:
            self._main.setText(view.main.label)
        for i, button in enumerate(self._others):
            was = before.others[i] if before and i < len(before.others) else None
            spec = self._spec(i)
            if spec != was:
                button.clearFocus()  # which the button had with its previous action
                self._show_spec(button, spec)

    @property
    def is_repeat(self) -> bool:
        """True if the newest key event repeats a key that is held down."""
        return self._is_repeat

    def notice_key(self, event: QKeyEvent) -> None:
        """Examine a key event of the window before it takes effect.

        While a key is held down, an X server sends releases and presses with equal timestamps,
        which Qt does not always recognise as repeats.
        """
        key = (event.key(), event.timestamp())
        if event.type() == QEvent.Type.KeyRelease:
            self._released = key
        elif event.type() == QEvent.Type.ShortcutOverride:
            self._is_repeat = event.isAutoRepeat() or (key[1] > 0 and key == self._released)

    def press_main(self) -> None:
        """Press the main button."""
        self._main.click()

    def _lay_out(self) -> None:
        label = self._main.text()
        self._main.setText(_LONGEST_LABEL)
        self._main.setFixedSize(self._main.sizeHint().width() + 4 * SPACING_PX, 5 * SPACING_PX)
        self._main.setText(label)
        follow_theme(self, self._color_main)
        self._show_key(None, None)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(2 * SPACING_PX, SPACING_PX, 2 * SPACING_PX, SPACING_PX)
        layout.setSpacing(SPACING_PX)
        for button in self._others:
            button.hide()
            layout.addWidget(button)
        self._why_quiet.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        layout.addWidget(self._why_quiet, 1)
        layout.addWidget(self._key, 0, Qt.AlignmentFlag.AlignVCenter)
        layout.addWidget(self._main)
        self.setFixedHeight(7 * SPACING_PX)

    def _show_spec(self, button: QPushButton, spec: ButtonSpec | None) -> None:
        button.setVisible(spec is not None)
        if spec is None:
            return
        button.setText(spec.label)
        letter = native(f"Alt+{spec.label.partition('&')[2][:1].upper()}")
        if spec.discards:
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.setToolTip(f"{spec.discards} ({letter})")
            button.setEnabled(False)
            self._arming.start()
        else:
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setToolTip(tr("{}, or Return while this button has the focus").format(letter))
            button.setEnabled(spec.is_enabled)

    def _on_key(self) -> None:
        if not self._is_repeat:
            self._main.click()

    def _arm(self) -> None:
        for i, button in enumerate(self._others):
            spec = self._spec(i)
            button.setEnabled(spec is not None and spec.is_enabled)

    def _spec(self, i: int) -> ButtonSpec | None:
        others = self._view.others if self._view is not None else ()
        return others[i] if i < len(others) else None

    def _ask(self, spec: ButtonSpec | None) -> None:
        if spec is not None and spec.is_enabled:
            self.do(spec.action)

    def _show_key(self, _old: QWidget | None, new: QWidget | None) -> None:
        self._key.show_key(_TEXT_KEY if _takes_text(new) else _KEY)

    def _color_main(self) -> None:
        # Without a palette of its own, the button has the accent colour of its class.
        self._main.setPalette(QApplication.palette() if self._why_quiet.text() else QPalette())


def _takes_text(widget: QWidget | None) -> bool:
    """Return whether the space bar enters text in a widget."""
    if isinstance(widget, QComboBox):
        return widget.isEditable()
    if isinstance(widget, (QLineEdit, QTextEdit, QPlainTextEdit, QAbstractSpinBox)):
        return not widget.isReadOnly()
    return False
