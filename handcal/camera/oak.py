"""Frames from a Luxonis OAK-D, by the package depthai (version 3)."""

from __future__ import annotations

import time
from datetime import timedelta
from typing import Any

import numpy as np

from handcal.core.errors import CameraError, CameraTimeoutError, extra_advice
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.io.closable import Closable

_RATE_HZ = 20
_STEREO_PX = 640, 400
_COLOR_PX = 1280, 720
_MM_M = 1e-3


def _library() -> Any:
    try:
        import depthai  # imported late: an extra
    except ImportError as error:
        raise CameraError("OAK-D cameras need depthai", extra_advice("oak")) from error
    return depthai


class OakCamera(Closable):
    """Live depth, aligned on the camera to its rectified colour; implements `Camera`.

    Extended disparity, so that hands from 0.2 m are measured, with subpixels and a left-right
    check. Written from the library's documentation and tested with a stand-in for the library; not
    yet run on a camera.

    Parameters
    ----------
    device_id : str
        Identifier of the device; empty for the first.

    Raises
    ------
    CameraError
        If library or camera is missing, in use, or delivers no frame with its lens.
    """

    def __init__(self, device_id: str = "") -> None:
        dai = _library()
        self._pipeline: Any = None
        self._device: Any = None
        connected = dai.Device.getAllAvailableDevices()
        chosen = [info for info in connected if device_id in ("", info.getDeviceId())]
        if not chosen:
            which = f"OAK-D {device_id} is" if device_id else "OAK-D is"
            raise CameraError(f"no {which} connected", "plug one into a USB 3 port")
        try:
            self._device = dai.Device(chosen[0])
            self.identity = CameraIdentity(
                self._device.getProductName() or self._device.getDeviceName(),
                self._device.getDeviceId(),
                "",
            )
            self.name = self.identity.model
            self._pipeline = dai.Pipeline(self._device)
            self._queue = _connect(dai, self._pipeline, self._device)
            self._pipeline.start()
            first = self._wait(10.0)
        except (RuntimeError, CameraTimeoutError) as error:
            self.close()
            raise CameraError(
                f"the OAK-D does not start: {error}",
                "close other programs that use it, or plug it in again",
            ) from error
        lens = np.asarray(first["color"].getTransformation().getIntrinsicMatrix(), np.float64)
        width, height = _COLOR_PX
        self.depth_intrinsics = Intrinsics(
            width, height, lens[0, 0], lens[1, 1], lens[0, 2], lens[1, 2]
        )

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame; see `Camera.read`."""
        if self._pipeline is None:
            raise CameraError(f"{self.name} is closed", "open it again")
        try:
            pair = self._wait(timeout_s)
        except RuntimeError as error:
            raise CameraError(f"{self.name} was unplugged: {error}", "plug it in again") from error
        depth, color = pair["depth"], pair["color"]
        camera = self.depth_intrinsics
        units = np.asarray(depth.getFrame(), np.uint16)
        image = np.asarray(color.getCvFrame(), np.uint8)[..., ::-1]  # BGR
        if units.shape != (camera.height, camera.width) or image.shape != (*units.shape, 3):
            raise CameraError(f"{self.name}: an image is not of the requested size")
        return Frame(
            index=depth.getSequenceNum(),
            t_camera_ns=round(depth.getTimestampDevice() / timedelta(microseconds=1)) * 1000,
            t_host_ns=time.monotonic_ns(),
            depth=units.copy(),
            depth_scale_m=_MM_M,
            depth_intrinsics=camera,
            color=image.copy(),
            color_intrinsics=camera,
        )

    def close(self) -> None:
        """Stop the camera; safe to call twice."""
        pipeline, self._pipeline = self._pipeline, None
        device, self._device = self._device, None
        if pipeline is not None:
            pipeline.stop()
        if device is not None:
            device.close()

    def _wait(self, timeout_s: float) -> Any:
        """Return the next pair of depth and colour."""
        pair = self._queue.get(timedelta(seconds=timeout_s))
        if pair is None:
            raise CameraTimeoutError(f"{self.name}: no frame for {timeout_s:g} s")
        return pair


def _connect(dai: Any, pipeline: Any, device: Any) -> Any:
    """Make the nodes of a pipeline, and return the queue of pairs of depth and colour."""
    sockets = dai.CameraBoardSocket

    def camera(socket: Any, size: tuple[int, int], **how: Any) -> Any:
        made = pipeline.create(dai.node.Camera).build(socket)
        return made.requestOutput(size, fps=_RATE_HZ, **how)

    color = camera(sockets.CAM_A, _COLOR_PX, enableUndistortion=True)
    stereo = pipeline.create(dai.node.StereoDepth)
    stereo.setExtendedDisparity(True)
    stereo.setSubpixel(True)
    stereo.setLeftRightCheck(True)
    camera(sockets.CAM_B, _STEREO_PX).link(stereo.left)
    camera(sockets.CAM_C, _STEREO_PX).link(stereo.right)
    sync = pipeline.create(dai.node.Sync)
    sync.setSyncThreshold(timedelta(seconds=0.5 / _RATE_HZ))
    if device.getPlatform() == dai.Platform.RVC4:
        align = pipeline.create(dai.node.ImageAlign)
        stereo.depth.link(align.input)
        color.link(align.inputAlignTo)
        align.outputAligned.link(sync.inputs["depth"])
    else:
        color.link(stereo.inputAlignTo)
        stereo.setOutputSize(*_COLOR_PX)
        stereo.depth.link(sync.inputs["depth"])
    color.link(sync.inputs["color"])
    return sync.out.createOutputQueue(maxSize=2, blocking=False)
