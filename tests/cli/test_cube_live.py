import json
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.folder import record_folder
from handcal.cli.main import parse
from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid
from handcal.core.types import Frame, Intrinsics
from handcal.rig.cube import Cube
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter

CAMERA = Intrinsics(640, 360, 502.0, 502.0, 319.5, 179.5)
T_D_T = rigid([0, 0, 0.1], [0, 0, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])


def run(*words: object) -> None:
    arguments = parse(["evaluate", *map(str, words)])
    arguments.command(arguments)


def recording(folder: Path, frames: int, has_cube: bool = True) -> Path:
    painter = CubePainter(Cube(), CAMERA, PictureSettings(samples=1))
    rng, depth = np.random.default_rng(1), np.zeros((CAMERA.height, CAMERA.width), np.uint16)

    def frame(number: int) -> Frame:
        T = T_D_T if has_cube else rigid(None, [0, 0, -1.0]) @ T_D_T
        color = np.repeat(painter.paint(T, rng)[..., None], 3, axis=2)
        t_ns = number * 50_000_000
        return Frame(number, t_ns, t_ns, depth, 1e-3, CAMERA, color, CAMERA)

    record_folder(folder, [frame(number) for number in range(frames)])
    return folder


def test_the_cube_of_a_recording_is_tracked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = tmp_path / "result.json"
    played = recording(tmp_path / "take", 40)
    run("cube", "track", "--camera", played, "--no-headset", "--seconds", 20, "--json", result)
    found = json.loads(result.read_text())
    assert found["frames"] == found["tracked"] == 40
    assert found["is_at_rest"]
    assert found["error_mm"] is None
    expected = example_rig().T_H_D @ T_D_T
    np.testing.assert_allclose(np.array(found["T_W_T"])[:3, 3], expected[:3, 3], atol=0.001)
    assert "40 poses in 40 frames" in capsys.readouterr().out


@pytest.mark.parametrize("seed", [{}, {"seed": 3}])
@pytest.mark.parametrize("headset", ["virtual", "network"])
def test_only_a_wearer_of_the_virtual_headset_makes_simulated_trials(
    tmp_path: Path, headset: str, seed: dict[str, int]
) -> None:
    settings = {"station": {"headset": headset, **seed}}
    with Session.create(tmp_path, example_rig(), settings, name="one") as session:
        pass
    is_simulated = bool(seed) and headset == "virtual"
    # A simulated one gets farther, and is refused because it is empty.
    problem = "left eye is not solved" if is_simulated else "virtual headset has no such wearer"
    with pytest.raises(HandcalError, match=problem):
        run("trials", session.path, "--headset", "virtual", "--camera", "simulator")
