"""A session in a window of Open3D, which runs in its own process.

``python -m handcal.export.window_3d`` is that process: it reads what to show from its standard
input. An OpenGL driver that crashes ends this process only.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from handcal.core.errors import FileError, HandcalError, extra_advice
from handcal.core.geometry import invert, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import Eye, EyeDisplay, Float64
from handcal.export.outcome import SessionOutcome
from handcal.io.files import make_folder, read_limited, require_suffix, write_atomic
from handcal.io.x_display import x_server_answers
from handcal.register.verdict import RMS_MAX_M


@dataclass(frozen=True, slots=True, eq=False)
class Eye3d:
    """An eye and its display, in the scene's axes."""

    offline_m: Float64
    """(3,); C0, the viewpoint of the offline calibration."""
    eye_m: Float64
    """(3,); C1, the eye by its final φ; C0 where there is none."""
    display_m: Float64
    """(4, 3); corners of the display's image on its focal plane, clockwise."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene3d:
    """One alignment in the axes of its first eye's E at t_b: x right, y down, z forward."""

    title: str
    cursor_m: Float64
    """(N, 3)."""
    hand_m: Float64
    """(M, 3)."""
    residuals_m: Mapping[Eye, Float64]
    """each (M,); distance of each point of the hand from its partner, NaN for an outlier."""
    eyes: Mapping[Eye, Eye3d]


def make_scenes(outcome: SessionOutcome) -> dict[int, Scene3d]:
    """Return a scene for each alignment of a session, by number."""
    solved = outcome.results.alignments if outcome.results else {}
    return {number: _make_scene(outcome, number) for number in solved}


def _make_scene(outcome: SessionOutcome, number: int) -> Scene3d:
    assert outcome.results is not None
    alignment = outcome.record.alignments[number]
    T_scene_W = alignment.T_E_W[alignment.eyes[0]]
    eyes: dict[Eye, Eye3d] = {}
    for eye, T_E_W in alignment.T_E_W.items():
        corners_m = _display_corners_m(outcome.record.rig.eyes[eye])
        points_m = np.vstack([np.zeros(3), outcome.drawn[eye].shift_m, corners_m])
        placed_m = transform(T_scene_W @ invert(T_E_W), points_m)
        eyes[eye] = Eye3d(placed_m[0], placed_m[1], placed_m[2:])
    shifts = outcome.results.alignments[number]
    return Scene3d(
        title=f"alignment {number}",
        cursor_m=transform(T_scene_W, alignment.cursor_m),
        hand_m=transform(T_scene_W, alignment.hand_m),
        residuals_m={eye: shift.residuals_m for eye, shift in shifts.items()},
        eyes=eyes,
    )


def _display_corners_m(display: EyeDisplay) -> Float64:
    """Return the corners of a display's image on its focal plane, (4, 3), in E."""
    right, bottom = display.width_px - 0.5, display.height_px - 0.5
    corners_px = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    rays = np.linalg.solve(display.K @ display.H0, np.vstack([corners_px.T, np.ones(4)])).T
    return np.asarray(display.z_C0_S_m * rays / rays[:, 2:])


_KEYS = "N, P: next, previous alignment; E: other eye; V: view from the eye; O: oblique view"
_SIZE_PX = 1200, 800
_MAX_PICTURE_BYTES = 2**24
_POLL_S = 0.1
_NO_WINDOW = 3
"""Exit status of the process if OpenGL opens no window."""
_NO_CACHE = {"MESA_SHADER_CACHE_DISABLE": "true", "__GL_SHADER_DISK_CACHE": "0"}
"""Keeps Mesa and NVIDIA's driver from writing compiled shaders into the user's folder."""
_LARGEST_MM = 1e3 * RMS_MAX_M
_COLORS: Mapping[Eye, tuple[float, float, float]] = {
    "left": (0.0, 0.45, 0.70),
    "right": (0.84, 0.37, 0.0),
}
_CURSOR, _OFFLINE, _TEXT, _OUTLIER = (0.45,) * 3, (0.6,) * 3, (0.1,) * 3, (0.9, 0.1, 0.1)
_EYE_RADIUS_M, _OFFLINE_RADIUS_M = 0.006, 0.004
_CURSOR_POINTS = 800
_LETTER_M, _LETTER_HEIGHT = 0.018, 14.0
"""Height of a letter in the scene, and in Open3D's units of text."""


@dataclass(frozen=True, slots=True, eq=False)
class _Order:
    name: str
    scenes: Mapping[int, Scene3d]
    number: int
    picture: Path | None


def inspect_session(
    outcome: SessionOutcome,
    number: int | None = None,
    picture: Path | None = None,
    progress: Progress = Progress(),
) -> None:
    """Show a session's alignments in a window until it is closed.

    Parameters
    ----------
    outcome : SessionOutcome
    number : int, optional
        The alignment shown first; by default the last.
    picture : Path, optional
        A .png file to write instead of opening a window; needs no display.
    progress : Progress
        Closes the window if it is cancelled.

    Raises
    ------
    HandcalError
        If Open3D or the alignment is missing, or no window can be opened.
    CancelledError
        If it was cancelled.
    """
    scenes = make_scenes(outcome)
    if not scenes:
        raise FileError(f"{outcome.record.path} holds no alignment to show")
    number = list(scenes)[-1] if number is None else number
    if number not in scenes:
        known = ", ".join(map(str, scenes))
        raise FileError(f"{outcome.record.path} has no alignment {number}: it has {known}")
    if find_spec("open3d") is None:
        raise HandcalError("Open3D is not installed", extra_advice("3d"))
    if picture is None:
        if not _has_display():
            raise HandcalError(
                "no display found for the 3D window", "use --picture FILE, which needs none"
            )
        _run(_Order(outcome.name, scenes, number, None), progress)
        return
    require_suffix(picture, ".png")
    make_folder(picture.parent)
    with tempfile.TemporaryDirectory() as folder:
        drawn = Path(folder) / "view.png"
        _run(_Order(outcome.name, scenes, number, drawn), progress)
        write_atomic(picture, read_limited(drawn, _MAX_PICTURE_BYTES))


def _has_display() -> bool:
    """Return whether a window would be seen: without a display, Open3D draws one in memory."""
    if not sys.platform.startswith("linux") or os.environ.get("WAYLAND_DISPLAY"):
        return True
    display = os.environ.get("DISPLAY", "")
    return bool(display) and x_server_answers(display)


def _run(order: _Order, progress: Progress) -> None:
    """Run the window's process until it ends."""
    with tempfile.TemporaryFile() as orders, tempfile.TemporaryFile() as messages:
        pickle.dump(order, orders)
        orders.seek(0)
        process = subprocess.Popen(
            [sys.executable, "-m", "handcal.export.window_3d"],
            stdin=orders,
            stdout=messages,
            stderr=messages,
            env=os.environ | _NO_CACHE,
        )
        try:
            while True:
                try:
                    status = process.wait(_POLL_S)
                    break
                except subprocess.TimeoutExpired:
                    progress.check()
        except BaseException:
            process.kill()
            process.wait()
            raise
        messages.seek(0)
        lines = messages.read().decode(errors="replace").split("\n")
    if status == _NO_WINDOW:
        raise HandcalError(
            "Open3D opened no window: it needs OpenGL 3.3 and a display",
            "update the graphics driver, or on Debian install libgl1-mesa-dri",
        )
    if status == 1:
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        raise HandcalError(f"the 3D window failed: {last}")
    if status:
        raise HandcalError(
            f"the 3D window crashed (status {status}), perhaps in the graphics driver",
            "update the driver",
        )


def main() -> int:
    """Show what standard input holds; return the exit status."""
    order = pickle.load(sys.stdin.buffer)  # noqa: S301 (from the process that started this)
    return _Window(order).show()


class _Window:
    """Open3D's window with one alignment, and the keys that change what it shows."""

    def __init__(self, order: _Order) -> None:
        import open3d

        self._o3d: Any = open3d
        self._name, self._picture = order.name, order.picture
        self._scenes, self._numbers = order.scenes, list(order.scenes)
        self._place = self._numbers.index(order.number)
        self._eye: Eye = next(iter(self._scene.residuals_m))
        self._window: Any = open3d.visualization.VisualizerWithKeyCallback()

    @property
    def _scene(self) -> Scene3d:
        return self._scenes[self._numbers[self._place]]

    def show(self) -> int:
        """Show the window until it is closed, or write its picture; return the exit status."""
        window, is_seen = self._window, self._picture is None
        title = f"handcal: {self._name} ({_KEYS})"
        if not window.create_window(title, *_SIZE_PX, visible=is_seen):
            return _NO_WINDOW
        options = window.get_render_option()
        options.point_size, options.light_on = 2.5, False
        options.mesh_show_back_face = True  # or text is hidden
        self._draw(is_first=True)
        if is_seen:
            for key, do in (
                ("N", lambda: self._step(1)),
                ("P", lambda: self._step(-1)),
                ("E", self._change_eye),
                ("V", self._view_from_eye),
                ("O", self._view_obliquely),
            ):
                window.register_key_callback(ord(key), lambda _, do=do: do())
            window.run()
        else:
            window.capture_screen_image(str(self._picture), do_render=True)
        window.destroy_window()
        return 0

    def _step(self, by: int) -> bool:
        self._place = (self._place + by) % len(self._numbers)
        if self._eye not in self._scene.residuals_m:
            self._eye = next(iter(self._scene.residuals_m))
        return self._draw()

    def _change_eye(self) -> bool:
        self._eye = next((eye for eye in self._scene.residuals_m if eye != self._eye), self._eye)
        return self._draw()

    def _draw(self, is_first: bool = False) -> bool:
        self._window.clear_geometries()
        for geometry in self._geometries():
            self._window.add_geometry(geometry, reset_bounding_box=is_first)
        if is_first:
            self._view_obliquely()
        return True

    def _geometries(self) -> list[Any]:
        scene, residuals_m = self._scene, self._scene.residuals_m[self._eye]
        # So sparse that the hand's colours show through.
        cursor_m = scene.cursor_m[:: max(1, len(scene.cursor_m) // _CURSOR_POINTS)]
        high = scene.hand_m.min(axis=0)
        low = scene.hand_m.max(axis=0)
        middle_m = np.median(scene.hand_m, axis=0)
        drawn = [
            self._points(cursor_m, np.tile(_CURSOR, (len(cursor_m), 1))),
            self._points(scene.hand_m, residual_colors(residuals_m)),
        ]
        for row, line in enumerate((f"{self._eye} eye's residuals", scene.title)):
            above_m = (1.0 + 1.6 * row) * _LETTER_M
            drawn.append(self._text(line, [high[0] - 0.05, high[1] - above_m, middle_m[2]]))
        drawn += self._scale([low[0] + 0.03, middle_m[1], middle_m[2]])
        for eye, placed in scene.eyes.items():
            color = _COLORS[eye]
            drawn.append(self._ball(placed.offline_m, _OFFLINE_RADIUS_M, _OFFLINE))
            drawn.append(self._ball(placed.eye_m, _EYE_RADIUS_M, color))
            ends = np.vstack([placed.eye_m, placed.display_m])
            pairs = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]]
            drawn.append(self._lines(ends, pairs, color))
            aside_m = 0.06 if eye == "left" else 0.0
            drawn.append(self._text(eye, placed.eye_m - [aside_m, 0.02, 0.0], color))
        return drawn

    def _scale(self, foot_m: Sequence[float]) -> list[Any]:
        """Return a bar of the residuals' colours beside the hand, with its ends named."""
        share = np.linspace(0.0, 1.0, 200)
        along = np.stack([np.zeros(200), 0.03 - 0.06 * share, np.zeros(200)], axis=1) + foot_m
        wide = np.concatenate(
            [np.add(along, [x_m, 0.0, 0.0]) for x_m in np.linspace(0.0, 0.006, 12)]
        )
        colors = np.tile(residual_colors(1e-3 * _LARGEST_MM * share), (12, 1))
        beside_m = np.add(foot_m, [0.01, 0.0, 0.0])
        return [
            self._points(wide, colors),
            self._text("0 mm", np.add(beside_m, [0.0, 0.03, 0.0])),
            self._text(f"{_LARGEST_MM:.0f} mm", beside_m - [0.0, 0.03 - _LETTER_M, 0.0]),
        ]

    def _view_obliquely(self) -> bool:
        """Look at the eyes and the hand from behind the wearer's right shoulder."""
        scene = self._scene
        near_m = np.vstack([scene.hand_m, *(placed.eye_m for placed in scene.eyes.values())])
        middle_m = (near_m.min(axis=0) + near_m.max(axis=0)) / 2.0
        toward = np.array([-0.6, 0.35, 0.72])
        return self._look(middle_m - 0.9 * np.ptp(near_m, axis=0).max() * toward, toward)

    def _view_from_eye(self) -> bool:
        """Look from the eye at the hand."""
        eye_m = self._scene.eyes[self._eye].eye_m
        return self._look(eye_m, np.median(self._scene.hand_m, axis=0) - eye_m)

    def _look(self, from_m: Float64, toward: Float64) -> bool:
        """Look from a point in a direction, the image's y as far down as possible."""
        forward = toward / np.linalg.norm(toward)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        control = self._window.get_view_control()
        camera = control.convert_to_pinhole_camera_parameters()
        camera.extrinsic = rigid(R, -R @ from_m)
        control.convert_from_pinhole_camera_parameters(camera, allow_arbitrary=True)
        return True

    def _points(self, points_m: Float64, colors: Float64) -> Any:
        vector = self._o3d.utility.Vector3dVector
        cloud = self._o3d.geometry.PointCloud(vector(points_m))
        cloud.colors = vector(colors)
        return cloud

    def _lines(self, ends_m: Float64, pairs: list[list[int]], color: Sequence[float]) -> Any:
        utility = self._o3d.utility
        lines = self._o3d.geometry.LineSet(
            utility.Vector3dVector(ends_m), utility.Vector2iVector(pairs)
        )
        lines.paint_uniform_color(color)
        return lines

    def _ball(self, centre_m: Float64, radius_m: float, color: Sequence[float]) -> Any:
        ball = self._o3d.geometry.TriangleMesh.create_sphere(radius_m).translate(centre_m)
        ball.compute_vertex_normals()
        ball.paint_uniform_color(color)
        return ball

    def _text(self, text: str, at_m: Any, color: Sequence[float] = _TEXT) -> Any:
        """Return text that begins at a point, upright for a viewer who looks along z."""
        made = self._o3d.t.geometry.TriangleMesh.create_text(text, depth=0.1).to_legacy()
        made.scale(_LETTER_M / _LETTER_HEIGHT, np.zeros(3))
        made.rotate(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
        made.paint_uniform_color(color)
        return made.translate(at_m)


def residual_colors(residuals_m: Float64) -> Float64:
    """Return (N, 3) RGB, 0 to 1, of distances; NaN, for points without a partner, is red."""
    from matplotlib import colormaps

    place = np.clip(1e3 * np.nan_to_num(residuals_m) / _LARGEST_MM, 0.0, 1.0)
    colors = colormaps["viridis_r"](place)[:, :3]
    colors[np.isnan(residuals_m)] = _OUTLIER
    return np.asarray(colors, dtype=np.float64)


if __name__ == "__main__":
    sys.exit(main())
