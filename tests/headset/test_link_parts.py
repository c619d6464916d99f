"""Parts of the headset's link in C#: matrices, the text of a QR code, and hostile bytes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handcal
from handcal.core.display import projection_matrix
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, Float64
from handcal.link import handcal_pb2 as pb
from handcal.link import messages
from handcal.rig.example import example_rig
from tests.headset.conftest import Ask
from tests.helpers import unity_transform

pytestmark = pytest.mark.process
NEAR_M, FAR_M = 0.1, 30.0
MOST_PX = 1e-6


def test_projection_and_view_are_those_of_to_unity(ask: Ask) -> None:
    rig = example_rig()
    rng = np.random.default_rng(5)
    for _ in range(5):
        shifts_m: dict[Eye, Float64] = {eye: rng.normal(0.0, 0.004, 3) for eye in EYES}
        solved: Any = SimpleNamespace(
            eyes={eye: SimpleNamespace(shift_m=shift_m) for eye, shift_m in shifts_m.items()}
        )
        expected = handcal.to_unity(rig, solved, near_m=NEAR_M, far_m=FAR_M)
        lines = []
        for eye in EYES:
            display = rig.eyes[eye]
            P = 3.0 * projection_matrix(display, shifts_m[eye])  # any scale is the same P
            size = display.width_px, display.height_px
            numbers = [*P.ravel(), *display.T_V_H[:3].ravel(), *size, NEAR_M, FAR_M]
            lines.append(" ".join(repr(float(number)) for number in numbers))
        for eye, line in zip(
            EYES, ask("matrices", text="\n".join(lines)).splitlines(), strict=True
        ):
            display = rig.eyes[eye]
            clip, view = np.array(line.split(" "), float).reshape(2, 4, 4)
            np.testing.assert_allclose(view, expected[eye].view_from_head, atol=1e-15)
            ours = _corners_px(clip, display.width_px, display.height_px)
            theirs = _corners_px(expected[eye].projection, display.width_px, display.height_px)
            assert np.abs(ours - theirs).max() < MOST_PX


def _corners_px(projection: Float64, width_px: int, height_px: int) -> Float64:
    """Return the pixels of points that lie near the display's corners, at three distances."""
    inverse = np.linalg.inv(projection)
    pixels = []
    for x in (-1.0, 1.0):
        for y in (-1.0, 1.0):
            ray = [inverse @ [x, y, z, 1.0] for z in (-0.9, 0.0, 0.9)]
            for point in ray:
                clip = projection @ np.round(point / point[3], 3)
                ndc = clip[:3] / clip[3]
                pixels.append([0.5 * width_px * ndc[0], 0.5 * height_px * ndc[1]])
    return np.array(pixels)


def test_the_focus_plane_is_the_virtual_image(ask: Ask) -> None:
    rig = example_rig()
    for shift_m in ([0.003, 0.001, 0.005], [0.0, 0.0, 0.004], [-0.004, 0.002, 0.0]):
        display = rig.eyes["left"]
        P, offline = projection_matrix(display, shift_m), projection_matrix(display)
        numbers = [*P.ravel(), *offline.ravel(), display.width_px, display.height_px]
        line = " ".join(repr(float(number)) for number in numbers)
        same = " ".join([*line.split(" ")[:12] * 2, *line.split(" ")[24:]])
        found_m, none = map(float, ask("focus", text=f"{line}\n{same}\n").split())
        assert found_m == pytest.approx(display.z_C0_S_m - display.t_C0_V_m[2], abs=1e-9)
        assert none == 0.0


def test_a_pose_of_unity_in_opencv_axes(ask: Ask) -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        T_unity = rigid(rng.normal(size=3), rng.normal(size=3))
        quaternion = Rotation.from_matrix(T_unity[:3, :3]).as_quat().astype(np.float32)
        line = " ".join(repr(float(number)) for number in [*T_unity[:3, 3], *quaternion])
        pose, inverse, product = np.array(ask("pose", text=line).split(), float).reshape(3, 3, 4)
        expected = unity_transform(T_unity)
        np.testing.assert_allclose(pose, expected[:3], atol=3e-7)
        np.testing.assert_allclose(inverse, np.linalg.inv(expected)[:3], atol=1e-6)
        np.testing.assert_allclose(product, np.eye(4)[:3], atol=1e-12)
        np.testing.assert_allclose(pose[:, :3] @ pose[:, :3].T, np.eye(3), atol=1e-12)
        messages.read_poses(messages.poses([(1, np.vstack([pose, [0, 0, 0, 1]]))]).poses)


CODE = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@pytest.mark.parametrize(
    ("text", "read"),
    [
        (f"HANDCAL://192.168.1.20:47800/{CODE}", f"192.168.1.20 47800 {CODE}"),
        (f" handcal://pc.lab:1/{CODE.lower()}?v=3&x=/ ", f"PC.LAB 1 {CODE}"),
        (f"HANDCAL://[fe80::1]:47800/{CODE}", f"FE80::1 47800 {CODE}"),
        (f"HANDCAL://fe80::1:47800/{CODE}", "none"),
        (f"HANDCAL://192.168.1.20/{CODE}", "none"),
        (f"HANDCAL://192.168.1.20:0/{CODE}", "none"),
        (f"HANDCAL://192.168.1.20:70000/{CODE}", "none"),
        (f"HANDCAL://192.168.1.20:+4780/{CODE}", "none"),
        (f"HANDCAL://:47800/{CODE}", "none"),
        (f"HANDCAL://192.168.1.20:47800/{CODE[1:]}", "none"),
        (f"HANDCAL://192.168.1.20:47800/{CODE[1:]}1", "none"),
        (f"https://192.168.1.20:47800/{CODE}", "none"),
        ("HANDCAL://", "none"),
        ("?", "none"),
    ],
)
def test_the_text_of_a_qr_code(ask: Ask, text: str, read: str) -> None:
    assert ask("invitation", text=text).strip() == read


def test_no_bytes_break_it(ask: Ask) -> None:
    rng = np.random.default_rng(11)
    good = [
        messages.cursor(rng.normal(size=(20, 3)), 7),
        *messages.live_hand(rng.normal(size=(20, 3)), True, 5, ["left"], is_outline=True),
        messages.prompt("Close your left eye.", ["right"]),
        pb.Envelope(show=pb.Show(offline=True)),
        pb.Envelope(projection=pb.Projection(eye=pb.EYE_LEFT, P=[1.0] * 12, width_px=9, height_px=9,
                                             T_V_H=np.eye(4)[:3].ravel())),
        pb.Envelope(ack=pb.Ack(received=[pb.Ack.Received(slot=1, message_id=2, fragments=b"\1")])),
    ]  # fmt: skip
    payloads = [message.SerializeToString() for message in good]
    changed = []
    for _ in range(3000):
        broken = bytearray(payloads[rng.integers(len(payloads))])
        for _ in range(rng.integers(1, 4)):
            broken[rng.integers(len(broken))] = rng.integers(256)
        changed.append(bytes(broken[: rng.integers(len(broken) + 1)]))
    lines = "\n".join(payload.hex() for payload in [*payloads, *changed])
    answers = ask("hostile", text=lines).splitlines()
    assert answers[: len(payloads)] == ["taken"] * len(payloads)
    assert set(answers) == {"taken", "malformed", "empty"}
    for payload, answer in zip(changed, answers[len(payloads) :], strict=True):
        if answer == "taken":
            pb.Envelope.FromString(payload)  # what the headset takes is a message
