"""The calibration for other programs: FileStorage YAML, and JSON in four conventions.

docs/export.md describes every field. Both formats preserve numbers exactly.
"""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2

from handcal.core.conventions import (
    opengl_projection,
    opengl_transform,
    openxr_view,
    unity_camera,
)
from handcal.core.types import EYES, Eye, Projection
from handcal.export.outcome import SessionOutcome, printable
from handcal.io.files import write_atomic, write_json
from handcal.rig.rig_file import quoted
from handcal.session.drawn import ShiftKind

CALIBRATION_VERSION = 1


def write_calibration_yaml(path: Path, outcome: SessionOutcome) -> None:
    """Write each eye's final calibration and its parts in OpenCV's FileStorage YAML."""
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("handcal_calibration", CALIBRATION_VERSION)
    for name, text in _whose(outcome).items():
        storage.write(name, quoted(text))
    for eye in EYES:
        display, drawn = outcome.record.rig.eyes[eye], outcome.drawn[eye]
        storage.startWriteStruct(eye, cv2.FileNode_MAP)
        storage.write("final", quoted(drawn.kind))
        storage.write("is_applied", int(drawn.is_drawn))
        storage.write("P", outcome.projection(eye).P)
        storage.write("K", display.K)
        storage.write("H0", display.H0)
        storage.write("t_C0_V_m", display.t_C0_V_m[:, None])
        storage.write("z_C0_S_m", display.z_C0_S_m)
        storage.write("width_px", display.width_px)
        storage.write("height_px", display.height_px)
        storage.write("shift_m", drawn.shift_m[:, None])
        for kind, shift_m in outcome.shifts_m[eye].items():
            storage.write(f"{kind.replace(' ', '_')}_shift_m", shift_m[:, None])
        if outcome.results is not None and eye in outcome.results.eyes:
            storage.write("solved_covariance_m2", outcome.results.eyes[eye].covariance_m2)
        storage.endWriteStruct()
    write_atomic(path, storage.releaseAndGetString().encode())


def write_calibration_json(
    path: Path, outcome: SessionOutcome, near_m: float, far_m: float
) -> None:
    """Write every φ of each eye with its matrices in OpenCV's, OpenGL's, Unity's and OpenXR's form.

    Parameters
    ----------
    path : Path
    outcome : SessionOutcome
    near_m, far_m : float
        Clipping distances of the OpenGL and Unity matrices.
    """
    results = outcome.results
    write_json(
        path,
        {
            "handcal_calibration": CALIBRATION_VERSION,
            **_whose(outcome),
            "method": outcome.settings.method,
            "alignments": len(outcome.record.alignments),
            "near_m": near_m,
            "far_m": far_m,
            "solved_eye_distance_m": results.eye_distance_m if results else None,
            "eyes": {eye: _eye(outcome, eye, near_m, far_m) for eye in EYES},
        },
    )


def _whose(outcome: SessionOutcome) -> dict[str, str]:
    return {
        "session": outcome.name,
        "wearer": printable(outcome.record.wearer),
        "started_utc": outcome.started,
        "rig": outcome.record.rig.name,
        "simulated": outcome.record.simulated,
        "handcal_version": version("handcal"),
    }


def _eye(outcome: SessionOutcome, eye: Eye, near_m: float, far_m: float) -> dict[str, Any]:
    display = outcome.record.rig.eyes[eye]
    return {
        "final": outcome.drawn[eye].kind,
        "width_px": display.width_px,
        "height_px": display.height_px,
        "opencv": {
            "K": display.K.tolist(),
            "H0": display.H0.tolist(),
            "t_C0_V_m": display.t_C0_V_m.tolist(),
            "z_C0_S_m": display.z_C0_S_m,
            "T_V_H": display.T_V_H.tolist(),
        },
        "opengl": {"view_from_head": opengl_transform(display.T_V_H).tolist()},
        "calibrations": {
            kind: _solution(outcome, eye, kind, near_m, far_m) for kind in outcome.shifts_m[eye]
        },
    }


def _solution(
    outcome: SessionOutcome, eye: Eye, kind: ShiftKind, near_m: float, far_m: float
) -> dict[str, Any]:
    projection = outcome.projection(eye, kind)
    clip = opengl_projection(projection, near_m, far_m).tolist()
    unity = unity_camera(projection, outcome.record.rig.eyes[eye].T_V_H, near_m, far_m)
    found: dict[str, Any] = {
        "is_applied": outcome.is_applied(eye, kind),
        "shift_m": outcome.shifts_m[eye][kind].tolist(),
    }
    if kind == "solved" and outcome.results is not None:
        verdict, trials = outcome.results.verdicts[eye], outcome.trials.get(eye)
        found |= {
            "covariance_m2": outcome.results.eyes[eye].covariance_m2.tolist(),
            "verdict": verdict.name,
            "reason": verdict.reason,
            "trials": asdict(trials) | {"is_over": trials.is_over} if trials else None,
            "by_distance": [asdict(one) for one in outcome.results.benefits[eye].by_distance],
        }
    return found | {
        "opencv": {"P": projection.P.tolist()},
        "opengl": {"projection": clip},
        "unity": {
            "projection": unity.projection.tolist(),
            "view_from_head": unity.view_from_head.tolist(),
        },
        **_openxr(projection),
    }


def _openxr(projection: Projection) -> dict[str, Any]:
    """Return the fields of XrView, or null and the reason."""
    try:
        pose, fov = openxr_view(projection)
    except ValueError as error:
        return {"openxr": None, "openxr_reason": str(error)}
    return {
        "openxr": {
            "position_m": pose.position_m.tolist(),
            "quaternion_xyzw": pose.quaternion_xyzw.tolist(),
            **asdict(fov),
        }
    }
