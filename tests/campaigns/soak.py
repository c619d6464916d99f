"""A station that runs for long: memory, handles and threads at the end and at a quarter.

Three alignments are confirmed and solved. From then on cursors are made and discarded, so that
nothing has to grow: an alignment stays in memory, even when it is deleted.
"""

from __future__ import annotations

import gc
import os
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean

from handcal.calibration.states import State
from handcal.core.errors import HandcalError
from handcal.core.types import EYES
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from tests.campaigns.campaign import Tally, campaign
from tests.helpers import write_small_rig

FRAMES, SHORT_FRAMES = 20_000, 45
GROWTH_MAX = 1.02
SHORT_GROWTH_MAX_MB = 20.0
"""From a third of a short run to its end: what is solved and imported late takes up to 10 MB."""
ALIGNMENTS = 3
_READY = State.SHOW_HAND, State.APPLIED


def soak(tally: Tally, is_short: bool) -> None:
    wanted = SHORT_FRAMES if is_short else FRAMES
    with tempfile.TemporaryDirectory() as folder:
        rig = write_small_rig(Path(folder) / "rig.yaml")
        settings = StationSettings(seed=1, rig=str(rig), sessions=str(Path(folder) / "sessions"))
        with Station(settings, "soak") as station:
            looks = list(_watch(station, wanted, tally))
    if tally.tried < wanted:
        tally.note = f"{wanted:,} wanted; "
    if len(looks) < 10:
        tally.fail(f"only {len(looks)} looks at the memory")
        return
    if is_short:
        third, end = looks[len(looks) // 3], looks[-1]
        growth_mb = (end[0] - third[0]) / 2**20
        tally.note += f"memory {growth_mb:+.1f} MB from a third on"
        if growth_mb > SHORT_GROWTH_MAX_MB:
            tally.fail(f"the memory grew by {growth_mb:.1f} MB")
        if end[1] > third[1] or end[2] > third[2]:
            tally.fail("handles or threads grew")
        return
    quarter, end = looks[len(looks) // 4], looks[-1]
    # The allocator's share rises and falls by some 3 % from look to look, so a tenth is averaged.
    tenth = max(1, len(looks) // 10)
    around, last = looks[2 * tenth : 3 * tenth], looks[-tenth:]
    before_mb, after_mb = (fmean(look[0] for look in some) / 2**20 for some in (around, last))
    growth = after_mb / before_mb
    tally.note += (
        f"memory {before_mb:.1f} MB around a quarter, {after_mb:.1f} MB over the last tenth "
        f"({growth:.3f} times), handles {quarter[1]} and {end[1]}, "
        f"threads {quarter[2]} and {end[2]}"
    )
    if growth > GROWTH_MAX:
        tally.fail(f"the memory grew {growth:.3f} times")
    if end[1] > quarter[1] or end[2] > quarter[2]:
        tally.fail("handles or threads grew")


def _watch(station: Station, wanted: int, tally: Tally) -> Iterator[tuple[int, int, int]]:
    """Step the station; give memory, handles and threads every hundredth of the way."""
    calibration = station.calibration
    while not tally.is_done(wanted):
        snapshot = station.step()
        if snapshot.problem:
            tally.seen["problems told"] += 1
        if snapshot.observation is None:
            continue
        tally.tried += 1
        try:
            if calibration.state is State.ALIGNED:
                tally.seen["alignments"] += 1
                calibration.solve()
                calibration.apply()
            elif calibration.state in _READY and snapshot.observation.is_steady:
                calibration.make_cursor(EYES)
                tally.seen["cursors"] += 1
                if len(calibration.alignments) >= ALIGNMENTS:
                    calibration.redo()
        except HandcalError as error:
            tally.seen[f"told: {str(error)[:60]}"] += 1
        if tally.tried % max(1, wanted // 100) == 0:
            gc.collect()
            yield _look()


def _look() -> tuple[int, int, int]:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    handles = len(list(Path("/proc/self/fd").iterdir()))
    return pages * os.sysconf("SC_PAGE_SIZE"), handles, threading.active_count()


if __name__ == "__main__":
    campaign("soak: frames of a running station", soak)
