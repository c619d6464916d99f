"""A minimal headset app: it does what the app of a real headset does. Start your own from it.

    HANDCAL_PAIRING_KEY=KEY python 08_headset_client.py HOST PORT

It introduces itself, sends its pose 60 times per second, prints what to draw whenever that
changes, and confirms an alignment on Enter. It needs no rig file. Ctrl+C, or the PC, ends it.
"""

from __future__ import annotations

import sys
import threading
import time

import numpy as np

from handcal.core.errors import HandcalError
from handcal.core.types import Float64, HeadsetIdentity
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.pairing import read_pairing_key

IDENTITY = HeadsetIdentity("0123456789abcdef", "Example", runtime="none", app="example 08")
"""A real app creates a random identity once, stores it, and reports the views of its runtime."""
PERIOD_S = 1 / 60


def main() -> None:
    """Connect, and run until the PC closes the link."""
    host, port = sys.argv[1], int(sys.argv[2])
    told = ""
    with HeadsetClient((host, port), read_pairing_key(), IDENTITY) as client:
        threading.Thread(target=confirm_on_enter, args=(client,), daemon=True).start()
        while not client.dismissed:
            client.send_pose(pose_of_headset(), time.monotonic_ns())
            state = client.state()
            telling = what_to_draw(state)
            if not client.connected:
                telling = client.refusal or "Waiting for the PC"
            if telling != told:
                told = telling
                tell(told)
            time.sleep(PERIOD_S)
    tell("The PC said good-bye")


def pose_of_headset() -> Float64:
    """Return T_W_H, which the headset's tracking knows; here it stands still."""
    return np.eye(4)


def what_to_draw(state: HeadsetState) -> str:
    """Return in words what an app draws, for each eye with its P; the target for one eye only."""
    cursor = (
        "no cursor"
        if state.cursor_W_m is None
        else f"cursor {state.cursor_id} for {' and '.join(state.cursor_eyes)}"
    )
    hand = (
        "no hand" if state.live_W_m is None else f"{'red' if state.is_over_limit else 'blue'} hand"
    )
    shape = (
        "no shape" if state.shape is None else f"a shape of {len(state.shape.corners_W_m)} corners"
    )
    target = "no target" if state.target is None else f"the target of the {state.target.eye} eye"
    eyes = " and ".join(sorted(state.drawn)) or "no eye"
    what = f"{cursor}, {hand}, {target}, {shape}"
    return f"Draw {what}, with P and T_V_H of {eyes}; say “{state.prompt}”"


def confirm_on_enter(client: HeadsetClient) -> None:
    """Confirm that the hand covers the cursor, with what is drawn at that moment."""
    for _line in sys.stdin:
        client.confirm(time.monotonic_ns(), client.state())


def tell(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    try:
        main()
    except HandcalError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        pass
