"""A blinded comparison: the headset draws with two φ in random order, and the wearer chooses."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping

import numpy as np

from handcal.calibration.states import ProcedureError
from handcal.core.types import Eye, Float64
from handcal.session.comparison import Answer, Comparison, Drawing, Place
from handcal.session.session import Session

_SAME_M = 1e-6
_ORDERS: tuple[Drawing, ...] = ("offline", "applied")


class Comparing:
    """Runs blinded comparisons, one at a time; the order leaves it only for the journal.

    Parameters
    ----------
    session : Session
    show_offline : callable
        Has the headset draw with the offline calibration, or with the applied φ.
    draw_lot : callable
        Chooses the drawing shown first.

    Attributes
    ----------
    shown : {"first", "second"} or None
        The drawing shown; None while none is compared.
    has_seen_both : bool
    """

    def __init__(
        self,
        session: Session,
        show_offline: Callable[[bool], None],
        draw_lot: Callable[[tuple[Drawing, ...]], Drawing] = secrets.choice,
    ) -> None:
        self._session = session
        self._show_offline = show_offline
        self._draw_lot = draw_lot
        self._first: Drawing = "offline"
        self._applied_m: Mapping[Eye, Float64] = {}
        self.shown: Place | None = None
        self.has_seen_both = False

    def begin(self, applied_shift_m: Mapping[Eye, Float64]) -> None:
        """Draw the lot and show the first drawing.

        Raises
        ------
        ProcedureError
            If both drawings would be the same, or no φ is applied.
        LinkError
            If the link is closed.
        """
        if all(np.abs(shift_m).max() < _SAME_M for shift_m in applied_shift_m.values()):
            raise ProcedureError(
                "the headset draws with the offline calibration",
                "solve and apply",
            )
        self.end()
        self._applied_m = dict(applied_shift_m)
        self._first = self._draw_lot(_ORDERS)
        self._show("first")

    def show(self, place: Place) -> None:
        """Show the first or the second drawing; raises as `begin`."""
        if self.shown is None:
            raise ProcedureError("begin a comparison first")
        self._show(place)

    def answer(self, answer: Answer) -> None:
        """Record which drawing fits better, and end the comparison.

        Raises
        ------
        ProcedureError
            Unless both have been shown.
        FileError
            If the session cannot be written; the comparison continues.
        """
        if self.shown is None or not self.has_seen_both:
            raise ProcedureError("show the wearer both drawings first")
        made = Comparison(self._first, answer, self._applied_m)
        self._session.save_comparison(made)
        self.end()

    def end(self) -> None:
        """End the comparison; the headset draws with the applied φ again."""
        if self.shown is not None:
            self.shown, self.has_seen_both = None, False
            self._show_offline(False)

    def check(self, applied_shift_m: Mapping[Eye, Float64]) -> None:
        """End the comparison if another φ is applied than at its beginning."""
        if self.shown is not None and any(
            not np.array_equal(shift_m, applied_shift_m[eye])
            for eye, shift_m in self._applied_m.items()
        ):
            self.end()

    def _show(self, place: Place) -> None:
        self._show_offline((place == "first") == (self._first == "offline"))
        self.has_seen_both |= place == "second"
        self.shown = place
