import re
from dataclasses import replace

import numpy as np

from handcal.core.geometry import rigid
from handcal.core.types import Origin
from handcal.rig.example import example_rig
from handcal.rig.steps import STEREO_PARAMETERS
from handcal_gui.rig.rows import difference_rows, rig_rows

SIGMAS = np.array([1e-3, 2e-3, 3e-3, 1e-4, 2e-4, 3e-4])
ORIGIN = Origin(
    method="as told",
    made="2026-11-21T16:00:00+00:00",
    views=10,
    rms_px=0.5,
    verdict="good",
    reason="as told",
    parameters=STEREO_PARAMETERS,
    covariance=np.diag(SIGMAS**2),
)


def test_a_rig_in_a_persons_units() -> None:
    rig = replace(
        example_rig(),
        T_H_D=rigid([np.radians(-15.0), 0.0, 0.0], [-0.0175, -0.03, 0.015]),
        origins={"T_H_D": ORIGIN},
    )
    cells = {row.label: row.cells for row in rig_rows(rig)}
    assert cells["Left: Rendering camera x"] == ("-0.50 mm", "–")
    assert cells["Right: Screen's distance"] == ("2.000 m", "–")
    assert cells["Depth camera: Rotation x"] == ("-15.000°", "0.057°")
    assert cells["Depth camera: Position y"] == ("-30.00 mm", "0.20 mm")
    assert cells["Depth camera: Focal length fx"][0] == "1005.00 px"
    assert not any(re.search("_|→", row.label) for row in rig_rows(rig)), "symbols are in tooltips"


def test_the_same_rig_does_not_differ() -> None:
    ours = example_rig()
    theirs = replace(ours, T_H_D=ours.T_H_D @ rigid(None, [0.001, 0.0, 0.0]))
    moved = {row.label: row.cells[0] for row in difference_rows(ours, theirs)}
    assert moved["Depth camera (T_H_D): moved"] == "1.000 mm"
    assert moved["Depth camera (T_H_D): turned"] == "0.000°"
    assert moved["Left: target is drawn elsewhere"].endswith("′")
