import os
from pathlib import Path

import pytest

from handcal.errors import FileError, LinkError
from handcal.link.pairing import (
    KEY_VARIABLE,
    MAX_DEVICES,
    Pairing,
    Pairings,
    new_pairing_key,
    read_pairing_key,
)


def test_the_key_comes_from_the_environment_or_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, other = new_pairing_key(), new_pairing_key()
    assert key != other
    monkeypatch.setenv(KEY_VARIABLE, key)
    (tmp_path / "key").write_text(other + "\n")
    assert read_pairing_key() == key.encode()
    assert read_pairing_key(tmp_path / "key") == other.encode()


def test_no_key_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    with pytest.raises(LinkError, match=KEY_VARIABLE):
        read_pairing_key()
    (tmp_path / "key").write_text("\n")
    with pytest.raises(LinkError, match="no pairing key"):
        read_pairing_key(tmp_path / "key")
    with pytest.raises(FileError):
        read_pairing_key(tmp_path / "absent")
    monkeypatch.setenv(KEY_VARIABLE, "short")
    with pytest.raises(LinkError, match="5 bytes; use at least 16"):
        read_pairing_key()


def test_any_bytes_are_a_key(monkeypatch: pytest.MonkeyPatch) -> None:
    key = b"\xff\xfe" * 8
    monkeypatch.setenv(KEY_VARIABLE, os.fsdecode(key))
    assert read_pairing_key() == key


def test_a_key_belongs_to_the_device_that_connects_first(tmp_path: Path) -> None:
    path = tmp_path / "config" / "pairing.key"
    pairings = Pairings.read(path)
    key = pairings.open_key()
    assert Pairings.read(path).open_key() == key
    pairings.bind(pairings.all[0], "00000000000000ff", "Lab 2")
    assert Pairings.read(path).all == (Pairing(key, "00000000000000ff", "Lab 2"),)
    assert pairings.open_key() != key
    if os.name == "posix":
        assert path.stat().st_mode & 0o777 == 0o600
    assert pairings.renew() not in (key, "")
    assert len(Pairings.read(path).all) == 1


def test_a_device_that_is_paired_again_has_its_new_key_only() -> None:
    pairings = Pairings(())
    for _ in range(2):
        key = pairings.open_key()
        pairings.bind(pairings.all[-1], "00000000000000ff", "Lab 2")
    assert pairings.all == (Pairing(key, "00000000000000ff", "Lab 2"),)


def test_the_number_of_devices_is_limited() -> None:
    pairings = Pairings(())
    for number in range(MAX_DEVICES + 3):
        pairings.open_key()
        pairings.bind(pairings.all[-1], f"{number:016x}", "")
    assert [int(one.device_id, 16) for one in pairings.all] == list(range(3, MAX_DEVICES + 3))


def test_the_bare_key_of_version_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / "pairing.key"
    path.write_text("a key of the first version\n")
    assert Pairings.read(path).all == (Pairing("a key of the first version"),)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"short",
        b"\xff" * 20,
        b"k" * 5000,
        b"{}",
        b'{"devices": 1}',
        b'{"devices": [1]}',
        b'{"devices": [{"key": "short"}]}',
        b'{"devices": [{"key": 12345678901234567890}]}',
        b'{"devices": [{"key": "long enough for a key", "device_id": "FF"}]}',
        b'{"devices": [{"key": "long enough for a key", "colour": "red"}]}',
        b'{"devices": ' + b"[" * 5000,
    ],
)
def test_a_damaged_file_is_said_and_left_alone(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "pairing.key"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"pairing\.key") as error:
        Pairings.read(path)
    assert "\n" not in str(error.value)
    assert path.read_bytes() == content
