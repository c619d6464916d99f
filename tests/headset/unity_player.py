"""An app of the Unity package's sample scene, played by mono on stubs of Unity."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from handcal.core.types import Float64
from handcal.io.closable import Closable
from tests.helpers import Patience

PATIENCE_S = 30.0


class UnityPlayer(Closable):
    """The running app; it draws frames only when asked to.

    Parameters
    ----------
    program : path
        The compiled player.
    folder : path
        The app's folder, which outlives it.
    fields : str
        Fields of the component, by their names; "native" hooks the native views.
    """

    def __init__(self, program: Path, folder: Path, **fields: str) -> None:
        folder.mkdir(exist_ok=True)
        values = [f"{name}={value}" for name, value in fields.items()]
        self._process = subprocess.Popen(
            ["mono", str(program), str(folder), *values],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "LD_LIBRARY_PATH": str(program.parent)},
        )

    def do(self, *orders: str) -> None:
        """Give orders of the player; see `Player.cs`."""
        assert self._process.stdin is not None
        self._process.stdin.write("".join(f"{order}\n" for order in orders))
        self._process.stdin.flush()

    def place(self, order: str, numbers: Iterable[float]) -> None:
        """Give an order with numbers."""
        self.do(f"{order} {' '.join(repr(float(number)) for number in numbers)}")

    def state(self, frames: int = 1) -> Mapping[str, str]:
        """Draw frames; return what the app then shows."""
        self.do(f"frames {frames}", "state")
        assert self._process.stdout is not None
        told = {}
        while (line := self._process.stdout.readline()) != "\n":
            assert line, "the app has ended"
            name, told[name] = (
                line.rstrip("\n").split("=", 1)[0],
                line.rstrip("\n").split("=", 1)[1],
            )
        return told

    def until(self, condition: Callable[[Mapping[str, str]], object]) -> Mapping[str, str]:
        """Draw frames until a condition holds; return what the app then shows."""
        patience = Patience(PATIENCE_S)
        while not condition(told := self.state()):
            assert not patience.is_over(), told
        return told

    def close(self) -> None:
        """End the app as a user does; safe to call twice."""
        if self._process.poll() is None:
            self._process.communicate(timeout=PATIENCE_S)


def numbers(told: str) -> Float64:
    """Return the numbers of a line."""
    return np.array(told.split(), np.float64)
