"""The test square: shows a wearer, before a calibration, that the headset draws what is sent."""

from __future__ import annotations

from handcal.core.display import projection_matrix, target_corners_m
from handcal.core.types import Eye, Projection, Rig
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Target

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
