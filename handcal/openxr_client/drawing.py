"""The strokes that each eye is shown, and the matrices and OpenGL that draw them.

Nothing here knows OpenXR. An image covers an eye's whole display, so the projection of the
protocol, which is in the display's pixels, holds for an image of any size.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.conventions import opengl_projection
from handcal.core.geometry import invert
from handcal.core.types import Eye, Float64, HeadsetView, Projection
from handcal.link.client import HeadsetState

Color: TypeAlias = tuple[float, float, float]

WHITE: Color = (1.0, 1.0, 1.0)
BLUE: Color = (0.2, 0.5, 1.0)
RED: Color = (1.0, 0.15, 0.1)
"""As the Unity component draws them; the wearer learns that red means rotated too far."""
_NEAR_M, _FAR_M = 0.05, 100.0
_QUADRILATERAL = (0, 1, 1, 2, 2, 3, 3, 0)
_CUBE = (*_QUADRILATERAL, 4, 5, 5, 6, 6, 7, 7, 4, 0, 4, 1, 5, 2, 6, 3, 7)
_DOT_PX, _LINE_PX = 3.0, 2.0
_OPENCV_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
_TEXT_DISTANCE_M, _LINE_HEIGHT_M, _TEXT_BOTTOM_M = 2.0, 0.04, 0.28
"""Text is fixed to the head: its distance, the height of a line (1.1°), and how far below the axis
it ends, where it hides no hand."""
_LINE_CHARACTERS = 32  # some 18°, less than the narrowest display
_FONT_PX, _ROW_PX = 36, 48


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """Something of one colour that is drawn for one eye."""

    points_m: Float64
    """(N, 3)."""
    color: Color
    kind: Literal["dots", "loop", "lines"]
    """Single points, a closed line, or a line between each pair of points."""
    is_in_world: bool = True
    """The points are in W; otherwise in V, fixed to the display."""


def strokes_of(state: HeadsetState, eye: Eye) -> list[Stroke]:
    """Return what an eye is shown, as the protocol says."""
    strokes = []
    if state.cursor_W_m is not None and eye in state.cursor_eyes:
        strokes.append(Stroke(state.cursor_W_m, WHITE, "dots"))
    if state.live_W_m is not None and eye in state.live_eyes:
        color = RED if state.is_over_limit else BLUE
        strokes.append(Stroke(state.live_W_m, color, "loop" if state.is_outline else "dots"))
    if state.shape is not None and eye in state.shape.eyes:
        corners_m = state.shape.corners_W_m
        ends = _CUBE if len(corners_m) == 8 else _QUADRILATERAL
        strokes.append(Stroke(corners_m[list(ends)], WHITE, "lines"))
    if state.target is not None and eye == state.target.eye:
        strokes.append(Stroke(state.target.corners_V_m, WHITE, "loop", is_in_world=False))
    return strokes


def own_projection(eye: Eye, view: HeadsetView) -> Projection:
    """Return the projection of the runtime's own view, to draw with before the PC has sent one."""
    left, right, up, down = view.tangents
    fx, fy = view.width_px / (right - left), view.height_px / (down - up)
    # An image begins half a pixel before the centre of its first one.
    K = [[fx, 0.0, -fx * left - 0.5, 0.0], [0.0, fy, -fy * up - 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]
    return Projection(eye, np.array(K), view.width_px, view.height_px, view.T_V_H)


def clip_from_V(projection: Projection) -> Float64:
    """Return the matrix (4, 4) from V, in OpenCV's axes, to OpenGL's clip space."""
    clip: Float64 = opengl_projection(projection, _NEAR_M, _FAR_M) @ _OPENCV_TO_OPENGL
    return clip


def text_picture(text: str) -> NDArray[np.uint8]:
    """Return a text, broken into lines, as a grey picture (rows, columns)."""
    lines = [line for part in text.split("\n") for line in textwrap.wrap(part, _LINE_CHARACTERS)]
    font = cv2.FontFace("sans")
    widths = [cv2.getTextSize((1, 1), line, (0, 0), font, _FONT_PX)[2] for line in lines]
    picture = np.zeros((_ROW_PX * max(1, len(lines)), max([1, *widths]) + 8), np.uint8)
    for row, (line, width) in enumerate(zip(lines, widths, strict=True)):
        place = ((picture.shape[1] - width) // 2, _ROW_PX * (row + 1) - _ROW_PX // 3)
        cv2.putText(picture, line, place, (255,), font, _FONT_PX)
    return picture


class Painter:
    """Draws images by OpenGL's fixed functions; a context must be current from begin to end."""

    def __init__(self) -> None:
        from OpenGL import GL

        self._gl: Any = GL
        self._frame = GL.glGenFramebuffers(1)
        self._text_texture = GL.glGenTextures(1)
        self._text = ""
        self._text_size_m = 0.0, 0.0

    def paint(
        self,
        texture: int,
        size_px: tuple[int, int],
        projection: Projection,
        T_W_H: Float64,
        strokes: Sequence[Stroke],
        text: str,
    ) -> None:
        """Draw an eye's image into a texture.

        Parameters
        ----------
        texture : int
            OpenGL's name of it; its first row is the lowest.
        size_px : (width, height)
        projection : Projection
            As it came from the PC.
        T_W_H : (4, 4) float64
        strokes : sequence of Stroke
        text : str
            Shown below the axis, fixed to the head.
        """
        gl = self._gl
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._frame)
        gl.glFramebufferTexture2D(
            gl.GL_FRAMEBUFFER, gl.GL_COLOR_ATTACHMENT0, gl.GL_TEXTURE_2D, texture, 0
        )
        gl.glViewport(0, 0, *size_px)
        gl.glClearColor(0.0, 0.0, 0.0, 0.0)  # black is transparent on an additive display
        gl.glClear(gl.GL_COLOR_BUFFER_BIT)
        gl.glDisable(gl.GL_DEPTH_TEST)
        gl.glMatrixMode(gl.GL_PROJECTION)
        gl.glLoadIdentity()
        gl.glMatrixMode(gl.GL_MODELVIEW)
        gl.glPointSize(_DOT_PX)
        gl.glLineWidth(_LINE_PX)
        gl.glEnableClientState(gl.GL_VERTEX_ARRAY)
        kinds = {"dots": gl.GL_POINTS, "loop": gl.GL_LINE_LOOP, "lines": gl.GL_LINES}
        in_V = clip_from_V(projection)
        in_H = in_V @ projection.T_V_H
        in_W = in_H @ invert(T_W_H)
        for stroke in strokes:
            self._load(in_W if stroke.is_in_world else in_V)
            points = np.ascontiguousarray(stroke.points_m, dtype=np.float32)
            gl.glColor4f(*stroke.color, 1.0)
            gl.glVertexPointer(3, gl.GL_FLOAT, 0, points)
            gl.glDrawArrays(kinds[stroke.kind], 0, len(points))
        gl.glDisableClientState(gl.GL_VERTEX_ARRAY)
        if text:
            self._load(in_H)
            self._paint_text(text)

    def mirror(self, size_px: tuple[int, int], window_px: tuple[int, int]) -> None:
        """Copy the image painted last to the window."""
        gl = self._gl
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, self._frame)
        gl.glBindFramebuffer(gl.GL_DRAW_FRAMEBUFFER, 0)
        gl.glBlitFramebuffer(0, 0, *size_px, 0, 0, *window_px, gl.GL_COLOR_BUFFER_BIT, gl.GL_LINEAR)

    def _load(self, matrix: Float64) -> None:
        self._gl.glLoadMatrixd(np.ascontiguousarray(matrix.T))  # OpenGL's is column by column

    def _paint_text(self, text: str) -> None:
        gl = self._gl
        gl.glBindTexture(gl.GL_TEXTURE_2D, self._text_texture)
        if text != self._text:
            self._text = text
            picture = text_picture(text)
            rows, columns = picture.shape
            height_m = _LINE_HEIGHT_M * rows / _ROW_PX
            self._text_size_m = height_m * columns / rows, height_m
            gl.glPixelStorei(gl.GL_UNPACK_ALIGNMENT, 1)
            gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MIN_FILTER, gl.GL_LINEAR)
            gl.glTexImage2D(
                gl.GL_TEXTURE_2D, 0, gl.GL_INTENSITY, columns, rows, 0,
                gl.GL_LUMINANCE, gl.GL_UNSIGNED_BYTE, picture,
            )  # fmt: skip
        width_m, height_m = self._text_size_m
        gl.glEnable(gl.GL_TEXTURE_2D)
        gl.glColor4f(*WHITE, 1.0)
        gl.glBegin(gl.GL_QUADS)
        for right, down in ((0, 0), (1, 0), (1, 1), (0, 1)):
            gl.glTexCoord2f(right, down)
            y_m = _TEXT_BOTTOM_M + (down - 1) * height_m
            gl.glVertex3f((right - 0.5) * width_m, y_m, _TEXT_DISTANCE_M)
        gl.glEnd()
        gl.glDisable(gl.GL_TEXTURE_2D)
