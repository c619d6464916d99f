"""The wearer's nudges, from message to message and over a bad network."""

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.types import EYES, HeadsetIdentity, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import messages, nudges
from handcal.link.client import HeadsetClient
from handcal.link.drawn import DIGEST_BYTES
from handcal.link.fields import MalformedError
from handcal.link.impair import Impairment
from handcal.link.nudges import MAX_NUDGE_ARCMIN, MAX_NUDGE_SIZE, NudgeSum, VerifyRequest
from handcal.link.server import HeadsetServer, Nudge
from tests.helpers import eventually

BAD = Impairment(loss=0.3, reorder=0.2, duplicate=0.2, delay_s=0.003, seed=1)
IDENTITY = HeadsetIdentity("0000000000001234", name="Lab 1")
DRAWN = bytes(DIGEST_BYTES)
ANGLES = st.floats(-MAX_NUDGE_ARCMIN, MAX_NUDGE_ARCMIN)
SIZES = st.floats(-MAX_NUDGE_SIZE, MAX_NUDGE_SIZE)


def sent(envelope: pb.Envelope) -> pb.Envelope:
    return messages.parse(envelope.SerializeToString())


@given(st.integers(1, 2**32 - 1), st.sampled_from(EYES), st.floats(1e-3, 60), st.floats(1e-5, 0.1))
def test_a_request_arrives_as_it_was(verify_id: int, eye: str, angle: float, size: float) -> None:
    request = VerifyRequest(verify_id, "left" if eye == "left" else "right", angle, size)
    assert nudges.read_verify(sent(nudges.verify(request)).verify) == request


def test_a_request_can_be_taken_away() -> None:
    assert nudges.read_verify(sent(nudges.verify(None)).verify) is None


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf])
def test_a_request_without_positive_steps_is_refused(step: float) -> None:
    for steps in ((step, 0.002), (1.0, step)):
        message = pb.Verify(verify_id=1, eye=pb.EYE_LEFT, step_arcmin=steps[0], step_size=steps[1])
        with pytest.raises(MalformedError, match="positive"):
            nudges.read_verify(message)
    with pytest.raises(MalformedError, match="eye"):
        nudges.read_verify(pb.Verify(verify_id=1, eye=7, step_arcmin=1.0, step_size=1.0))  # type: ignore[arg-type]


@given(ANGLES, ANGLES, SIZES, st.booleans())
def test_a_nudge_arrives_as_it_was(right: float, down: float, size: float, fits: bool) -> None:
    moved = NudgeSum(right, down, size)
    message = sent(nudges.nudge(VerifyRequest(1, "left"), moved, fits, -5, DRAWN)).nudge
    assert nudges.read_nudge(message) == moved
    assert (message.fits, message.t_headset_ns) == (fits, -5)


@pytest.mark.parametrize(
    "nudge",
    [
        pb.Nudge(verify_id=1),
        pb.Nudge(verify_id=1, drawn=DRAWN, right_arcmin=math.nan),
        pb.Nudge(verify_id=1, drawn=DRAWN, down_arcmin=1.01 * MAX_NUDGE_ARCMIN),
        pb.Nudge(verify_id=1, drawn=DRAWN, size=-math.inf),
    ],
)
def test_a_nudge_that_no_wearer_makes_is_refused(nudge: pb.Nudge) -> None:
    with pytest.raises(MalformedError):
        nudges.read_nudge(nudge)


def test_nudges_and_their_request_get_through_a_bad_network(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    with HeadsetClient(server.address, pairing_key, IDENTITY, impairment=BAD) as client:
        server.send_projection(Projection("left", np.ones((3, 4)), 1268, 720))
        server.send_verify(VerifyRequest(4, "left"))
        eventually(lambda: client.state().verify and client.state().projections)
        state = client.state()
        for right in range(1, 6):
            last = client.nudge(time.monotonic_ns(), state, NudgeSum(right), fits=right == 5)
        client.wait_acked(last, 5.0)
        heard: list[Nudge] = []

        def hears(fits: bool, right: float) -> bool:
            heard.extend(server.nudges())
            return bool(heard) and heard[-1].fits == fits and heard[-1].moved == NudgeSum(right)

        eventually(lambda: hears(True, 5.0))
        assert [one.moved.right_arcmin for one in heard] == sorted(
            one.moved.right_arcmin for one in heard
        )
        newest = heard[-1]
        assert (newest.verify_id, newest.moved, newest.problem) == (4, NudgeSum(5.0), "")
        assert abs(newest.t_host_ns - time.monotonic_ns()) < 5e9
        # What was drawn before the newest projection is found out.
        server.send_projection(Projection("left", 2.0 * np.ones((3, 4)), 1268, 720))
        client.wait_acked(client.nudge(time.monotonic_ns(), state, NudgeSum(6.0)), 5.0)
        eventually(lambda: hears(False, 6.0))
        assert "other projections" in heard[-1].problem
        server.send_verify(None)
        eventually(lambda: client.state().verify is None)
        with pytest.raises(ValueError, match="nothing to verify"):
            client.nudge(0, client.state(), NudgeSum())


def test_after_good_bye_only_the_projections_stay(pairing_key: bytes) -> None:
    with HeadsetServer(pairing_key) as server:
        client = HeadsetClient(server.address, pairing_key, IDENTITY)
        with client:
            server.send_projection(Projection("left", np.ones((3, 4)), 1268, 720))
            server.send_cursor(np.ones((10, 3)), 3)
            server.send_prompt("Move the drawing", ("left",))
            server.send_verify(VerifyRequest(1, "left"))
            server.send_show(True)
            eventually(
                lambda: (
                    client.state().cursor_W_m is not None
                    and client.state().prompt
                    and client.state().verify
                    and client.state().is_offline
                    and client.state().projections
                )
            )
            server.close()
            eventually(lambda: client.dismissed)
            state = client.state()
    assert set(state.drawn) == {"left"}
    assert (state.cursor_W_m, state.prompt, state.verify, state.is_offline) == (
        None,
        "",
        None,
        False,
    )
