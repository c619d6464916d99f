"""Real frames from the detector's box to the segmented hand."""

import json
from pathlib import Path

import cv2
import numpy as np

from handcal.camera.images import read_depth
from handcal.detector import load_detector
from handcal.hand.detect import overlaps
from handcal.hand.finder import HandFinder
from handcal.hand.roi import RoiFinder
from handcal.hand.settings import SegmentSettings
from handcal.image_file import read_image
from handcal.types import Frame, Intrinsics

SETTINGS = SegmentSettings()


def test_real_hands_are_segmented_where_the_detector_saw_them(shared_data: Path) -> None:
    folder = shared_data / "rgbd" / "color_aligned_640"
    shots = json.loads((folder / "meta.json").read_text())
    detector = load_detector()
    beyond_m = []
    for name, shot in shots.items():
        camera = Intrinsics(640, 480, *shot["intrinsics"])
        depth = read_depth(folder / f"{name}_depth.png", camera)
        color = read_image(folder / f"{name}_color.jpg", cv2.IMREAD_COLOR_RGB)
        frame = Frame(0, 0, 0, depth, shot["depth_unit_m"], camera, color, camera)
        roi_px = RoiFinder(detector, SETTINGS).find(frame)
        assert roi_px is not None
        assert overlaps(np.array([roi_px], float), np.array([shot["hand_box"]]))[0, 0] >= 0.5
        cloud = HandFinder(SETTINGS, detector).find(frame)
        truth = cv2.imread(str(folder / f"{name}_handmask.png"), cv2.IMREAD_GRAYSCALE)
        assert truth is not None
        gated = (truth > 0) & (depth >= 350) & (depth <= 700)
        assert (cloud.mask[gated] > 0).mean() > 0.95
        joints_m = np.array(shot["joints3d_mm"]) / 1000.0
        arm_axis = joints_m[0] - joints_m[9]
        arm_axis /= np.linalg.norm(arm_axis)
        beyond_m.append(((cloud.contour_m[cloud.contour_is_cut] - joints_m[0]) @ arm_axis).mean())
    assert 0.0 < np.mean(beyond_m) < 0.03
