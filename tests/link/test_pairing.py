import os
from pathlib import Path

import pytest

from handcal.core.errors import FileError, LinkError
from handcal.io.lock import FileLock
from handcal.link.pairing import (
    KEY_VARIABLE,
    MAX_DEVICES,
    OFFER_S,
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


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
@pytest.mark.parametrize(("mode", "is_warned"), [(0o600, False), (0o640, True), (0o604, True)])
def test_a_key_that_others_can_read_causes_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, mode: int, is_warned: bool
) -> None:
    device, all_devices = tmp_path / "key", tmp_path / "pairing.key"
    device.write_text(new_pairing_key())
    Pairings.read(all_devices).open_key()
    for path in (device, all_devices):
        path.chmod(mode)
    read_pairing_key(device)
    pairings = Pairings.read(all_devices)
    named = [str(path) for path in (device, all_devices) if f"keys in {path}:" in caplog.text]
    assert named == ([str(device), str(all_devices)] if is_warned else [])
    pairings.renew()
    assert all_devices.stat().st_mode & 0o777 == 0o600


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


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"short",
        b"\xff" * 20,
        b"k" * 5000,
        b"a key without its list",
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


def test_an_offered_key_is_for_one_device_and_a_limited_time(tmp_path: Path) -> None:
    path = tmp_path / "pairing.key"
    pairings = Pairings.read(path)
    first, second = new_pairing_key(), new_pairing_key()
    pairings.offer(first, now_s=0.0)
    pairings.offer(second, now_s=1.0)
    assert not path.exists()
    assert [one.key for one in pairings.offered(OFFER_S - 1.0)] == [first, second]
    pairings.bind(pairings.offered(0.0)[0], "00000000000000ff", "Lab 2")
    assert Pairings.read(path).all == (Pairing(first, "00000000000000ff", "Lab 2"),)
    assert [one.key for one in pairings.offered(OFFER_S)] == [second]
    assert not pairings.offered(OFFER_S + 1.0)
    pairings.offer(first)
    pairings.withdraw()
    assert not pairings.offered(0.0)


def test_devices_are_renamed_and_revoked(tmp_path: Path) -> None:
    path = tmp_path / "pairing.key"
    pairings = Pairings.read(path)
    for number in (1, 2):
        pairings.open_key()
        pairings.bind(pairings.all[-1], f"{number:016x}", f"Lab {number}")
    pairings.rename(f"{1:016x}", "Ward")
    pairings.revoke(f"{2:016x}")
    assert [one.name for one in Pairings.read(path).all] == ["Ward"]
    for change in (pairings.revoke, lambda device: pairings.rename(device, "")):
        with pytest.raises(LinkError, match="see handcal devices"):
            change(f"{2:016x}")
    with pytest.raises(ValueError, match="40 characters"):
        pairings.rename(f"{1:016x}", 41 * "n")
    assert [one.name for one in Pairings.read(path).all] == ["Ward"]


def test_the_changes_of_two_programs_are_both_kept(tmp_path: Path) -> None:
    path = tmp_path / "pairing.key"
    one, other = Pairings.read(path), Pairings.read(path)
    for number, pairings in enumerate((one, other, one, other)):
        key = new_pairing_key()
        pairings.offer(key)
        pairings.bind(Pairing(key), f"{number:016x}", "")
    one.refresh()
    assert one.all == other.all == Pairings.read(path).all
    assert len(one.all) == 4


def test_a_file_that_is_damaged_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "pairing.key"
    pairings = Pairings.read(path)
    known = Pairing(pairings.open_key())
    path.write_bytes(b"{")
    for change in (pairings.refresh, pairings.renew):
        with pytest.raises(FileError, match="damaged"):
            change()
    with pytest.raises(FileError, match="damaged"):
        pairings.bind(known, "00000000000000ff", "Lab 2")
    assert path.read_bytes() == b"{"


def test_a_lock_that_stays_held_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handcal.link.pairing._LOCK_S", 0.0)
    pairings = Pairings.read(tmp_path / "pairing.key")
    lock = FileLock(tmp_path / "pairing.key.lock")
    with pytest.raises(FileError, match="in use by process"):
        pairings.open_key()
    lock.release()
    pairings.renew()
