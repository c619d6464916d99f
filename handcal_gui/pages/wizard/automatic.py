"""Automatic steps: a main button that stays enabled long enough is pressed by the program."""

from __future__ import annotations

from handcal_gui.pages.wizard.view import Action, Step, WizardView

_LAPSE_S = 0.4
"""A main button that is disabled for less time is not waited for from the start again."""


class Automatic:
    """Measures how long the main button of a view has been enabled.

    Attributes
    ----------
    is_held : bool
        True if every step waits for a person.
    """

    def __init__(self) -> None:
        self.is_held = False
        self._shown: tuple[Step, Action, str] | None = None
        self._since_s = self._enabled_s = 0.0
        self._tries = 0

    def share(self, view: WizardView, now_s: float) -> float | None:
        """Return the share of the waiting time that has passed, 0 to 1; None if a person decides.

        Parameters
        ----------
        view : WizardView
            The view at this moment.
        now_s : float
            The time on any monotonic clock.
        """
        shown = view.step, view.main.action, view.main.label
        if shown != self._shown:
            is_same_step = self._shown is not None and self._shown[0] is view.step
            self._tries = self._tries if is_same_step else 0
            self._shown, self._since_s = shown, now_s
        if self.is_held or view.runs_after_s is None:
            self._since_s = now_s
            return None
        if view.main.is_enabled:
            self._enabled_s = now_s
        elif now_s - self._enabled_s > _LAPSE_S:
            self._since_s = now_s
        wait_s = view.runs_after_s * 2.0**self._tries
        share = min((now_s - self._since_s) / wait_s, 1.0)
        return share if view.main.is_enabled else min(share, 0.99)

    def note_pressed(self, now_s: float) -> None:
        """Start to wait again, twice as long, as the step may have failed."""
        self._since_s = now_s
        self._tries += 1
