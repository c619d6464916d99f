"""A row of buttons for blinded comparisons, in the trials panel and in the station's guide."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from handcal.session.comparison import Answer, Place
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.engine_thread import Command, Submit, no_engine
from handcal_gui.widgets.fields import button, one_of, stand_out_while_checked
from handcal_gui.widgets.layouts import hbox, vbox

_SHOW: dict[Place, str] = {"first": tr("Sho&w first"), "second": tr("Sh&ow second")}
_ANSWERS: dict[Answer, str] = {
    "first": tr("First is be&tter"),
    "second": tr("Se&cond is better"),
    "neither": tr("&Neither"),
}
_COMPARE_HELP = tr(
    "Show the wearer the drawing without and with the calibration, in a hidden random order,\n"
    "and record which fits the hand better. The result stands below the trials."
)


_LOOK = tr(
    "The wearer holds the hand up, and looks at both drawings. Then the answer can be recorded."
)
_ASK = tr("Ask the wearer which drawing fits the hand better. Both can be shown again.")
_NOT_YET = tr("Show the first and the second drawing before the answer")


class ComparisonRow(QWidget):
    """Begins blinded comparisons, switches between the drawings, and takes the answer.

    Attributes
    ----------
    submit : callable
        Gives the engine a command.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._begin = button("compare", tr("Blinded &comparison"), help_text=_COMPARE_HELP)
        self.submit: Submit = no_engine
        self._show = {place: button(f"show-{place}", text) for place, text in _SHOW.items()}
        self._answers = {one: button(f"answer-{one}", text) for one, text in _ANSWERS.items()}
        self._end = button("compareEnd", tr("Stop com&paring"))
        self._shown: Place | None = None
        self._begin.clicked.connect(lambda: self._do(lambda s: s.trials.compare()))
        self._end.clicked.connect(lambda: self._do(lambda s: s.trials.comparing.end()))
        for place, one in self._show.items():
            one.setCheckable(True)
            stand_out_while_checked(one)
            one.clicked.connect(lambda _=False, place=place: self._ask(place))
        for answer, one in self._answers.items():
            one.clicked.connect(
                lambda _=False, answer=answer: self._do(lambda s: s.trials.comparing.answer(answer))
            )
        self._how = one_of({"compareLook": _LOOK, "compareAsk": _ASK})
        self._running = QWidget()
        vbox(
            self._how,
            hbox(*self._show.values(), self._end, 1, spacing=SPACING_PX),
            hbox(*self._answers.values(), 1, spacing=SPACING_PX),
            on=self._running,
            margins=0,
            spacing=SPACING_PX,
        )
        self._idle = QWidget()
        hbox(self._begin, 1, on=self._idle, margins=0, spacing=SPACING_PX)
        vbox(self._idle, self._running, on=self, margins=0)
        self.show_comparison(None, has_seen_both=False, can_begin=False)

    def show_comparison(self, shown: Place | None, *, has_seen_both: bool, can_begin: bool) -> None:
        """Show the drawing that is compared; None while there is none."""
        self._shown = shown
        self._idle.setVisible(shown is None)
        self._running.setVisible(shown is not None)
        self._begin.setEnabled(can_begin)
        for place, one in self._show.items():
            one.setChecked(place == shown)
        self._how.setCurrentIndex(int(has_seen_both))
        for one in self._answers.values():
            one.setEnabled(has_seen_both)
            one.setToolTip("" if has_seen_both else _NOT_YET)

    def _ask(self, place: Place) -> None:
        """Request a drawing; its button is checked once the station shows it."""
        self._show[place].setChecked(place == self._shown)
        self._do(lambda s: s.trials.comparing.show(place))

    def _do(self, command: Command) -> None:
        self.submit(tr("compare"), command)
