"""The command line, run in this process."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from handcal.cli.main import main


@pytest.fixture
def handcal(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Run a command in this process."""

    def run(*arguments: object) -> None:
        monkeypatch.setattr(sys, "argv", ["handcal", *map(str, arguments)])
        main()

    return run


@pytest.fixture
def fails(
    handcal: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    """Run a command that fails; return its exit code and its one line."""

    def run(*arguments: object) -> tuple[int, str]:
        with pytest.raises(SystemExit) as ended:
            handcal(*arguments)
        error = capsys.readouterr().err
        assert error.startswith("handcal: ")
        assert error.count("\n") == 1
        assert error.endswith("\n")
        assert isinstance(ended.value.code, int)
        return ended.value.code, error

    return run
