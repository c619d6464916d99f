"""Rules of tests/conftest.py: second tries, and workers that crash."""

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

CRASH = """
import os

def test_crash():
    os._exit(3)
"""


@pytest.mark.process
@pytest.mark.parametrize(("workers", "count", "code"), [(0, 1, 0), (1, 2, 1)])
def test_one_second_try_is_listed_and_two_fail(
    tmp_path: Path, workers: int, count: int, code: int
) -> None:
    run = _run(tmp_path, FLAKY.format(count=count), workers)
    assert run.returncode == code, run.stdout + run.stderr
    assert f"{count} passed, {count} rerun" in run.stdout
    for number in range(count):
        assert f"test_it.py::test_flaky[{number}] - ValueError: too early" in run.stdout
    assert ("at most 1 may" in run.stdout) == (count > 1)


@pytest.mark.process
def test_a_crash_ends_the_run(tmp_path: Path) -> None:
    run = _run(tmp_path, CRASH, workers=1)
    assert run.returncode == 1, run.stdout + run.stderr
    assert "crashed while running 'test_it.py::test_crash'" in run.stdout
    assert "1 failed in" in run.stdout  # once, not again by each worker in its place


def _run(folder: Path, tests: str, workers: int) -> subprocess.CompletedProcess[str]:
    """Run tests by the rules of tests/conftest.py."""
    (folder / "test_it.py").write_text(tests)
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n quick\n")
    command = [
        *(sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:dash"),
        *("-p", "no:pytest-qt", f"--numprocesses={workers}", "--dist=loadfile"),
    ]
    return subprocess.run(
        command, cwd=folder, env=_environment(), capture_output=True, text=True, check=False
    )


def _environment() -> dict[str, str]:
    """Return an environment without what the run around this one has set for its own tests."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return kept | {"PYTHONPATH": str(ROOT)}
