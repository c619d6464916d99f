"""The one executable of a packaged program: command line, window or module, as it is called."""

from __future__ import annotations

import sys
from importlib.metadata import version

import pytest

from handcal.sim.simulation import program_command
from handcal_gui import benchmark, bundle


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        (["/usr/bin/handcal", "--version"], f"handcal {version('handcal')}"),
        (["/usr/bin/handcal-gui", "--help"], "usage: handcal-gui"),
        (["/opt/handcal/handcal-gui", "--help"], "--autopilot"),
        (["/opt/handcal/handcal-gui", *program_command()[1:], "headset", "--help"], "--scene-port"),
        (["/usr/bin/handcal", "-m", "handcal_gui.benchmark", "--help"], "--frames"),
    ],
    ids=["command line", "window", "window by its path", "virtual headset", "module"],
)
def test_it_runs_what_is_asked_for(
    words: list[str],
    printed: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.delitem(sys.modules, benchmark.__name__)
    with pytest.raises(SystemExit) as ended:
        bundle.main()
    assert not ended.value.code
    assert printed in capsys.readouterr().out
