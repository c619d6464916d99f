"""Second tries are listed by name, and more than one fails the run: a rule of tests/conftest.py."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers import ROOT

# Each test fails at its first try; `client` is one of the fixtures that give a second.
FLAKY = """
import pathlib, pytest

@pytest.fixture
def client():
    pass

@pytest.mark.parametrize("number", range({count}))
def test_flaky(number, client):
    tried = pathlib.Path(__file__).with_name(f"tried-{{number}}")
    if not tried.exists():
        tried.touch()
        raise ValueError("too early")
"""


@pytest.mark.process
@pytest.mark.parametrize(("workers", "count", "code"), [(0, 1, 0), (1, 2, 1)])
def test_one_second_try_is_listed_and_two_fail(
    tmp_path: Path, workers: int, count: int, code: int
) -> None:
    (tmp_path / "test_flaky.py").write_text(FLAKY.format(count=count))
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n quick\n")
    command = [
        *(sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:dash"),
        *("-p", "no:pytest-qt", f"--numprocesses={workers}", "--dist=loadfile"),
    ]
    run = subprocess.run(
        command, cwd=tmp_path, env=_environment(), capture_output=True, text=True, check=False
    )
    assert run.returncode == code, run.stdout + run.stderr
    assert f"{count} passed, {count} rerun" in run.stdout
    for number in range(count):
        assert f"test_flaky.py::test_flaky[{number}] - ValueError: too early" in run.stdout
    assert ("at most 1 may" in run.stdout) == (count > 1)


def _environment() -> dict[str, str]:
    """Return an environment without what the run around this one has set for its own tests."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return kept | {"PYTHONPATH": str(ROOT)}
