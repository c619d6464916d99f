"""Orbbec and OAK-D cameras, before stand-ins for their libraries."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from handcal.camera.live import is_live, open_live
from handcal.camera.oak import OakCamera
from handcal.camera.orbbec import OrbbecCamera
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.types import Intrinsics
from tests.camera.stand_ins import T_C_D, OakStandIn, OrbbecStandIn


@pytest.fixture
def orbbec(monkeypatch: pytest.MonkeyPatch) -> OrbbecStandIn:
    sdk = OrbbecStandIn()
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", sdk)
    return sdk


@pytest.fixture
def oak(monkeypatch: pytest.MonkeyPatch) -> OakStandIn:
    library = OakStandIn()
    monkeypatch.setitem(sys.modules, "depthai", library)
    return library


def test_an_orbbec_tells_its_lenses_and_units(orbbec: OrbbecStandIn) -> None:
    with OrbbecCamera("AB1") as camera:
        frame = camera.read()
    eight = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert frame.depth_intrinsics == Intrinsics(64, 48, 60.0, 61.0, 32.0, 24.0, eight)
    assert frame.color_intrinsics == Intrinsics(80, 60, 60.0, 61.0, 40.0, 30.0)
    assert frame.depth_scale_m == pytest.approx(0.00025)
    assert frame.t_camera_ns == 33_000_000
    np.testing.assert_allclose(frame.T_C_D, T_C_D)
    orbbec.lens_model = "BC"
    with OrbbecCamera() as camera:
        assert camera.depth_intrinsics.distortion == (0.1, 0.0, 0.0, 0.0, 0.0)


def test_an_orbbec_without_colour_gives_depth(orbbec: OrbbecStandIn) -> None:
    with OrbbecCamera() as camera:
        orbbec.has_color = False
        frame = camera.read()
    assert frame.color is None
    assert frame.depth.any()


def test_an_orbbec_with_an_unknown_lens_is_refused(orbbec: OrbbecStandIn) -> None:
    orbbec.lens_model = "KANNALA_BRANDT4"
    with pytest.raises(CameraError, match="lens model KANNALA_BRANDT4"):
        OrbbecCamera()


@pytest.mark.parametrize(
    ("platform", "into"),
    [("RVC2", "StereoDepth.inputAlignTo"), ("RVC4", "ImageAlign.inputAlignTo")],
)
def test_an_oak_aligns_depth_to_colour(oak: OakStandIn, platform: str, into: str) -> None:
    oak.platform = platform
    with OakCamera("18A") as camera:
        frame = camera.read()
    assert f"Camera A > {into}" in oak.links
    assert "Camera A > Sync.inputs[color]" in oak.links
    assert {"Camera B > StereoDepth.left", "Camera C > StereoDepth.right"} <= set(oak.links)
    assert frame.depth_intrinsics == Intrinsics(1280, 720, 800.0, 801.0, 640.0, 360.0)
    assert frame.color_intrinsics == frame.depth_intrinsics
    assert frame.t_camera_ns == 66_000_000  # the first pair told the lens


def test_faults_of_an_orbbec_are_one_line(orbbec: OrbbecStandIn) -> None:
    with pytest.raises(CameraError, match=r"camera 7 does not start: no such device"):
        OrbbecCamera("7")
    with OrbbecCamera() as camera:
        orbbec.is_silent = True
        with pytest.raises(CameraTimeoutError, match=r"no frame for 0\.01 s"):
            camera.read(0.01)
        orbbec.is_plugged = False
        with pytest.raises(CameraError, match="plug it in again"):
            camera.read()
    with pytest.raises(CameraError, match="no Orbbec camera is connected"):
        OrbbecCamera()


def test_faults_of_an_oak_are_one_line(oak: OakStandIn) -> None:
    with pytest.raises(CameraError, match="no OAK-D 7 is connected"):
        OakCamera("7")
    with OakCamera() as camera:
        oak.is_silent = True
        with pytest.raises(CameraTimeoutError, match=r"no frame for 0\.01 s"):
            camera.read(0.01)
        oak.is_plugged = False
        with pytest.raises(CameraError, match="plug it in again"):
            camera.read()
    with pytest.raises(CameraError, match="no OAK-D is connected"):
        OakCamera()


@pytest.mark.parametrize(
    ("module", "camera", "extra"),
    [("pyorbbecsdk", OrbbecCamera, "orbbec"), ("depthai", OakCamera, "oak")],
)
def test_a_missing_library_names_its_extra(
    monkeypatch: pytest.MonkeyPatch, module: str, camera: type, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(CameraError, match=rf"pip install 'handcal\[{extra}\]'"):
        camera()
    monkeypatch.setattr(sys, "frozen", True, raising=False)  # in the Debian package, without pip
    with pytest.raises(CameraError, match="install handcal's wheel"):
        camera()


def test_a_live_camera_is_opened_by_name(orbbec: OrbbecStandIn, oak: OakStandIn) -> None:
    assert orbbec.is_plugged
    assert oak.is_plugged
    for source in ("orbbec", "orbbec:AB1", "oak", "oak:18A"):
        assert is_live(source)
        with open_live(source) as camera:
            assert camera.identity.serial_number in ("AB1", "18A")
    assert is_live("hololens2:hl")
    assert not any(map(is_live, ("realsense", "simulator", "oaks", "a/orbbec", "")))
    with pytest.raises(CameraError, match="camera 7 does not start"):
        open_live("orbbec:7")
