"""Entry point of a packaged program: the command line, the window or a module, by its arguments.

A packaged program has one executable. Called by the name ``handcal`` it is the command line, by
any other name the window. ``-m MODULE``, with which the program starts its own processes, does as
in Python.
"""

from __future__ import annotations

import multiprocessing
import runpy
import sys
from pathlib import Path


def main() -> None:
    """Run what the name and the arguments of this process request."""
    multiprocessing.freeze_support()
    match sys.argv[1:]:
        case ["-m", module, *_]:
            del sys.argv[:2]
            runpy.run_module(module, run_name="__main__", alter_sys=True)
        case _:
            name = "handcal" if Path(sys.argv[0]).stem == "handcal" else "handcal_gui"
            runpy.run_module(name, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
