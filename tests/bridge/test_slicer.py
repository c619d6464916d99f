"""OpenIGTLink, received by pyigtl; POLYDATA, which pyigtl cannot read, by a reader of its own."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.bridge import slicer
from handcal.bridge.bridges import Bridge
from handcal.bridge.slicer import MAX_POINTS, SlicerOutput
from handcal.cli.main import main
from handcal.core.conventions import slicer_points_mm, slicer_transform
from handcal.core.display import projection_matrix
from handcal.core.errors import LinkError
from handcal.core.geometry import invert
from handcal.core.types import Float64
from handcal.station.snapshot import Snapshot
from tests.bridge.conftest import SHIFT_M, T_W_D, placed_hand
from tests.helpers import eventually

pyigtl = pytest.importorskip("pyigtl")


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def output(said: list[str]) -> Iterator[SlicerOutput]:
    output = SlicerOutput(said.append, port=0, send_s=0.1)
    yield output
    output.close()


def receive(
    connection: socket.socket, output: SlicerOutput, snapshot: Snapshot
) -> dict[str, bytes]:
    """Send a snapshot; return all bodies that arrive, by device name, in the order of arrival."""
    output.send(snapshot)
    connection.settimeout(0.2)
    data = b""
    try:
        while chunk := connection.recv(1 << 16):
            data += chunk
    except TimeoutError:
        pass
    found = {}
    while data:
        _, kind, name, _, _, size, crc = struct.unpack(">H12s20sIIQQ", data[:58])
        body, data = data[58 : 58 + size], data[58 + size :]
        assert pyigtl.messages.CRC64(body) == crc
        found[b" ".join(one.rstrip(b"\0") for one in (kind, name)).decode()] = body
    return found


def points_of(body: bytes) -> Float64:
    """Return the points of a POLYDATA body, all of which are vertices of one cell."""
    count, cells, cell_bytes, *rest = struct.unpack(">10I", body[:40])
    assert rest == [0] * 7
    points = np.frombuffer(body, ">f4", 3 * count, 40).reshape(-1, 3)
    cell = np.frombuffer(body, ">u4", offset=40 + 12 * count)
    if count == 0:
        assert (cells, cell_bytes, len(cell)) == (0, 0, 0)
    else:
        assert (cells, cell_bytes) == (1, cell.nbytes)
        assert np.array_equal(cell, [count, *range(count)])
    return points.astype(np.float64)


def test_pyigtl_receives_transforms_and_texts(output: SlicerOutput, snapshot: Snapshot) -> None:
    client = pyigtl.OpenIGTLinkClient(*output.address)
    try:
        eventually(client.is_connected)
        output.send(snapshot)
        head = client.wait_for_message("HeadToWorld", timeout=5)
        rig = snapshot.record.rig
        T_W_H = slicer_transform(T_W_D @ invert(rig.T_H_D))
        np.testing.assert_allclose(head.matrix, T_W_H, rtol=1e-6, atol=1e-4)
        assert abs(head.timestamp - time.time()) < 10.0
        T = client.wait_for_message("LeftEyeToHead", timeout=5).matrix
        P_H = projection_matrix(rig.eyes["left"], SHIFT_M["left"]) @ rig.eyes["left"].T_V_H
        eye_H_m = -np.linalg.solve(P_H[:, :3], P_H[:, 3])
        np.testing.assert_allclose(T[:3, 3], slicer_points_mm(eye_H_m), atol=1e-3)
        text = client.wait_for_message("LeftProjection", timeout=5).string
        P = projection_matrix(rig.eyes["left"], SHIFT_M["left"])
        np.testing.assert_allclose(np.array(text.split(), float), P.ravel(), rtol=1e-8, atol=1e-12)
        assert client.wait_for_message("State", timeout=5).string == "show_hand"
        assert client.wait_for_message("Verdict", timeout=5).string == ""
    finally:
        client.stop()


def test_clouds_arrive_whole_and_what_has_not_changed_once(
    output: SlicerOutput, snapshot: Snapshot, later: Callable[..., Snapshot]
) -> None:
    with socket.create_connection(output.address) as connection:
        first = receive(connection, output, snapshot)
        assert {len(name.split()[1]) <= 20 for name in first} == {True}
        hand_mm = points_of(first["POLYDATA HandInWorld"])
        assert len(hand_mm) == 2500 <= MAX_POINTS
        hand = placed_hand()
        np.testing.assert_allclose(hand_mm, slicer_points_mm(hand.points_W_m[::2]), atol=1e-3)
        assert len(points_of(first["POLYDATA CursorInWorld"])) == 0
        again = receive(connection, output, later())
        assert set(again) == {"TRANSFORM HeadToWorld", "POLYDATA HandInWorld"}
        shown = receive(connection, output, later(cursor=hand))
        assert len(points_of(shown["POLYDATA CursorInWorld"])) == 2500
        blind = replace(later(cursor=None), observation=None)
        assert set(receive(connection, output, blind)) == {"POLYDATA CursorInWorld"}


def test_a_client_that_dies_gives_one_line(
    output: SlicerOutput, snapshot: Snapshot, said: list[str]
) -> None:
    with socket.create_connection(output.address) as connection:
        output.send(snapshot)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    for number in range(2, 5):
        output.send(replace(snapshot, number=number))
    (line,) = said
    assert line.endswith("disconnected: it has closed the connection")


def test_a_port_in_use_is_one_line(output: SlicerOutput) -> None:
    with pytest.raises(LinkError, match=r"cannot listen on 127\.0\.0\.1:.*choose another port"):
        SlicerOutput(print, port=output.address[1])


def test_it_costs_the_engine_less_than_a_millisecond(
    output: SlicerOutput, snapshot: Snapshot
) -> None:
    with Bridge(output, pytest.fail) as bridge, socket.create_connection(output.address):
        begin_s = time.thread_time()
        for number in range(200):
            bridge(replace(snapshot, number=number))
        assert (time.thread_time() - begin_s) / 200 < 1e-3


@pytest.mark.parametrize("address", ["18944", "host:", "host:x", "host:65536"])
def test_a_wrong_address_is_one_line(
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = f"run --headset virtual --camera simulator --rig none.yaml --slicer {address}"
    monkeypatch.chdir(tmp_path)  # the command creates its folder of sessions
    monkeypatch.setattr("sys.argv", ["handcal", *words.split()])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    assert "an address is HOST:PORT" in capsys.readouterr().err


def test_clients_that_never_read_delay_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    def large(_: object) -> Mapping[str, tuple[object, Callable[[], bytes]]]:
        return {"Cloud": (time.monotonic(), lambda: bytes(100_000))}

    monkeypatch.setattr(slicer, "igtl_messages", large)
    said: list[str] = []
    output = SlicerOutput(said.append, port=0, send_s=0.3)
    stuck = [socket.create_connection(output.address) for _ in range(7)]
    with socket.create_connection(output.address) as good:
        good.settimeout(1.0)
        slowest_s = 0.0
        end_s = time.monotonic() + 10.0
        while len(said) < 7 and time.monotonic() < end_s:
            began_s = time.monotonic()
            output.send(None)  # type: ignore[arg-type]
            slowest_s = max(slowest_s, time.monotonic() - began_s)
            good.recv(1 << 20)
        assert len(said) == 7
        assert all("takes no data" in one for one in said)
        assert slowest_s < 1.0  # seven that block would take 2.1 s
    for one in stuck:
        one.close()
    output.close()
