import os
from pathlib import Path

import pytest

from handcal.errors import FileError, LinkError
from handcal.link.pairing import (
    KEY_VARIABLE,
    new_pairing_key,
    read_pairing_key,
    write_pairing_key,
)
from handcal.link.wire import derive_keys


def test_the_key_comes_from_the_environment_or_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, other = new_pairing_key(), new_pairing_key()
    assert key != other
    monkeypatch.setenv(KEY_VARIABLE, key)
    (tmp_path / "key").write_text(other + "\n")
    assert read_pairing_key() == key.encode()
    assert read_pairing_key(tmp_path / "key") == other.encode()
    assert derive_keys(read_pairing_key()) != derive_keys(other.encode())


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


def test_a_written_key_is_this_users_alone_and_replaces_the_old(tmp_path: Path) -> None:
    path = tmp_path / "config" / "pairing.key"
    first, second = write_pairing_key(path), write_pairing_key(path)
    assert first != second
    assert read_pairing_key(path) == second.encode()
    if os.name == "posix":
        assert path.stat().st_mode & 0o777 == 0o600
