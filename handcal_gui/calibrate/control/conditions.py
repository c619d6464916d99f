"""The message about the worst problem at present; it does not flash or appear during the start."""

from __future__ import annotations

from dataclasses import replace

from handcal.calibration.sight import Observation
from handcal.camera.feed import CameraStatus
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr

_LASTS_S = 0.8
"""Time for which a problem lasts before it is shown."""
_STARTING_S = 4.0
"""The same before the first frame and pose: camera and headset take time to start."""
_SLOW_HZ, _FAST_HZ = 8.0, 10.0
"""Frame rates below which, and above which again, hand and confirmation are hard to match."""
_SLOW_S = 3.0
_FEW_POSES_HZ = 5.0
"""Poses a second below which no hand can be placed in time."""
_FEW_POSES = tr("The headset sends too few poses to place a hand; close other programs on it")


class Conditions:
    """Watches the snapshots of one calibration.

    Parameters
    ----------
    is_usb : bool
        True if the camera is connected by USB, which may be too slow.
    is_virtual : bool
        True if the headset is virtual: without it the simulated camera sees nothing.

    Attributes
    ----------
    is_slow : bool
        True if too few frames per second are processed.
    """

    def __init__(self, *, is_usb: bool = False, is_virtual: bool = False) -> None:
        self.is_slow = False
        self._is_usb = is_usb
        self._is_virtual = is_virtual
        self._is_camera = False  # it gives few frames, and none is lost in this computer
        self._since: tuple[float, int] | None = None  # time, and frames that were dropped by then
        self._problem, self._problem_since_s = "", 0.0
        self._hand_problem, self._hand_since_s = "", 0.0
        self._seen: Observation | None = None
        self._seen_s = 0.0
        self._has_started = False

    def condition(self, snapshot: Snapshot, *, needs_frames: bool = True) -> str:
        """Return the message about the most important problem that lasts; empty if there is none.

        Parameters
        ----------
        snapshot : Snapshot
            The newest one.
        needs_frames : bool
            Whether few frames per second matter at the present step.
        """
        now_s = 1e-9 * snapshot.t_host_ns
        camera, link = snapshot.camera, snapshot.link
        self._has_started |= camera.rate_hz > 0 and link.pose_rate_hz > 0
        self._watch_rate(camera, now_s)
        # The only virtual headset that asks to connect is the connected one, after a stall.
        is_stall = self._is_virtual and snapshot.link_problem == link.notice
        link_problem = "" if is_stall else snapshot.link_problem
        ended = link_problem if self._is_virtual and self._has_started else ""
        found = (
            (tr("{}; press Restart headset in Link").format(ended.rstrip(".")) if ended else "")
            or snapshot.not_stored
            or (tr("{}; see Link").format(snapshot.problem) if snapshot.problem else "")
            or camera.problem
            or link_problem
            or (_FEW_POSES if link.connected and link.pose_rate_hz < _FEW_POSES_HZ else "")
            or snapshot.contradiction
            or (self._slow_text(camera.rate_hz) if needs_frames else "")
        )
        if found != self._problem:
            is_first = not self._problem
            self._problem = found
            if is_first or not found:
                self._problem_since_s = now_s
        lasts_s = _LASTS_S if self._has_started else _STARTING_S
        return found if now_s - self._problem_since_s >= lasts_s else ""

    def calm(self, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot without a passing problem of a hand that is seen.

        While the camera is late, the newest observation stays.
        """
        seen, now_s = snapshot.observation, 1e-9 * snapshot.t_host_ns
        if seen is not None:
            self._seen, self._seen_s = seen, now_s
        elif self._is_late(snapshot, now_s):
            seen = self._seen
            snapshot = replace(snapshot, observation=seen)
        problem = "" if seen is None or seen.cloud is None else seen.problem
        if bool(problem) != bool(self._hand_problem):
            self._hand_since_s = now_s
        self._hand_problem = problem
        if seen is None or not problem or now_s - self._hand_since_s >= _LASTS_S:
            return snapshot
        return replace(snapshot, observation=replace(seen, problem=""))

    def _is_late(self, snapshot: Snapshot, now_s: float) -> bool:
        """Return True if the newest observation still holds: its next frame is only late."""
        is_same_state = self._seen is not None and self._seen.state is snapshot.procedure.state
        is_new = now_s - self._seen_s < _LASTS_S
        return is_same_state and is_new and not snapshot.camera.problem

    def _watch_rate(self, camera: CameraStatus, now_s: float) -> None:
        """Note that frames are few, or that it is over, once this has lasted."""
        is_few = camera.rate_hz < (_FAST_HZ if self.is_slow else _SLOW_HZ)
        if not self._has_started or camera.rate_hz == 0.0 or is_few == self.is_slow:
            self._since = None
        elif self._since is None:
            self._since = now_s, camera.dropped
        elif now_s - self._since[0] >= _SLOW_S:
            # Frames that the camera counted, but nobody took, are lost in this computer.
            self._is_camera = self._is_usb and camera.dropped == self._since[1]
            self.is_slow, self._since = is_few, None

    def _slow_text(self, rate_hz: float) -> str:
        """Return the warning about few frames, with what it leads to; empty if there are enough."""
        if not self.is_slow or rate_hz >= _SLOW_HZ:
            return ""
        advice = tr("close other programs")
        if self._is_camera:
            advice = tr("plug the camera into a USB 3 port")
        text = tr(
            "images per second: {:.0f}, fewer than {:.0f}; {}, or confirmations may be refused"
        )
        return text.format(rate_hz, _SLOW_HZ, advice)
