"""Pairing of one headset, without a station."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack

from handcal.core.errors import LinkError
from handcal.core.progress import Progress
from handcal.link.discovery import Announcement
from handcal.link.invitation import Invitation
from handcal.link.pairing import OFFER_S, Pairing, Pairings
from handcal.link.server import HeadsetServer
from handcal.link.transport import Address

_LOG = logging.getLogger(__name__)
_POLL_S = 0.1


def run_pairing(
    bind: Address,
    pairings: Pairings,
    show: Callable[[Invitation], None],
    progress: Progress = Progress(),
    timeout_s: float = OFFER_S,
) -> Pairing:
    """Invite one new headset, and return it once it is paired.

    Parameters
    ----------
    bind : (host, port)
        Address on which to listen; the station's own, so that the headset can keep using it.
    pairings : Pairings
    show : callable
        Called with the invitation, to show it.
    progress : Progress
        Reported to while waiting.
    timeout_s : float

    Raises
    ------
    LinkError
        If the port is in use, there is no network, or no new headset connects in time.
    CancelledError
        If it was cancelled.
    """
    known = set(pairings.all)
    with ExitStack() as stack:
        try:
            server = stack.enter_context(HeadsetServer(pairings, bind))
        except LinkError as error:
            advice = f"if handcal is open, pair there, or close it; otherwise {error.advice}"
            raise LinkError(error.what, advice) from error
        invitation = server.invite()
        show(invitation)
        try:
            stack.enter_context(Announcement((invitation.host, invitation.port)))
        except LinkError as error:
            _LOG.warning("%s; type the address into the headset", error)
        start_s = time.monotonic()
        while (waited_s := time.monotonic() - start_s) < timeout_s:
            attempts = str(server.pairing_attempts)
            what = f"Waiting for the headset: {attempts}" if attempts else "Waiting for the headset"
            progress.at(waited_s / timeout_s, what)
            if added := set(pairings.all) - known:
                return added.pop()
            time.sleep(_POLL_S)
    raise LinkError(f"no new headset connected within {timeout_s / 60:g} min", "pair again")
