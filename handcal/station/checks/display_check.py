"""The check that a headset's displays obey, over the link: seen by a camera, or by the wearer."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Literal, TypeAlias

import cv2
import numpy as np

from handcal.calibration.drawing import rig_name
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.display import projection_matrix, target_corners_m
from handcal.core.errors import CameraError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, DisplayCheck, Eye, HeadsetIdentity, Projection, Rig, UInt8
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Target
from handcal.rig.displays.display_check import (
    PROBES,
    Probe,
    Shown,
    UnseenError,
    displays,
    find_square,
    judge_display,
    shares_seen,
)

Show: TypeAlias = Callable[[Shown], None]
"""Has the headset show a probe, and waits until it does."""
Observe: TypeAlias = Callable[[Eye, Show], Mapping[Probe, float]]
"""Returns the share of each probe's expected movement that is seen with one eye."""
Answer: TypeAlias = Literal["whole", "part", "none"]
SETTLE_S = 0.5
_ACK_S = 6.0
_SHARES: Mapping[Answer, float] = {"whole": 1.0, "part": 0.5, "none": 0.0}


def run_display_check(
    server: HeadsetServer,
    rig: Rig,
    observe: Observe,
    observer: Literal["camera", "wearer"],
    progress: Progress = Progress(),
    eyes: Sequence[Eye] = EYES,
) -> DisplayCheck:
    """Check that what the connected headset draws moves as the projections say.

    At the end the headset draws with the offline calibration.

    Parameters
    ----------
    server : HeadsetServer
        With a connected headset.
    rig : Rig
    observe : callable
        See `by_camera` and `by_wearer`.
    observer : "camera" or "wearer"
    progress : Progress
    eyes : sequence of eye
        The eyes to check.

    Raises
    ------
    LinkError
        If the headset does not acknowledge what it is sent.
    HandcalError
        If the camera fails, or does not see what the headset draws.
    CancelledError
        If it was cancelled.
    """
    name = rig_name(rig)
    problems: dict[Eye, str] = {}
    try:
        for number, eye in enumerate(eyes):
            shown = displays(rig, eye, name)
            progress.at(number / len(eyes), f"Checking the {eye} eye's display")

            def show(what: Shown) -> None:
                progress.check()
                display = shown[what]  # noqa: B023 (called before the next eye's turn)
                messages = [server.send_projection(one) for one in display.projections.values()]
                for message in (*messages, server.send_target(display.target)):
                    server.wait_acked(message, _ACK_S)

            try:
                problems[eye] = judge_display(observe(eye, show))
            except UnseenError as error:
                raise HandcalError(f"{eye} eye: {error}") from error
            show("nothing")
    finally:
        server.send_target(None)
    headset = server.device or HeadsetIdentity("")
    return DisplayCheck(
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        observer=observer,
        device_id=headset.device_id,
        runtime=headset.runtime,
        app=headset.app,
        problems=problems,
    )


def by_camera(
    camera: ViewpointCamera, ready: Callable[[Eye], None], settle_s: float = SETTLE_S
) -> Observe:
    """Return how a viewpoint camera observes the displays.

    Parameters
    ----------
    camera : ViewpointCamera
    ready : callable
        Returns when the camera is behind the display of this eye.
    settle_s : float
        Time from the acknowledgement until a picture certainly shows what was sent.
    """

    def take() -> UInt8:
        """Return the first picture that begins after the display has settled."""
        end_ns = time.monotonic_ns() + round(1e9 * settle_s)
        while True:
            image, t_ns = camera.read()
            if t_ns >= end_ns:
                return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)

    def observe(eye: Eye, show: Show) -> Mapping[Probe, float]:
        ready(eye)
        show("nothing")
        dark = take(), take()
        found = {}
        sequence: tuple[Shown, ...] = ("rest", *PROBES)
        for what in sequence:
            show(what)
            seen = take()
            if seen.shape != dark[0].shape:
                raise CameraError("the camera's pictures changed their size", "check again")
            found[what] = find_square(dark, seen)
        return shares_seen(found)

    return observe


def by_wearer(ask: Callable[[Eye, Probe, Show], Answer]) -> Observe:
    """Return how the wearer, or another person at the display, observes it.

    Parameters
    ----------
    ask : callable
        Shows ``rest`` and the probe as often as the person wants, and returns how far the square
        moved to the right: its own width, less, or not at all.
    """

    def observe(eye: Eye, show: Show) -> Mapping[Probe, float]:
        shares = {}
        for probe in PROBES:
            show("rest")
            shares[probe] = _SHARES[ask(eye, probe, show)]
        return shares

    return observe


PATTERN_DEPTH_M = 0.5


def send_pattern(
    server: HeadsetServer, rig: Rig, eye: Eye, *, is_calibrating: bool = False
) -> tuple[Outgoing, ...]:
    """Have a headset draw the square of the user test for one eye, straight ahead.

    Parameters
    ----------
    server : HeadsetServer
    rig : Rig
        Its offline calibration is sent, because a headset draws only with a projection.
    eye : Eye
    is_calibrating : bool
        If true, no projection is sent: the headset keeps that of the calibration.

    Returns
    -------
    tuple of Outgoing
        The messages to be acknowledged; see `pattern_state`.

    Raises
    ------
    LinkError
        If the link is closed.
    """
    display = rig.eyes[eye]
    square = Target(eye, target_corners_m(PATTERN_DEPTH_M) - display.t_C0_V_m)
    sent = []
    if not is_calibrating:
        P = projection_matrix(display)
        size = display.width_px, display.height_px
        sent.append(server.send_projection(Projection(eye, P, *size, display.T_V_H)))
    return (*sent, server.send_target(square))


def pattern_state(sent: tuple[Outgoing, ...]) -> Delivery:
    """Return `ACKED` once every message is acknowledged, `FAILED` if one was not in time."""
    states = {one.state for one in sent}
    if Delivery.FAILED in states or Delivery.SUPERSEDED in states:
        return Delivery.FAILED
    return Delivery.PENDING if Delivery.PENDING in states else Delivery.ACKED
