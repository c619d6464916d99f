"""The frame of a campaign: its options, its one line, its exit code."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

NOT_RUN = 77
"""Exit code of a campaign that lacks what it needs; 77 as of Automake's skipped tests."""


@dataclass(slots=True)
class Tally:
    """The counts of a campaign, and what it found wrong."""

    what: str
    """Short name of the campaign."""
    tried: int = 0
    seen: Counter[str] = field(default_factory=Counter)
    """Counts for the line, by their names; no failures."""
    failures: list[str] = field(default_factory=list)
    note: str = ""
    """More for the line."""
    end_s: float = math.inf
    """Time of the end, even if less was tried than wanted."""

    def is_done(self, wanted: int) -> bool:
        """True once as much was tried as wanted, or the time is over."""
        return self.tried >= wanted or time.monotonic() > self.end_s

    def fail(self, what: str) -> None:
        """Note a failure; the first ones are printed at once."""
        self.failures.append(what)
        if len(self.failures) <= 10:
            sys.stderr.write(f"{self.what}: {what}\n")

    def line(self, seconds: float) -> str:
        """Return the campaign in one line."""
        counts = [f"{count:,} {name}" for name, count in sorted(self.seen.items())]
        parts = [f"{self.tried:,} tried", f"{len(self.failures)} failed", *counts]
        more = f"; {self.note}" if self.note else ""
        return f"{self.what}: {', '.join(parts)}{more} ({seconds:.0f} s)"


def campaign(what: str, run: Callable[[Tally, bool], None]) -> None:
    """Run a campaign, in its short form with ``--short``; exit with 1 if anything failed.

    The exit code is `NOT_RUN` if nothing could be tried here.

    `run` gets a tally to fill, and True for the short form.
    """
    parser = argparse.ArgumentParser(description=what)
    parser.add_argument("--short", action="store_true", help="take seconds instead of minutes")
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after this time")
    arguments = parser.parse_args()
    start_s = time.monotonic()
    tally = Tally(what, end_s=start_s + 60.0 * arguments.minutes)
    run(tally, arguments.short)
    if not tally.tried and not tally.note:
        tally.fail("nothing was tried")
    print(tally.line(time.monotonic() - start_s), flush=True)  # noqa: T201
    sys.exit(1 if tally.failures else 0 if tally.tried else NOT_RUN)
