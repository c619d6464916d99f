"""The commands for paired headsets."""

import io
import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from handcal.core.types import HeadsetIdentity
from handcal.link import inviting
from handcal.link.ask_to_pair import pair_by_code
from handcal.link.client import HeadsetClient
from handcal.link.invitation import read_invitation
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import HeadsetServer
from tests.helpers import eventually

DEVICE, OTHER = "00000000000000aa", "00000000000000bb"
PORT = 47941


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    path = tmp_path / "pairing.key"
    pairings = Pairings.read(path)
    for device, name in ((DEVICE, "Lab 1"), (OTHER, "[bold]Lab 2")):
        key = f"the pairing key of {device}"
        pairings.bind(Pairing(key), device, name)
    return path


def test_devices_are_listed_renamed_and_revoked(
    handcal: Callable[..., None], keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    handcal("devices", "--keys", keys)
    shown = capsys.readouterr().out
    assert re.search(rf"{DEVICE} +Lab 1", shown)
    assert "[bold]Lab 2" in shown
    assert "the pairing key" not in shown
    handcal("devices", "--keys", keys, "--rename", DEVICE, "Ward", "--revoke", OTHER)
    shown = capsys.readouterr().out
    assert re.search(rf"{DEVICE} +Ward", shown)
    assert OTHER not in shown
    handcal("devices", "--keys", keys, "--revoke", DEVICE)
    assert "handcal pair" in capsys.readouterr().out
    assert Pairings.read(keys).all == ()


@pytest.mark.parametrize(
    ("words", "code", "problem"),
    [
        (["--revoke", "ff"], 1, "no device 'ff' is paired"),
        (["--rename", DEVICE, 41 * "n"], 2, "40 characters"),
        (["--rename", DEVICE, "two\nlines"], 2, "control characters"),
    ],
)
def test_a_wrong_device_or_name_changes_nothing(
    fails: Callable[..., tuple[int, str]], keys: Path, words: list[str], code: int, problem: str
) -> None:
    before = keys.read_bytes()
    ended, error = fails("devices", "--keys", keys, *words)
    assert (ended, problem in error) == (code, True)
    assert keys.read_bytes() == before


def test_a_headset_is_paired_by_what_is_shown(
    handcal: Callable[..., None],
    keys: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown: list[str] = []

    class Silent:
        def __init__(self, _address: object) -> None: ...
        def __enter__(self) -> None: ...
        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(inviting, "Announcement", Silent)

    def connect() -> None:
        def is_shown() -> bool:
            shown.append(capsys.readouterr().out)
            return "type HANDCAL://" in "".join(shown)

        eventually(is_shown, 20.0)
        invitation = read_invitation("".join(shown).split("type ")[1].split()[0])
        address = (invitation.host, invitation.port)
        key = pair_by_code(invitation, "c" * 16).encode()
        with HeadsetClient(address, key, HeadsetIdentity("c" * 16)) as client:
            client.wait_connected(5.0)

    thread = threading.Thread(target=connect)
    thread.start()
    handcal("pair", "--keys", keys, "--host", "127.0.0.1", "--port", PORT)
    thread.join()
    text = "".join(shown) + capsys.readouterr().out
    assert f"Paired: a headset ({'c' * 16})" in text
    assert re.search(r"type \d{4} \d{4}", text)
    assert Pairings.read(keys).all[-1].device_id == "c" * 16


@pytest.mark.parametrize("options", [[], ["--port", PORT]], ids=["by the text", "by the digits"])
def test_the_virtual_headset_is_paired(
    options: list[object],
    handcal: Callable[..., None],
    keys: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with HeadsetServer(Pairings.read(keys), ("127.0.0.1", PORT)) as server:
        invitation = server.invite()
        code = invitation.digits if options else invitation.text
        monkeypatch.setattr(sys, "stdin", io.StringIO(code + "\n"))
        handcal("headset", "--pair", "--as-device", "--duration-s", 0.5, *options)
    assert len(Pairings.read(keys).all) == 3


@pytest.mark.parametrize(
    ("words", "typed", "problem"),
    [
        (["--pair"], "HANDCAL://nothing", "not an invitation"),
        (["--pair"], "", "not an invitation"),
        (["--pair", "--port", "47941"], "1234", "8 digits, not 4"),
        ([], "", "--port and a pairing key, or --pair"),
    ],
)
def test_a_virtual_headset_without_an_address_is_refused(
    words: list[str],
    typed: str,
    problem: str,
    fails: Callable[..., tuple[int, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    assert problem in fails("headset", *words)[1]
