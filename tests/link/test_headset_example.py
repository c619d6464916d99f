"""The headset app that ships as an example, run as its reader would."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from typing import IO

import numpy as np
import pytest

from handcal.core.display import target_corners_m
from handcal.link.pairing import KEY_VARIABLE
from handcal.link.server import Confirmation, HeadsetServer
from handcal.link.shapes import Target
from tests.helpers import ROOT

PATIENCE_S = 20.0


@pytest.mark.process
def test_the_example_draws_confirms_and_ends_with_the_pc(pairing_key: bytes) -> None:
    with HeadsetServer(pairing_key) as server:
        process = subprocess.Popen(
            [sys.executable, ROOT / "examples/08_headset_client.py", *map(str, server.address)],
            env=os.environ | {KEY_VARIABLE: pairing_key.decode()},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        server.send_cursor(np.zeros((10, 3)), 7, ("right",))
        server.send_prompt("Close your left eye.", ("right",))
        server.send_target(Target("right", target_corners_m(0.5)))
        lines = [""]
        while not all(
            what in lines[-1] for what in ("cursor 7 for right", "Close", "of the right eye")
        ):
            lines.append(process.stdout.readline())
            assert lines[-1], "the example ended"
        confirmation = _confirm(process.stdin, server)
    assert confirmation.cursor_id == 7
    assert confirmation.problem == ""
    rest, _ = process.communicate(timeout=PATIENCE_S)
    assert rest.endswith("The PC said good-bye\n")
    assert process.returncode == 0


def _confirm(stdin: IO[str], server: HeadsetServer) -> Confirmation:
    """Press Enter, and return what the PC hears."""
    stdin.write("\n")
    stdin.flush()
    end_s = time.monotonic() + PATIENCE_S
    while not (heard := server.confirmations()):
        assert time.monotonic() < end_s, "nothing was confirmed"
        time.sleep(0.01)
    return heard[0]
