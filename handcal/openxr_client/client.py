"""The headset's side of a calibration on any OpenXR runtime.

H is the runtime's VIEW space and W its LOCAL space, in OpenCV's axes. The images are drawn with
the projections of the PC and submitted with the runtime's own views: a view that was submitted as
drawn would be reprojected, which undoes the correction. The client owns the correction while it
runs: handcal's layer passes its views through, and nothing is corrected twice.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.conventions import opengl_transform
from handcal.core.errors import HandcalError, extra_advice
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, HeadsetView
from handcal.export.openxr import correction_owner
from handcal.io.closable import Closable
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.nudges import NudgeSum
from handcal.link.pairing import (
    MAX_NAME_CHARACTERS,
    Pairing,
    Pairings,
    new_device_id,
    new_pairing_key,
)
from handcal.link.transport import Address
from handcal.link.wire import VERSION, hkdf
from handcal.openxr_client.drawing import Painter, own_projection, strokes_of

NAME = "handcal openxr client"
_CONFIRMING = (
    ("", "khr/simple_controller", "select/click"),
    ("", "htc/vive_controller", "trigger/click"),
    ("", "valve/index_controller", "trigger/click"),
    ("", "oculus/touch_controller", "trigger/value"),
    ("XR_EXT_hand_interaction", "ext/hand_interaction_ext", "pinch_ext/value"),
    ("XR_MSFT_hand_interaction", "microsoft/hand_interaction", "select/value"),
)
"""The extension, the profile and the component that confirms, of controllers and hands."""
_PRESSES = {"LEFT": (-1, 0, 0), "RIGHT": (1, 0, 0), "UP": (0, -1, 0), "DOWN": (0, 1, 0)}
_PRESSES |= dict.fromkeys(("EQUAL", "KP_ADD"), (0, 0, 1))
_PRESSES |= dict.fromkeys(("MINUS", "KP_SUBTRACT"), (0, 0, -1))
"""Steps to the right, down and in size by the keys of the window; + is beside or above =."""
_CONFIRM_KEYS = "SPACE", "ENTER", "KP_ENTER"
_WINDOW_PX = 640, 360
_WHOLE = 3  # both bits of XrSpaceLocationFlags and XrViewStateFlags: orientation and position
_MOVED_M, _MOVED = 5e-4, 1e-3
"""A view that has moved, or an edge of it (a tangent), by more is reported again."""
_FORMATS = 0x8C43, 0x8058  # GL_SRGB8_ALPHA8, GL_RGBA8
_SWAP_WAIT_NS = 10**9
_IDLE_S = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image to be displayed."""

    display_ns: int
    """The predicted time of display, on this program's clock (`clock_ns`)."""
    T_W_H: Float64 | None
    """The head at that time; None while the runtime does not track it."""
    views: Mapping[Eye, HeadsetView]
    """The runtime's own views; none while it shows nothing of this program."""
    xr_time: int
    xr_views: Any
    """Time and views as the runtime gave them, in W, to be given back with the images."""


def clock_ns() -> int:
    """Return the time on the clock to which the runtime's times are converted."""
    return time.perf_counter_ns()


def paired_identity(pairings: Pairings) -> tuple[str, bytes]:
    """Return the device and key of this computer's OpenXR headset, pairing it the first time.

    Raises
    ------
    FileError
        If the file of the paired devices cannot be written.
    """
    for pairing in pairings.all:
        if pairing.device_id and pairing.name == NAME:
            return pairing.device_id, pairing.key.encode()
    device_id, key = new_device_id(), new_pairing_key()
    pairings.bind(Pairing(key), device_id, NAME)
    return device_id, key.encode()


def run_openxr_client(
    server: Address,
    pairing_key: bytes,
    device_id: str = "",
    is_stopped: Callable[[], bool] = lambda: False,
    connect: Callable[..., HeadsetClient] = HeadsetClient,
) -> None:
    """Show what the PC wants shown, send poses and confirmations, until its window is closed.

    Parameters
    ----------
    server : (host, port)
    pairing_key : bytes
    device_id : str
        The device to which the key belongs; empty: one made of the key, the same each time.
    is_stopped : callable
        Called for every image.
    connect : callable
        Makes the link's client.

    Raises
    ------
    HandcalError
        If there is no runtime or headset, or a package is missing.
    LinkError
        If the PC's name is unknown.
    """
    with ExitStack() as stack:
        runtime = stack.enter_context(Runtime())
        identity = HeadsetIdentity(
            device_id or hkdf(pairing_key, b"", b"openxr client", 8).hex(),
            name=runtime.system,
            runtime=runtime.name,
            app=f"handcal {version('handcal')}",
            protocol=VERSION,
        )
        link = stack.enter_context(connect(server, pairing_key, identity, clock_ns))
        wearer = _Wearer(link)
        waiting = f"Waiting for the PC at {server[0]}:{server[1]}"
        with runtime.failing("the OpenXR runtime has failed"):
            while not (is_stopped() or runtime.is_over):  # also after a session of the PC has ended
                frame = runtime.wait()
                if frame is None:
                    continue
                if frame.T_W_H is not None:
                    link.send_pose(frame.T_W_H, frame.display_ns)
                if _has_moved(identity.views, frame.views):
                    identity = replace(identity, views=frame.views)
                    link.set_identity(identity)
                wearer.act(runtime)
                # Read last: what is confirmed next is what is drawn now.
                wearer.shown = link.state()
                text = wearer.shown.prompt if link.connected else (link.refusal or waiting)
                runtime.show(frame, wearer.shown, text)


class _Wearer:
    """Sends what the wearer says about the image that is shown."""

    def __init__(self, link: HeadsetClient) -> None:
        self.shown = HeadsetState()
        self._link = link
        self._verification = 0
        self._moved = NudgeSum()

    def act(self, runtime: Runtime) -> None:
        """Send the presses and confirmations since the last image."""
        request = self.shown.verify
        presses = runtime.take_presses()
        confirmed_ns = runtime.take_confirmation()
        if request is None:
            self._moved = NudgeSum()
            if confirmed_ns is not None and self.shown.cursor_W_m is not None:
                self._link.confirm(confirmed_ns, self.shown)
            return
        if request.verify_id != self._verification:
            self._verification, self._moved = request.verify_id, NudgeSum()
        for right, down, size in presses:
            with suppress(ValueError):  # farther than a drawing may be moved
                self._moved = self._moved.plus(
                    right * request.step_arcmin,
                    down * request.step_arcmin,
                    size * request.step_size,
                )
        if presses:
            self._link.nudge(clock_ns(), self.shown, self._moved)
        if confirmed_ns is not None:
            self._link.nudge(confirmed_ns, self.shown, self._moved, fits=True)


def _has_moved(reported: Mapping[Eye, HeadsetView], views: Mapping[Eye, HeadsetView]) -> bool:
    return bool(views) and any(
        eye not in reported
        or np.abs(view.T_V_H - reported[eye].T_V_H).max() > _MOVED_M
        or np.abs(view.tangents - reported[eye].tangents).max() > _MOVED
        for eye, view in views.items()
    )


class Runtime(Closable):
    """A session of OpenXR with a window: images for both eyes, head, controllers and keys.

    All of it belongs to the thread that makes it.

    Attributes
    ----------
    name, system : str
        The runtime's and the headset's.
    is_over : bool
        True once the runtime or the user has ended the session.

    Raises
    ------
    HandcalError
        If there is no runtime, headset or display, or a package is missing.
    """

    def __init__(self) -> None:
        try:
            import glfw
            import xr
        except ImportError as error:
            raise HandcalError(
                "the OpenXR client needs pyopenxr and glfw", extra_advice("openxr")
            ) from error
        self._xr: Any = xr
        self._glfw: Any = glfw
        self.is_over = False
        self._is_running = False
        self._presses: list[tuple[int, int, int]] = []
        self._confirmed_ns: int | None = None
        self._stack = ExitStack()
        with ExitStack() as stack:
            stack.enter_context(correction_owner(NAME))
            self._open_window(stack)
            with self.failing("no OpenXR runtime could be used"):
                self._open_session(stack)
            self._painter = Painter()
            self._stack = stack.pop_all()

    def close(self) -> None:
        """End the session; safe to call twice."""
        self._stack.close()

    @contextmanager
    def failing(self, what: str) -> Iterator[None]:
        """Say of a failure of the runtime what became of it."""
        xr = self._xr
        try:
            yield
        except xr.exception.FormFactorUnavailableError as error:
            raise HandcalError("no headset is connected", "connect it and try again") from error
        except xr.XrException as error:
            reason = str(error) or type(error).__name__
            raise HandcalError(
                f"{what}: {reason}", "start the headset's software, such as SteamVR or Monado"
            ) from error

    def _destroy(self, destroy: Callable[[Any], None], handle: Any) -> None:
        with suppress(self._xr.XrException):  # the runtime may have ended before
            destroy(handle)

    def _open_window(self, stack: ExitStack) -> None:
        glfw = self._glfw
        if sys.platform == "linux":  # the runtime takes a context of GLX
            glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)
        if not glfw.init():
            raise HandcalError("no display found for the client's window", "set DISPLAY")
        stack.callback(glfw.terminate)
        self._window = glfw.create_window(*_WINDOW_PX, NAME, None, None)
        if not self._window:
            raise HandcalError("no window with OpenGL", "update the graphics driver")
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # the runtime sets the pace
        presses = {getattr(glfw, f"KEY_{key}"): press for key, press in _PRESSES.items()}
        confirming = {getattr(glfw, f"KEY_{key}") for key in _CONFIRM_KEYS}

        def on_key(_window: Any, key: int, _code: int, action: int, _modifiers: int) -> None:
            if key in presses and action != glfw.RELEASE:
                self._presses.append(presses[key])
            elif key in confirming and action == glfw.PRESS:
                self._confirmed_ns = clock_ns()
            elif key == glfw.KEY_ESCAPE:
                self.is_over = True

        glfw.set_key_callback(self._window, on_key)

    def _open_session(self, stack: ExitStack) -> None:
        xr = self._xr
        known = {
            extension.extension_name.decode()
            for extension in xr.enumerate_instance_extension_properties()
        }
        clock = (
            "XR_KHR_win32_convert_performance_counter_time"
            if sys.platform == "win32"
            else "XR_KHR_convert_timespec_time"
        )
        needed = ["XR_KHR_opengl_enable", clock]
        if missing := [extension for extension in needed if extension not in known]:
            raise HandcalError(
                f"the OpenXR runtime lacks {' and '.join(missing)}",
                "choose another runtime, such as SteamVR or Monado",
            )
        self._profiles = [one for one in _CONFIRMING if not one[0] or one[0] in known]
        extensions = [*needed, *(one[0] for one in self._profiles if one[0])]
        self._instance = xr.create_instance(
            xr.InstanceCreateInfo(
                application_info=xr.ApplicationInfo(NAME, api_version=xr.Version(1, 0, 0)),
                enabled_extension_names=extensions,
            )
        )
        stack.callback(self._destroy, xr.destroy_instance, self._instance)
        self.name = _name(xr.get_instance_properties(self._instance).runtime_name)
        system = xr.get_system(self._instance)
        self.system = _name(xr.get_system_properties(self._instance, system).system_name)
        stereo = xr.ViewConfigurationType.PRIMARY_STEREO
        sizes = xr.enumerate_view_configuration_views(self._instance, system, stereo)
        modes = xr.enumerate_environment_blend_modes(self._instance, system, stereo)
        see_through = xr.EnvironmentBlendMode.ADDITIVE, xr.EnvironmentBlendMode.ALPHA_BLEND
        self._blend = next((mode for mode in see_through if mode in modes), modes[0])
        xr.get_opengl_graphics_requirements_khr(self._instance, system)  # must be asked for
        binding = self._graphics_binding()
        self._session = xr.create_session(
            self._instance,
            xr.SessionCreateInfo(
                system_id=system, next=ctypes.cast(ctypes.pointer(binding), ctypes.c_void_p)
            ),
        )
        stack.callback(self._destroy, xr.destroy_session, self._session)
        self._world, self._head = (
            xr.create_reference_space(self._session, xr.ReferenceSpaceCreateInfo(kind))
            for kind in (xr.ReferenceSpaceType.LOCAL, xr.ReferenceSpaceType.VIEW)
        )
        formats = list(xr.enumerate_swapchain_formats(self._session))
        self._format = next((one for one in _FORMATS if one in formats), formats[0])
        self._eyes = {eye: self._make_images(size) for eye, size in zip(EYES, sizes, strict=True)}
        self._bind_actions()

    def _graphics_binding(self) -> Any:
        xr = self._xr
        if sys.platform == "win32":
            from OpenGL import WGL

            return xr.GraphicsBindingOpenGLWin32KHR(
                h_dc=WGL.wglGetCurrentDC(), h_glrc=WGL.wglGetCurrentContext()
            )
        from OpenGL import GLX

        return xr.GraphicsBindingOpenGLXlibKHR(
            x_display=GLX.glXGetCurrentDisplay(),
            glx_drawable=GLX.glXGetCurrentDrawable(),
            glx_context=GLX.glXGetCurrentContext(),
        )

    def _make_images(self, size: Any) -> tuple[Any, list[int], tuple[int, int]]:
        """Return an eye's swapchain, the textures of its images, and their size."""
        xr = self._xr
        width, height = size.recommended_image_rect_width, size.recommended_image_rect_height
        flags = xr.SwapchainUsageFlags
        swapchain = xr.create_swapchain(
            self._session,
            xr.SwapchainCreateInfo(
                usage_flags=flags.COLOR_ATTACHMENT_BIT | flags.SAMPLED_BIT,
                format=self._format,
                sample_count=1,
                width=width,
                height=height,
                face_count=1,
                array_size=1,
                mip_count=1,
            ),
        )
        images = xr.enumerate_swapchain_images(swapchain, xr.SwapchainImageOpenGLKHR)
        return swapchain, [image.image for image in images], (width, height)

    def _bind_actions(self) -> None:
        xr = self._xr
        self._actions = xr.create_action_set(
            self._instance, xr.ActionSetCreateInfo("calibration", "Calibration")
        )
        self._confirm = xr.create_action(
            self._actions, xr.ActionCreateInfo("confirm", localized_action_name="Confirm")
        )
        for _, profile, component in self._profiles:
            paths = (f"/user/hand/{hand}/input/{component}" for hand in ("left", "right"))
            bindings = [
                xr.ActionSuggestedBinding(self._confirm, xr.string_to_path(self._instance, path))
                for path in paths
            ]
            path = xr.string_to_path(self._instance, f"/interaction_profiles/{profile}")
            with suppress(xr.XrException):  # of a runtime that does not know this profile
                xr.suggest_interaction_profile_bindings(
                    self._instance,
                    xr.InteractionProfileSuggestedBinding(path, suggested_bindings=bindings),
                )
        xr.attach_session_action_sets(
            self._session, xr.SessionActionSetsAttachInfo(action_sets=[self._actions])
        )

    def wait(self) -> Frame | None:
        """Wait until the next image is wanted; None if none is, for a while."""
        xr = self._xr
        self._poll()
        if not self._is_running or self.is_over:
            time.sleep(_IDLE_S)
            return None
        state = xr.wait_frame(self._session)
        xr.begin_frame(self._session)
        self._sync()
        at = state.predicted_display_time
        head = xr.locate_space(self._head, self._world, at)
        is_tracked = head.location_flags & _WHOLE == _WHOLE
        _, xr_views = self._locate(at, self._world)
        own_state, own_views = self._locate(at, self._head)
        views: dict[Eye, HeadsetView] = {}
        if state.should_render and own_state.view_state_flags & _WHOLE == _WHOLE:
            for eye, view in zip(EYES, own_views, strict=True):
                fov = view.fov
                angles = fov.angle_left, fov.angle_right, -fov.angle_up, -fov.angle_down
                T_V_H = invert(_transform(view.pose))
                views[eye] = HeadsetView(T_V_H, np.tan(angles), *self._eyes[eye][2])
        return Frame(
            self._to_clock_ns(at),
            _transform(head.pose) if is_tracked else None,
            views,
            at,
            xr_views,
        )

    def show(self, frame: Frame, state: HeadsetState, text: str) -> None:
        """Draw and submit the image of both eyes."""
        xr, glfw = self._xr, self._glfw
        layers = []
        if frame.T_W_H is not None and frame.views:
            parts = []
            for eye, view in zip(EYES, frame.xr_views, strict=True):
                swapchain, textures, size_px = self._eyes[eye]
                index = xr.acquire_swapchain_image(swapchain)
                xr.wait_swapchain_image(swapchain, xr.SwapchainImageWaitInfo(_SWAP_WAIT_NS))
                projection = state.drawn.get(eye) or own_projection(eye, frame.views[eye])
                strokes = strokes_of(state, eye)
                shown = text if eye in state.eyes else ""
                self._painter.paint(
                    textures[index], size_px, projection, frame.T_W_H, strokes, shown
                )
                if eye == EYES[0]:
                    window_px = glfw.get_framebuffer_size(self._window)
                    self._painter.mirror(size_px, window_px)
                xr.release_swapchain_image(swapchain)
                rectangle = xr.Rect2Di(xr.Offset2Di(0, 0), xr.Extent2Di(*size_px))
                part = xr.SwapchainSubImage(swapchain, rectangle, 0)
                parts.append(xr.CompositionLayerProjectionView(view.pose, view.fov, part))
            layer = xr.CompositionLayerProjection(space=self._world, views=parts)
            layers.append(ctypes.byref(layer))
        xr.end_frame(self._session, xr.FrameEndInfo(frame.xr_time, self._blend, layers=layers))
        glfw.swap_buffers(self._window)
        glfw.set_window_title(self._window, f"{NAME}: {text}" if text else NAME)

    def take_presses(self) -> list[tuple[int, int, int]]:
        """Return the steps to the right, down and in size since the last call."""
        presses, self._presses = self._presses, []
        return presses

    def take_confirmation(self) -> int | None:
        """Return when the wearer has confirmed since the last call; None if not."""
        confirmed_ns, self._confirmed_ns = self._confirmed_ns, None
        return confirmed_ns

    def _poll(self) -> None:
        xr, glfw = self._xr, self._glfw
        glfw.poll_events()
        self.is_over |= bool(glfw.window_should_close(self._window))
        while True:
            try:
                event = xr.poll_event(self._instance)
            except xr.exception.EventUnavailable:
                return
            if event.type == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                self.is_over = True
            if event.type != xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                continue
            changed = ctypes.cast(
                ctypes.byref(event), ctypes.POINTER(xr.EventDataSessionStateChanged)
            ).contents
            match changed.state:
                case xr.SessionState.READY:
                    xr.begin_session(self._session, xr.SessionBeginInfo())
                    self._is_running = True
                case xr.SessionState.STOPPING:
                    self._is_running = False
                    xr.end_session(self._session)
                case xr.SessionState.EXITING | xr.SessionState.LOSS_PENDING:
                    self.is_over = True

    def _sync(self) -> None:
        """Take the newest press of a controller or pinch of a hand."""
        xr = self._xr
        with suppress(xr.exception.SessionNotFocused):
            active = xr.ActiveActionSet(self._actions)
            xr.sync_actions(self._session, xr.ActionsSyncInfo(active_action_sets=[active]))
        state = xr.get_action_state_boolean(self._session, xr.ActionStateGetInfo(self._confirm))
        if state.is_active and state.current_state and state.changed_since_last_sync:
            self._confirmed_ns = self._to_clock_ns(state.last_change_time)

    def _locate(self, at: int, space: Any) -> tuple[Any, Any]:
        xr = self._xr
        stereo = xr.ViewConfigurationType.PRIMARY_STEREO
        found: tuple[Any, Any] = xr.locate_views(
            self._session, xr.ViewLocateInfo(stereo, at, space)
        )
        return found

    def _to_clock_ns(self, xr_time: int) -> int:
        xr = self._xr
        if sys.platform == "win32":
            ticks = xr.convert_time_to_win32_performance_counter_khr(self._instance, xr_time)
            hz = ctypes.c_int64()
            ctypes.windll.kernel32.QueryPerformanceFrequency(ctypes.byref(hz))
            return int(ticks) * 10**9 // hz.value
        stamp = xr.convert_time_to_timespec_time_khr(self._instance, xr_time)
        return int(stamp.tv_sec) * 10**9 + int(stamp.tv_nsec)


def _name(text: bytes) -> str:
    """Return a runtime's text as far as the link takes it; Monado's name has 47 characters."""
    shown = "".join(one for one in text.decode(errors="replace") if one.isprintable())
    return shown[:MAX_NAME_CHARACTERS]


def _transform(pose: Any) -> Float64:
    """Return an XrPosef as a transform in OpenCV's axes."""
    q, p = pose.orientation, pose.position
    R = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    return opengl_transform(rigid(R, [p.x, p.y, p.z]))
