"""The headset's side in C#, compiled and run with mono."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from handcal.io.resources import resource_path
from tests.helpers import ROOT

PACKAGE = resource_path("unity") / "com.handcal.headset"
PROGRAM = ROOT / "tests/headset/program"
REQUIRE = "HANDCAL_REQUIRE_MONO"

Ask = Callable[..., str]


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a compiler of C# 7 that takes no warning."""
    if shutil.which("mcs") is None or shutil.which("mono") is None:
        if os.environ.get(REQUIRE):
            pytest.fail("mono is missing: install mono-mcs and mono-runtime")
        pytest.skip("needs mono: apt-get install mono-mcs mono-runtime")
    folder = tmp_path_factory.mktemp("mono")

    def compile_(name: str, *sources: Path, defines: str = "") -> Path:
        files = [file for source in sources for file in sorted(source.glob("*.cs"))]
        kind = "exe" if name.endswith(".exe") else "library"
        options = ["-langversion:7", "-warn:4", "-warnaserror", f"-target:{kind}"]
        options += ["-r:System.Numerics.dll"]  # part of .NET Standard
        options += [f"-define:{defines}"] if defines else []
        command = ["mcs", *options, f"-out:{folder / name}", *map(str, files)]
        run = subprocess.run(command, capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr
        return folder / name

    return compile_


@pytest.fixture(scope="session")
def program(compiled: Callable[..., Path]) -> Path:
    """Return the test program, which holds the link."""
    return compiled("headset.exe", PROGRAM, PACKAGE / "Runtime/Link")


@pytest.fixture(scope="session")
def ask(program: Path) -> Ask:
    """Return a function that runs the test program: its arguments and input give its output."""

    def run(*arguments: str, text: str = "") -> str:
        command = ["mono", str(program), *arguments]
        done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
