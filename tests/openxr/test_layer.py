"""Any application renders with the calibrated views, and the runtime receives its own."""

from __future__ import annotations

import copy
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.geometry import transform
from handcal.core.types import EYES, Float64
from handcal.export.openxr import LAYER
from handcal.export.outcome import SessionOutcome
from handcal.export.tools import openxr_values
from handcal.io.files import write_json
from tests.openxr.conftest import (
    OWN_ANGLES,
    SOURCES,
    VALIDATION,
    Run,
    compiled_or_skipped,
    own_views,
)

pytestmark = pytest.mark.process

POINTS_H_M = np.array([(0.0, 0.04, 0.4), (0.05, 0.06, 0.45), (-0.06, 0.0, 0.6), (-0.2, 0.1, 2.5)])
"""In the rig's head, OpenCV's axes."""
UP = np.array([1.0, -1.0, -1.0])
ARCMIN = np.degrees(1.0) * 60.0


def drawn_px(outcome: SessionOutcome, view: Float64, head: Float64, moved_m: Float64) -> Float64:
    """Return where an application draws the points for one view, as any renderer does."""
    eye = EYES[int(view[2])]
    display = outcome.record.rig.eyes[eye]
    points_W_m = Rotation.from_quat(head[2:6]).apply(POINTS_H_M * UP + moved_m) + head[6:9]
    seen = Rotation.from_quat(view[3:7]).inv().apply(points_W_m - view[7:10])
    left, right, up, down = np.tan(view[10:])
    x, y = seen[:, 0] / -seen[:, 2], seen[:, 1] / -seen[:, 2]
    share: Float64 = np.column_stack([(x - left) / (right - left), (up - y) / (up - down)])
    share *= [display.width_px, display.height_px]
    return share - 0.5


def wanted_px(outcome: SessionOutcome, view: Float64) -> Float64:
    """Return where handcal's P draws the same points."""
    eye = EYES[int(view[2])]
    T_V_H = outcome.record.rig.eyes[eye].T_V_H
    P = outcome.projection(eye).P
    image = np.column_stack([transform(T_V_H, POINTS_H_M), np.ones(len(POINTS_H_M))]) @ P.T
    pixels: Float64 = image[:, :2] / image[:, 2:]
    return pixels


def largest_px(outcome: SessionOutcome, seen: Float64, heads: Float64, moved_m: Float64) -> float:
    """Return how far from handcal's pixels an application draws the points, at most."""
    head_at = {tuple(head[:2]): head for head in heads}
    off_px = [
        drawn_px(outcome, view, head_at[tuple(view[:2])], moved_m) - wanted_px(outcome, view)
        for view in seen
    ]
    return float(np.abs(off_px).max())


def turn_rad(a: Float64, b: Float64) -> Float64:
    """Return the angles between two lists of quaternions; exact for small ones too."""
    return np.asarray((Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude())


@pytest.mark.parametrize("moved_m", [(0.0, 0.0, 0.0), (0.01, -0.041, 0.048)])
def test_an_application_draws_by_p_and_the_runtime_receives_its_own_views(
    run: Run, outcome: SessionOutcome, moved_m: tuple[float, float, float]
) -> None:
    """Also with the rig's head elsewhere than the runtime's VIEW."""
    ran = run(views=own_views(outcome, moved_m), frames=1000)
    assert (ran.returncode, ran.errors) == (0, "")
    assert len(ran.seen) == len(ran.got) == 2000
    assert np.ptp(ran.heads[:, 6]) > 1.0  # m: the head moves
    assert largest_px(outcome, ran.seen, ran.heads, np.array(moved_m)) <= 0.01
    assert 1e3 * np.abs(ran.got[:, 6:9] - ran.own[:, 6:9]).max() <= 1e-4  # mm
    assert turn_rad(ran.got[:, 2:6], ran.own[:, 2:6]).max() * ARCMIN <= 1e-3
    assert np.abs(ran.got[:, 9:] - ran.own[:, 9:]).max() * ARCMIN <= 1e-3
    assert np.abs(ran.seen[:, 7:10] - ran.own[:, 6:9]).max() > 1e-3  # m: it was corrected
    assert (ran.status["state"], ran.status["application"]) == ("active", "test application")


_PYOPENXR = """
import xr
names = ["XR_MND_headless"]
instance = xr.create_instance(xr.InstanceCreateInfo(enabled_extension_names=names))
session = xr.create_session(instance, xr.SessionCreateInfo(0, xr.get_system(instance)))
kind = xr.ReferenceSpaceCreateInfo(reference_space_type=xr.ReferenceSpaceType.VIEW)
space = xr.create_reference_space(session, kind)
stereo = xr.ViewConfigurationType.PRIMARY_STEREO
state, views = xr.locate_views(session, xr.ViewLocateInfo(stereo, 10**9, space))
for i, (pose, fov) in enumerate((view.pose, view.fov) for view in views):
    angles = fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down
    print("view 0 1", i, *pose.orientation, *pose.position, *angles)
xr.destroy_session(session)
xr.destroy_instance(instance)
"""


@pytest.mark.skipif(find_spec("xr") is None, reason="needs pip install pyopenxr")
def test_a_program_in_python_gets_the_views_of_the_file(
    run: Run, calibration: dict[str, Any]
) -> None:
    ran = run(program=(sys.executable, "-c", _PYOPENXR))
    assert ran.returncode == 0, ran.errors
    for row, view in zip(ran.seen, calibration["views"], strict=True):
        pose = view["pose"]
        wanted = [*pose["orientation"].values(), *pose["position"].values(), *view["fov"].values()]
        np.testing.assert_allclose(row[3:], wanted, atol=1e-7)
    assert ran.status["state"] == "active"


def test_without_a_calibration_or_switched_off_all_passes_through(
    run: Run, outcome: SessionOutcome
) -> None:
    for ran in (run(None), run(HANDCAL_OPENXR_OFF=1)):
        assert (ran.returncode, ran.errors) == (0, "")
        np.testing.assert_array_equal(ran.seen[:, 3:], ran.own[:, 2:])
        np.testing.assert_array_equal(ran.got, ran.own)
        assert largest_px(outcome, ran.seen, ran.heads, np.zeros(3)) > 5.0
    assert run(None).status["state"] == "off"
    assert not run(HANDCAL_OPENXR_OFF=1).status


def test_a_part_of_a_view_is_submitted_as_the_same_part_of_the_own_view(run: Run) -> None:
    ran = run(submit="crop", frames=20)
    left, right, up, down = np.moveaxis(np.tan(ran.own[:, 9:]), -1, 0)
    inner = [0.75 * left + 0.25 * right, 0.25 * left + 0.75 * right]
    inner += [0.75 * up + 0.25 * down, 0.25 * up + 0.75 * down]
    np.testing.assert_allclose(np.tan(ran.got[:, 9:]), np.transpose(inner), atol=3e-7)
    np.testing.assert_array_equal(ran.got[:, 2:9], ran.own[:, 2:9])


def test_a_pose_that_the_application_changed_is_corrected_too(run: Run) -> None:
    ran = run(submit="turn", frames=20)  # raised by 0.1 m
    np.testing.assert_allclose(ran.got[:, 6:9], ran.own[:, 6:9] + [0.0, 0.1, 0.0], atol=1e-6)
    assert turn_rad(ran.got[:, 2:6], ran.own[:, 2:6]).max() < 1e-6


def test_inner_views_keep_their_part_of_the_outer_ones(run: Run, outcome: SessionOutcome) -> None:
    outer = own_views(outcome)
    inner = outer.copy()
    inner[:, 7:] = [(-0.1, 0.05, 0.06, -0.04), (-0.03, 0.08, 0.05, -0.07)]
    ran = run(views=np.vstack([outer, inner]), frames=20, count=4)
    np.testing.assert_array_equal(ran.got, ran.own)
    own, seen = np.tan(ran.own[:, 9:]).reshape(-1, 4, 4), np.tan(ran.seen[:, 10:]).reshape(-1, 4, 4)

    def share(edges: Float64) -> Float64:
        low, high = edges[:, :2, [0, 0, 3, 3]], edges[:, :2, [1, 1, 2, 2]]
        shares: Float64 = (edges[:, 2:] - low) / (high - low)
        return shares

    np.testing.assert_allclose(share(seen), share(own), atol=1e-6)
    assert np.abs(seen - own).max() > 1e-3


def changed(calibration: dict[str, Any], **fields: Any) -> dict[str, Any]:
    return {**copy.deepcopy(calibration), **fields}


def with_other_tangent(calibration: dict[str, Any], by: float) -> dict[str, Any]:
    values = changed(calibration)
    fov = values["views"][1]["own"]["fov"]
    fov["angleUp"] = float(np.arctan(np.tan(fov["angleUp"]) + by))
    return values


def test_a_headset_that_is_not_the_rigs_is_refused_with_the_reason(
    run: Run, calibration: dict[str, Any], outcome: SessionOutcome
) -> None:
    apart, nearly, turned = own_views(outcome), own_views(outcome), own_views(outcome)
    apart[1, 4] += 0.0011
    nearly[1, 4] += 0.0009
    turned[0, :4] = (
        Rotation.from_quat(turned[0, :4]) * Rotation.from_rotvec([0, 0.0012, 0])
    ).as_quat()
    cases = [
        (run(views=apart), r"1.1 mm from where the rig has it"),
        (run(views=turned), r"turned against each other by 1.2 mrad"),
        (run(with_other_tangent(calibration, 0.0012)), r"an edge of the view lies 1.2 / 1000"),
        (run(changed(calibration, system="other")), "for the headset other"),
        (run(changed(calibration, expiresUnixS=time.time() - 1)), "expired"),
        (run(changed(calibration, views=[])), "a number is missing"),
        (run(b"{"), "not JSON"),
    ]
    for ran, reason in cases:
        assert ran.returncode == 0
        np.testing.assert_array_equal(ran.seen[:, 3:], ran.own[:, 2:])
        np.testing.assert_array_equal(ran.got, ran.own)
        assert ran.status["state"] in ("refused", "off")
        assert reason in ran.status["reason"]
    for ran in (
        run(views=nearly),
        run(with_other_tangent(calibration, 0.0008)),
        run(changed(calibration, system="test headset", expiresUnixS=time.time() + 60)),
    ):
        assert ran.status["state"] == "active"


def test_a_knob_for_the_eye_distance_that_is_turned_ends_the_correction(run: Run) -> None:
    ran = run(frames=40, TEST_TURNED_S=1.2)
    is_corrected = np.abs(ran.seen[:, 7:10] - ran.own[:, 6:9]).max(axis=1) > 1e-3
    np.testing.assert_array_equal(is_corrected, ran.own[:, 0] < 1.2)
    np.testing.assert_array_equal(ran.got, ran.own)
    assert "2.0 mm" in ran.status["reason"]


def test_with_moving_eyes_the_calibrated_eye_stays_on_the_head(
    run: Run, calibration: dict[str, Any], outcome: SessionOutcome
) -> None:
    """The runtime of an eye-tracked headset moves its views with the eyes."""
    moved = own_views(outcome)
    moved[:, 4:7] += [(0.001, 0.002, -0.001), (-0.002, 0.001, 0.003)]
    rig = outcome.record.rig
    assert rig.headset is not None
    tracked = replace(rig, headset=replace(rig.headset, moves_views=True))
    values = openxr_values(replace(outcome, record=replace(outcome.record, rig=tracked)))
    ran = run(values, moved, frames=50)
    assert largest_px(outcome, ran.seen, ran.heads, np.zeros(3)) <= 0.01
    np.testing.assert_array_equal(ran.got, ran.own)
    assert run(calibration, moved).status["state"] == "refused"


def test_another_owner_of_the_correction_has_precedence(run: Run) -> None:
    ran = run(owner="the Unity component", layer="libhandcal_openxr.so")  # the one that is loaded
    np.testing.assert_array_equal(ran.seen[:, 3:], ran.own[:, 2:])
    assert ran.status["reason"] == "the Unity component corrects already"


def test_a_new_calibration_is_taken_while_an_application_runs(
    run: Run, tmp_path: Path, calibration: dict[str, Any]
) -> None:
    def put() -> None:
        time.sleep(0.5)
        write_json(tmp_path / "config/handcal/openxr.json", calibration)

    thread = threading.Thread(target=put)
    thread.start()
    ran = run(None, frames=60, pause_ms=40)
    thread.join()
    is_corrected = np.abs(ran.seen[:, 7:10] - ran.own[:, 6:9]).max(axis=1) > 1e-3
    assert not is_corrected[0]
    assert is_corrected[-1]
    np.testing.assert_array_equal(ran.got, ran.own)


def test_a_layer_that_is_installed_twice_corrects_once(
    run: Run, outcome: SessionOutcome, tmp_path: Path
) -> None:
    folder = tmp_path / "data/openxr/1/api_layers/implicit.d"
    shutil.copyfile(folder / "handcal.json", folder / "again.json")
    ran = run(frames=5)
    assert (ran.returncode, ran.errors) == (0, "")
    assert largest_px(outcome, ran.seen, ran.heads, np.zeros(3)) <= 0.01
    np.testing.assert_array_equal(ran.got, ran.own)


def test_two_sessions_in_two_threads(run: Run, outcome: SessionOutcome) -> None:
    ran = run(sessions=2, frames=500)
    assert ran.returncode == 0
    assert set(ran.seen[:, 0]) == {0.0, 1.0}
    assert len(ran.seen) == 2000
    assert largest_px(outcome, ran.seen, ran.heads, np.zeros(3)) <= 0.01
    assert np.abs(ran.got[:, 2:] - ran.own[:, 2:]).max() == 0.0


def test_an_applications_locale_does_not_matter(run: Run, tmp_path: Path) -> None:
    command = ["localedef", "-i", "tr_TR", "-f", "UTF-8", str(tmp_path / "tr_TR.UTF-8")]
    if shutil.which("localedef") is None or subprocess.run(command, check=False).returncode:
        pytest.skip("needs the package locales")
    ran = run(locale="tr_TR.UTF-8", LOCPATH=tmp_path)  # 0,5 is a half there
    assert (ran.returncode, ran.status["state"]) == (0, "active")


def test_a_call_takes_two_microseconds(run: Run) -> None:
    ((locate_us, end_us),) = run(bench=20_000, TEST_RECORD="").other["bench"]
    assert max(locate_us, end_us) <= 2.0


def test_the_visibility_mask_moves_with_the_edges(run: Run, calibration: dict[str, Any]) -> None:
    for frames in (0, 1):  # before and after the first frame
        for eye, row in zip(EYES, run(mask=1, frames=frames).other["mask"], strict=True):
            fov = calibration["views"][EYES.index(eye)]["fov"]
            left, right, up, down = (
                np.tan(fov[f"angle{side}"]) for side in ("Left", "Right", "Up", "Down")
            )
            corners = [left, up, right, up, right, down, left, down]
            np.testing.assert_allclose(row[1:], corners, atol=2e-7)
            assert np.abs(np.tan(OWN_ANGLES[eye][0]) - left) > 1e-3


def test_the_plane_of_the_image_is_given_to_runtimes_that_reproject_by_it(run: Run) -> None:
    name = "XR_MSFT_composition_layer_reprojection"
    ran = run(TEST_EXTENSION=name, frames=5)
    between_m = ran.own[:, 6:9].reshape(-1, 2, 3).mean(axis=1)
    ahead = Rotation.from_quat(ran.own[::2, 2:6]).apply([0.0, 0.0, -1.0])
    planes = np.array(ran.other["plane"])
    np.testing.assert_allclose(planes[:, :3], between_m + 2.0 * ahead, atol=1e-5)
    np.testing.assert_allclose(planes[:, 3:], -ahead, atol=1e-6)
    assert len(run(TEST_EXTENSION=name, extension=name).other["plane"]) == 1  # asks for it itself
    assert run(TEST_EXTENSION="XR_ML_frame_end_info").other["focus"] == [[2.0]]
    assert not {"plane", "focus"} & set(run().other)


@pytest.mark.parametrize("order", [(VALIDATION, LAYER), (LAYER, VALIDATION)])
def test_core_validation_above_and_below_has_nothing_to_say(
    run: Run, tmp_path: Path, order: tuple[str, str]
) -> None:
    said = tmp_path / "said.txt"
    options = {
        "HANDCAL_OPENXR_OFF": 1,  # of the implicit one
        "XR_ENABLE_API_LAYERS": ":".join(order),
        "XR_CORE_VALIDATION_EXPORT_TYPE": "text",
        "XR_CORE_VALIDATION_FILE_NAME": said,
        "frames": 20,
    }
    ran = run(**options)
    assert ran.returncode == 0
    assert ran.status["state"] == "active"
    lines = said.read_text().splitlines() if said.exists() else []
    assert [line for line in lines if "VALID_DEBUG" not in line] == []  # newer ones say hello
    assert run(**options, wrong=1).returncode == 3
    assert "XR_TYPE_VIEW_LOCATE_INFO" in said.read_text()  # it would have said so


def mutants(data: bytes, count: int, seed: int) -> list[bytes]:
    """Return damaged copies: bytes changed, cut out, repeated and cut off."""
    rng = np.random.default_rng(seed)
    words = [
        b"1e999",
        b"-",
        b"nan",
        b"[" * 60,
        b'"',
        b"\x00",
        b"1" * 60,
        b"null",
        b"{",
        b"\\",
        b"0e-999",
    ]
    made = []
    for _ in range(count):
        mutant = bytearray(data)
        for _ in range(rng.integers(1, 6)):
            at, length = int(rng.integers(len(mutant) + 1)), int(rng.integers(1, 30))
            match rng.integers(4):
                case 0:
                    mutant[at : at + 1] = bytes([rng.integers(256)])
                case 1:
                    del mutant[at : at + length]
                case 2:
                    mutant[at:at] = mutant[at : at + 100 * length]
                case _:
                    mutant[at:at] = words[rng.integers(len(words))]
        made.append(
            bytes(mutant[: rng.integers(len(mutant) + 1)] if rng.random() < 0.2 else mutant)
        )
    return made


@pytest.mark.parametrize(
    ("count", "seed"), [(500, 1), pytest.param(10_000, 2, marks=pytest.mark.slow)]
)
def test_damaged_files_crash_nothing(
    built: Path, tmp_path: Path, calibration: dict[str, Any], count: int, seed: int
) -> None:
    reader = compiled_or_skipped(
        tmp_path,
        "read",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        str(SOURCES / "test/read.c"),
        str(SOURCES / "views.c"),
    )
    data = json.dumps(calibration).encode()
    files = [data, *mutants(data, count, seed), b'{"":' * 16_000, b"[" * 60_000]
    files += [data[:end] + tail for end in range(len(data)) for tail in (b"", b"1e5", b"-", b"\\")]
    stream = b"".join(len(one).to_bytes(4, "little") + one for one in files)
    done = subprocess.run([str(reader)], input=stream, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    assert len(done.stdout) == len(files)
    assert done.stdout[:1] == b"1"
    assert done.stdout.count(b"0") > count / 2


def test_neither_a_pipe_nor_a_huge_file_holds_an_application(run: Run) -> None:
    assert run(os.mkfifo).status["reason"] == "no calibration is in force"
    assert run(b" " * 200_000).status["reason"] == "it is too large"
