"""The calibration in files for other programs: OpenCV, JSON, Unity, OpenXR and 3D Slicer.

docs/export.md describes every file and how the tool reads it.
"""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.core.conventions import (
    Fov,
    Pose,
    opengl_projection,
    opengl_transform,
    openxr_view,
    pose,
    slicer_points_mm,
    slicer_transform,
    unity_camera,
)
from handcal.core.errors import FileError
from handcal.core.geometry import invert, rigid
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, Projection
from handcal.export.outcome import SessionOutcome, printable
from handcal.io.files import make_folder, write_atomic, write_json
from handcal.rig.rig_file import quoted
from handcal.session.drawn import ShiftKind

_VERSION = 1
CALIBRATION_VERSION = 1


def write_unity(path: Path, outcome: SessionOutcome, near_m: float, far_m: float) -> None:
    """Write both eyes for ``JsonUtility.FromJson``, which reads no nested arrays.

    A matrix is 16 numbers in the order of ``Matrix4x4``'s index, column by column.
    """
    values: dict[str, object] = {
        "handcalUnity": _VERSION,
        "session": outcome.name,
        "simulated": outcome.record.simulated,
        "nearM": near_m,
        "farM": far_m,
    }
    for eye in EYES:
        projection = outcome.projection(eye)
        camera = unity_camera(projection, outcome.record.rig.eyes[eye].T_V_H, near_m, far_m)
        values[eye] = {
            "projection": camera.projection.ravel("F").tolist(),
            "viewFromHead": camera.view_from_head.ravel("F").tolist(),
            "focusDistanceM": outcome.record.rig.eyes[eye].z_C0_S_m,
        }
    write_json(path, values)


def write_openxr(path: Path, outcome: SessionOutcome) -> None:
    """Write what handcal's OpenXR layer reads; as it expires never, also for other programs."""
    write_json(path, openxr_values(outcome))


def openxr_values(outcome: SessionOutcome) -> dict[str, object]:
    """Return both eyes with the fields of XrView, in the rig's head and in V.

    The layer poses them in V, the runtime's own view, since the rig may have its head elsewhere
    than the runtime its VIEW. By ``own``, V in the rig's head and its field of view if the rig
    knows it, the layer recognises the rig's headset.

    Raises
    ------
    FileError
        If a projection has skew or rotation, which XrFovf cannot express.
    """
    rig = outcome.record.rig
    headset = rig.headset or outcome.record.facts.headset
    views = []
    for eye in EYES:
        try:
            in_view, fov = openxr_view(outcome.projection(eye))
        except ValueError as error:
            raise FileError(f"{error} ({eye} eye)", "export json instead") from error
        own_fov = None
        if headset and eye in headset.views:
            left, right, up, down = np.arctan(headset.views[eye].tangents)
            own_fov = _fov_fields(Fov(left, right, -up, -down))
        T_H_V = opengl_transform(invert(rig.eyes[eye].T_V_H))
        views.append(
            {
                "eye": eye,
                "pose": _pose_fields(pose(T_H_V @ rigid(translation_m=in_view.position_m))),
                "inView": _pose_fields(in_view),
                "fov": _fov_fields(fov),
                "own": {"pose": _pose_fields(pose(T_H_V)), "fov": own_fov},
            }
        )
    return {
        "handcalOpenxr": _VERSION,
        "session": outcome.name,
        "wearer": outcome.record.wearer,
        "simulated": outcome.record.simulated,
        "rig": rig.name,
        "headset": headset.name if headset else "",
        "space": "pose and own.pose are in the rig's head, inView in the runtime's view of the eye",
        "imageDistanceM": float(np.mean([rig.eyes[eye].z_C0_S_m for eye in EYES])),
        "expiresUnixS": 0,
        "movingEyes": int(rig.headset is not None and rig.headset.moves_views),
        "views": views,
    }


def _pose_fields(pose_H: Pose) -> dict[str, dict[str, float]]:
    return {
        "orientation": dict(zip("xyzw", pose_H.quaternion_xyzw.tolist(), strict=True)),
        "position": dict(zip("xyz", pose_H.position_m.tolist(), strict=True)),
    }


def _fov_fields(fov: Fov) -> dict[str, float]:
    return {
        f"angle{name.removesuffix('_rad').capitalize()}": float(angle_rad)
        for name, angle_rad in asdict(fov).items()
    }


def write_slicer(folder: Path, outcome: SessionOutcome, progress: Progress = Progress()) -> None:
    """Write each eye's pose as ``LeftEyeToHead.tfm``, and the clouds as ``.vtk`` files, in mm.

    An ITK file holds the inverse of Slicer's transform, in LPS; the clouds say that they are RAS.
    A comment of each file says what was simulated.
    """
    make_folder(folder)
    simulated = outcome.record.simulated
    comment = f"handcal, simulated: {simulated}" if simulated else "handcal"
    for eye in EYES:
        P_H = from_head(outcome, eye)
        center_m = -np.linalg.solve(P_H[:, :3], P_H[:, 3])
        T_H_E = invert(outcome.record.rig.eyes[eye].T_V_H)
        T_H_E[:3, 3] = center_m
        lps = np.diag([-1.0, -1.0, 1.0, 1.0])
        from_parent = lps @ invert(slicer_transform(T_H_E)) @ lps
        numbers = [*from_parent[:3, :3].ravel(), *from_parent[:3, 3]]
        lines = (
            "#Insight Transform File V1.0",
            f"# {comment}",
            "#Transform 0",
            "Transform: AffineTransform_double_3_3",
            f"Parameters: {' '.join(map(repr, map(float, numbers)))}",
            "FixedParameters: 0 0 0",
        )
        text = "\n".join(lines) + "\n"
        write_atomic(folder / f"{eye.capitalize()}EyeToHead.tfm", text.encode("ascii"))
    alignments = outcome.record.alignments
    for done, (number, alignment) in enumerate(alignments.items()):
        progress.at(done / len(alignments))
        for kind, points_m in (("cursor", alignment.cursor_m), ("hand", alignment.hand_m)):
            _write_vtk(folder / f"alignment-{number}-{kind}.vtk", points_m, comment)


def from_head(outcome: SessionOutcome, eye: Eye) -> Float64:
    """Return P (3, 4) of the final calibration, from the headset rig."""
    P: Float64 = outcome.projection(eye).P @ outcome.record.rig.eyes[eye].T_V_H
    return P


def _write_vtk(path: Path, points_m: Float64, comment: str) -> None:
    """Write a legacy VTK file with one vertex for each point; Slicer shows no bare points."""
    points_mm = slicer_points_mm(points_m).astype(">f8")
    count = len(points_mm)
    cells = np.column_stack([np.ones(count), np.arange(count)]).astype(">i4")
    title = f"{comment}. SPACE=RAS"  # as in Slicer's own files
    head = f"# vtk DataFile Version 3.0\n{title}\nBINARY\nDATASET POLYDATA\nPOINTS {count} double\n"
    middle = f"\nVERTICES {count} {2 * count}\n"
    data = head.encode() + points_mm.tobytes() + middle.encode() + cells.tobytes() + b"\n"
    write_atomic(path, data)


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
