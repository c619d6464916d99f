import subprocess
import sys

import pytest

IMPORT_EVERYTHING = """
import importlib, pkgutil, sys, handcal
for module in pkgutil.walk_packages(handcal.__path__, "handcal."):
    if not module.name.startswith("handcal.train."):  # all of which needs torch
        importlib.import_module(module.name)
heavy = {"PySide6", "pyqtgraph", "open3d", "pyrealsense2", "scipy.signal", "scipy.stats"}
print(len(sys.modules), *heavy & sys.modules.keys())
"""


@pytest.mark.process
def test_the_whole_engine_imports_without_its_heavy_and_optional_parts() -> None:
    run = subprocess.run(
        [sys.executable, "-c", IMPORT_EVERYTHING], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.split()[1:] == []
