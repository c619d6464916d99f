"""Progress of long tasks, and their cancellation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from handcal.core.errors import CancelledError


@dataclass(frozen=True, slots=True)
class Progress:
    """Reports how far a long task is, and ends it when asked to.

    Examples
    --------
    >>> shown = []
    >>> progress = Progress(report=lambda what, share: shown.append((what, share)))
    >>> progress.part(0.5, 1.0).at(0.5, "Writing the report")
    >>> shown
    [('Writing the report', 0.75)]
    """

    report: Callable[[str, float], object] = lambda _what, _share: None
    """Called with the present activity and the share of the whole that is done, 0 to 1."""
    is_cancelled: Callable[[], bool] = lambda: False
    span: tuple[float, float] = (0.0, 1.0)
    """Shares of the whole at which this task begins and ends."""
    what: str = ""
    """Activity reported where none is given."""

    def at(self, share: float, what: str = "") -> None:
        """Report the share of this task that is done, 0 to 1.

        Raises
        ------
        CancelledError
            If the task is to end.
        """
        self.check()
        self.show(share, what)

    def show(self, share: float, what: str = "") -> None:
        """Report as `at`, without ending the task: for tasks that keep what is done by then."""
        low, high = self.span
        self.report(what or self.what, low + share * (high - low))

    def check(self) -> None:
        """Raise CancelledError if the task is to end."""
        if self.is_cancelled():
            raise CancelledError("cancelled: nothing has changed")

    def part(self, low: float, high: float, what: str = "") -> Progress:
        """Return the progress of a part of this task, given as shares of it."""
        first, last = self.span
        width = last - first
        return replace(
            self, span=(first + low * width, first + high * width), what=what or self.what
        )
