"""Evidence from outside the solver against a calibration.

The solver's residuals cannot show that the picture was frozen, that another camera than the rig's
gave it, or that the headset did not draw what the PC believes. Each of these is watched for
while the calibration runs. What is found refuses alignments while it lasts, or contradicts the
result, and is named.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics, Rig, UInt16
from handcal.rig.compare import compare_camera
from handcal.rig.report import depth_finding, display_finding
from handcal.session.facts import CameraUsed

FROZEN_FRAMES = 4
"""Equal pictures in a row, after which the camera counts as frozen: noise changes every picture."""
_REFUSALS = 2
_COMPARED = 20
_APART_M, _APART_RAD = 0.02, np.radians(2.0)
"""Poses of one rig in one world agree better at least once in this many frames, even while the head
moves."""


@dataclass(frozen=True, slots=True)
class Contradiction:
    """One piece of evidence against a calibration."""

    name: str
    """Short name, as in ``handcal demo --fault``."""
    text: str
    """A sentence for the technician, with advice."""


class Evidence:
    """Collects evidence during one calibration.

    Parameters
    ----------
    rig : Rig
    earlier : sequence of Contradiction
        Evidence found before the session was interrupted.
    used : CameraUsed, optional
        The camera of a resumed session; frames of another one are not used.
    """

    def __init__(
        self, rig: Rig, earlier: Sequence[Contradiction] = (), used: CameraUsed | None = None
    ) -> None:
        self._rig = rig
        self._used = used
        self._not_sessions = ""
        self._found = {one.name: one for one in earlier}
        self._camera: tuple[CameraIdentity, Intrinsics] | None = None
        self._last: Frame | None = None
        self._equal = 0
        self._drawn_otherwise = 0
        self._apart: deque[tuple[float, float]] = deque(maxlen=_COMPARED)
        if rig.depth_check is not None and not (finding := depth_finding(rig.depth_check)).is_fine:
            self._add(
                "depth-bias",
                f"the rig's depth check found {finding.found}; calibrate the depth camera, or "
                "check it again",
            )

        if rig.display_check is not None:
            shown = display_finding(rig.display_check)
            if not shown.is_fine:
                self._add("disobeying-display", f"the headset does not obey: {shown.found}")

    @property
    def contradictions(self) -> tuple[Contradiction, ...]:
        """All evidence so far against the result."""
        return tuple(self._found.values())

    def see(
        self, frame: Frame, identity: CameraIdentity, *, is_used: bool = True
    ) -> Contradiction | None:
        """Look at a frame; return what forbids using it, if anything does.

        A frozen picture passes by, so it forbids frames only while it lasts. Another camera
        contradicts the whole calibration, unless it is replaced before any frame `is_used` in an
        alignment.
        """
        if (identity, frame.depth_intrinsics) != self._camera:
            self._camera = identity, frame.depth_intrinsics
            differences = compare_camera(self._rig, identity, frame.depth_intrinsics)
            self._not_sessions = self._compare_with_session(identity, frame.depth_intrinsics)
            if not is_used:
                self._found.pop("other-camera", None)
            if differences:
                self._add(
                    "other-camera",
                    f"the camera is not the rig's: {'; '.join(differences)}. Connect the rig's "
                    "camera, or choose the rig file of this one",
                )
        last, self._last = self._last, frame
        is_equal = last is not None and _is_same(last.depth, frame.depth)
        self._equal = self._equal + 1 if is_equal else 0
        if self._not_sessions:
            return Contradiction(
                "session-camera",
                f"this session was made with another camera: {self._not_sessions}. Choose its "
                "camera on the start page, or begin a new calibration",
            )
        if self._equal < FROZEN_FRAMES:
            return None
        return Contradiction(
            "frozen-camera",
            "the camera's picture does not change; unplug the camera and plug it in again",
        )

    def see_delay(self, delay_s: float | None, limit_s: float) -> Contradiction | None:
        """Return what forbids using frames that arrive this long after their exposure."""
        if delay_s is None or delay_s <= limit_s:
            return None
        return Contradiction(
            "late-camera",
            f"the camera's pictures arrive {1e3 * delay_s:.0f} ms after their exposure, more than "
            f"{1e3 * limit_s:.0f} ms; close other programs, and connect the camera directly",
        )

    def see_delivery(self, is_lost: bool) -> Contradiction | None:
        """Return what forbids using frames while it is unknown what a connected headset draws."""
        if not is_lost:
            return None
        return Contradiction(
            "lost-start",
            "the headset does not acknowledge the projections sent to it; restart its app",
        )

    def see_clock(self, step_s: float) -> Contradiction | None:
        """Return what forbids using frames just after the headset's clock was set."""
        if step_s == 0.0:
            return None
        return Contradiction(
            "clock-step",
            f"the headset's clock was set by {step_s:+.2f} s; wait a moment, and if this happens "
            "again, restart the headset's app",
        )

    def see_poses(self, by_camera: Float64, by_app: Float64) -> None:
        """Compare T_W_D (4, 4) as the camera reports it and as it follows from the app's pose."""
        difference = invert(by_camera) @ by_app
        turn_rad = float(Rotation.from_matrix(difference[:3, :3]).magnitude())
        self._apart.append((float(np.linalg.norm(difference[:3, 3])), turn_rad))

    @property
    def other_world(self) -> Contradiction | None:
        """Evidence that forbids frames while camera and app refer to different worlds or rigs."""
        if len(self._apart) < _COMPARED:
            return None
        apart_m, turn_rad = (min(values) for values in zip(*self._apart, strict=True))
        if apart_m <= _APART_M and turn_rad <= _APART_RAD:
            return None
        return Contradiction(
            "other-world",
            f"the camera is {1e3 * apart_m:.0f} mm and {np.degrees(turn_rad):.0f}° from where the "
            "headset's app and the rig file place it; let the app use the world of hl2ss, and "
            "measure the camera's pose again (handcal rig make --factory)",
        )

    def drawn_otherwise(self, problem: str) -> None:
        """Note that a confirmation was refused because the headset drew something else."""
        self._drawn_otherwise += 1
        if self._drawn_otherwise >= _REFUSALS:
            self._add(
                "stale-headset",
                f"the headset does not draw what was sent to it ({problem}); restart its app",
            )

    @property
    def is_drawn_otherwise(self) -> bool:
        """True if the last confirmation from the headset was refused for what it drew."""
        return self._drawn_otherwise > 0

    def drawn_as_sent(self) -> None:
        """Note that a confirmation was drawn as it was sent."""
        self._drawn_otherwise = 0
        self._found.pop("stale-headset", None)

    def _compare_with_session(self, identity: CameraIdentity, intrinsics: Intrinsics) -> str:
        """Return how a camera differs from that of the resumed session; empty if it does not."""
        if self._used is None:
            return ""
        known = self._used.identity
        if known.model and known.model != identity.model:
            return f"{known.model}, not {identity.model or 'one without a name'}"
        sessions = replace(
            self._rig, depth_camera=known, depth_intrinsics=self._used.depth_intrinsics
        )
        return "; ".join(compare_camera(sessions, identity, intrinsics))

    def _add(self, name: str, text: str) -> None:
        self._found[name] = Contradiction(name, text)


def _is_same(one: UInt16, other: UInt16) -> bool:
    """Compare two pictures; a few rows tell those of a live camera apart in a tenth of the time."""
    return all(np.array_equal(one[::every], other[::every]) for every in (16, 1))
