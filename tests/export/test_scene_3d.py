"""The scene of an alignment: where the rig and the results put everything."""

from __future__ import annotations

import numpy as np
import pytest

from handcal.core.geometry import invert, project, transform
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.scene_3d import make_scenes
from handcal.export.window_3d import residual_colors
from handcal.io.resources import resource_path
from handcal.session.session import Session, SessionRecord


def test_every_alignment_has_a_scene_in_the_axes_of_its_first_eye(outcome: SessionOutcome) -> None:
    scenes = make_scenes(outcome)
    assert list(scenes) == [1, 3]
    for number, scene in scenes.items():
        alignment = outcome.record.alignments[number]
        T_E_W = alignment.T_E_W[alignment.eyes[0]]
        assert np.allclose(transform(invert(T_E_W), scene.cursor_m), alignment.cursor_m)
        assert np.allclose(transform(invert(T_E_W), scene.hand_m), alignment.hand_m)
        assert scene.residuals_m.keys() == set(alignment.eyes)
        assert all(len(m) == len(scene.hand_m) for m in scene.residuals_m.values())
        first = scene.eyes[alignment.eyes[0]]
        assert first.offline_m == pytest.approx(np.zeros(3))
        assert first.eye_m == pytest.approx(outcome.drawn[alignment.eyes[0]].shift_m)


def test_displays_and_eyes_stand_as_on_the_rig() -> None:
    outcome = load_outcome(Session.open(resource_path("example_session")))
    for number, scene in make_scenes(outcome).items():
        rig, offline_H_m = outcome.record.rig, {}
        for eye, placed in scene.eyes.items():
            display = rig.eyes[eye]
            offline_H_m[eye] = transform(invert(display.T_V_H), -display.t_C0_V_m[None])[0]
            if eye == outcome.record.alignments[number].eyes[0]:
                assert placed.display_m[:, 2] == pytest.approx(display.z_C0_S_m)
                right, bottom = display.width_px - 0.5, display.height_px - 0.5
                corners_px = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
                P = display.K @ display.H0 @ np.eye(3, 4)
                assert project(P, placed.display_m) == pytest.approx(np.array(corners_px))
        apart_m = np.linalg.norm(scene.eyes["left"].offline_m - scene.eyes["right"].offline_m)
        assert apart_m == pytest.approx(np.linalg.norm(offline_H_m["left"] - offline_H_m["right"]))


def test_a_session_without_alignments_has_no_scenes(empty: SessionRecord) -> None:
    assert make_scenes(load_outcome(empty)) == {}


def test_residuals_are_darker_the_larger_and_outliers_are_red() -> None:
    colors = residual_colors(np.array([0.0, 0.001, 0.003, 0.005, 0.020, np.nan]))
    brightness = colors[:5] @ [0.21, 0.72, 0.07]
    assert (np.diff(brightness[:4]) < 0.0).all()
    assert np.array_equal(colors[3], colors[4])
    assert colors[5] == pytest.approx([0.9, 0.1, 0.1])
