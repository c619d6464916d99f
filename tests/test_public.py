"""The public names: what a researcher types in a notebook works as written."""

from __future__ import annotations

import doctest
import importlib
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handcal
from handcal.camera.images import write_frame
from handcal.core.display import projection_matrix
from handcal.core.types import EYES, Eye, EyeShift
from handcal.register.results import Results
from handcal.rig.example import example_rig
from handcal.session.session import SessionRecord
from handcal.sim.camera import simulated_frame
from tests.helpers import ROOT

THE_BLOCKS = re.findall(
    r"```python\n(.*?)```", (ROOT / "docs/api.md").read_text("utf-8"), re.DOTALL
)
PUBLIC = {
    "open_session", "solve", "projections", "read_cloud", "read_frame", "segment", "read_rig",
    "write_rig",
    "HandcalError", "HandError", "Frame", "HandCloud", "Alignment", "EyeDistance", "EyeShift",
    "Rig", "Results", "EyeCamera", "Fov", "Intrinsics", "Pose", "SessionRecord",
    "example_rig", "example_session", "simulated_frame",
    "to_unity", "to_opengl", "to_openxr", "__version__",
    "solve_eye_shift", "update_matrix", "rotation_between",
}  # fmt: skip
FUNCTIONS = sorted(name for name in PUBLIC - {"__version__"} if name.islower())
LEFT_LINE = (
    "φ = (+4.20 ± 1.14, -4.39 ± 0.96, +0.91 ± 2.54) mm; rms 1.55 mm, 97 % inliers, converged"
)
HAND_LINE = "a hand 0.48 m from the camera"
RESULTS_LINE = (
    "consistent, 2 alignments: "
    "left φ = (+4.20 ± 1.14, -4.39 ± 0.96, +0.91 ± 2.54) mm, accept; "
    "right φ = (+2.92 ± 0.94, -4.43 ± 0.95, +0.90 ± 2.55) mm, accept"
)


@pytest.fixture(scope="module")
def session() -> SessionRecord:
    return handcal.open_session(ROOT / "resources/example_session")


@pytest.fixture(scope="module")
def results(session: SessionRecord) -> Results:
    return handcal.solve(session)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a simulated frame as files."""
    folder = tmp_path_factory.mktemp("notebook")
    write_frame(folder, simulated_frame(seed=1))
    return folder


def test_the_page_s_notebook_runs_in_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    said: dict[str, Any] = {}
    for block in THE_BLOCKS:
        exec(block, said)
    assert capsys.readouterr().out.splitlines() == [RESULTS_LINE, LEFT_LINE, HAND_LINE]
    assert {eye: P.shape for eye, P in said["P"].items()} == {"left": (3, 4), "right": (3, 4)}
    assert set(said["unity"]) == set(EYES)


def test_completion_offers_exactly_the_public_names() -> None:
    assert set(dir(handcal)) == set(handcal.__all__) == PUBLIC
    assert all(getattr(handcal, name) is not None for name in PUBLIC)
    assert handcal.__version__ == version("handcal")


@pytest.mark.process
def test_the_import_is_quick() -> None:
    code = "import sys, handcal; dir(handcal); print(*{'numpy', 'scipy', 'cv2'} & set(sys.modules))"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert run.stdout.split() == []


@pytest.mark.parametrize("kind", [str, Path])
def test_paths_may_be_text_or_path(
    pictures: Path, tmp_path: Path, kind: Callable[[Path], str | os.PathLike[str]]
) -> None:
    session = handcal.open_session(kind(ROOT / "resources/example_session"))
    rig = handcal.read_rig(kind(ROOT / "resources/example_rig.yaml"))
    handcal.write_rig(kind(tmp_path / "rig.yaml"), rig)
    names = "color.png", "depth.png", "intrinsics.json"
    color, depth, intrinsics = (kind(pictures / name) for name in names)
    frame = handcal.read_frame(color, depth, intrinsics)
    assert len(session.alignments) == 2
    assert len(handcal.solve(kind(session.path)).alignments) == 2
    assert handcal.read_rig(kind(tmp_path / "rig.yaml")).name == rig.name
    np.testing.assert_array_equal(frame.depth, simulated_frame(seed=1).depth)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda path: handcal.open_session(path),
        lambda path: handcal.solve(path),
        lambda path: handcal.read_rig(path),
        lambda path: handcal.read_frame(path, path, path),
        lambda path: handcal.write_rig(Path(path) / "rig.yaml", example_rig()),
    ],
    ids=["open_session", "solve", "read_rig", "read_frame", "write_rig"],
)
@pytest.mark.parametrize("path", ["missing", "a_file"])
def test_a_wrong_path_is_one_line(
    wrong: Callable[[str], object], path: str, tmp_path: Path
) -> None:
    (tmp_path / "a_file").write_text("nothing of use")
    with pytest.raises(handcal.HandcalError) as caught:
        wrong(str(tmp_path / path))
    assert path in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_choices_are_refused_by_name(session: SessionRecord) -> None:
    with pytest.raises(ValueError, match="unknown method 'best': choose from paper, linear"):
        handcal.solve(session, method="best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="unknown roi 'all': choose from detector, left"):
        handcal.segment(simulated_frame(), roi="all")  # type: ignore[arg-type]


def test_an_argument_of_another_kind_is_named(results: Results) -> None:
    with pytest.raises(TypeError, match="frame must be of type Frame, not NoneType"):
        handcal.segment(None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="rig must be of type Rig, not str"):
        handcal.to_unity("rig.yaml", results)  # type: ignore[arg-type]


def documented(kind: type) -> dict[str, str]:
    """Return the text of each name in a docstring's section Attributes."""
    _, _, section = (inspect.getdoc(kind) or "").partition("Attributes\n----------\n")
    section = re.split(r"\n\n\w+\n---", section)[0]
    entries = re.findall(r"^(\w.*)\n((?: {4}.*(?:\n|$))*)", section, re.MULTILINE)
    return {name: text.strip() for names, text in entries for name in names.split(", ")}


@pytest.mark.parametrize(
    "kind",
    [one for name in sorted(PUBLIC) if is_dataclass(one := getattr(handcal, name))],
)
def test_help_explains_every_field_and_property(kind: type) -> None:
    texts = documented(kind)
    assert list(texts) == [field.name for field in fields(kind)]
    assert all(texts.values())
    for name, value in vars(kind).items():
        if isinstance(value, property) and not name.startswith("_"):
            assert value.__doc__, name


@pytest.mark.parametrize("roi", ["detector", "left", "right", "depth"])
def test_a_hand_is_segmented_wherever_one_looks(roi: Any) -> None:
    hand = handcal.segment(simulated_frame(seed=1), roi=roi)
    assert 4000 < len(hand.points_m) < 6000


def test_projections_are_those_the_headset_gets(session: SessionRecord, results: Results) -> None:
    P = handcal.projections(session.rig, results)
    for eye in EYES:
        expected = projection_matrix(session.rig.eyes[eye], results.eyes[eye].shift_m)
        np.testing.assert_array_equal(P[eye], expected)


def test_an_eye_that_was_not_solved_keeps_its_offline_calibration(results: Results) -> None:
    class OnlyLeft:
        eyes: dict[Eye, EyeShift] = {"left": results.eyes["left"]}  # noqa: RUF012

    rig = example_rig()
    P = handcal.projections(rig, OnlyLeft())
    np.testing.assert_array_equal(P["right"], projection_matrix(rig.eyes["right"]))
    assert set(handcal.to_openxr(rig, OnlyLeft())) == set(EYES)


def test_every_system_draws_a_point_on_the_same_pixel(
    session: SessionRecord, results: Results
) -> None:
    rig = session.rig
    point_H_m = np.array([0.01, 0.02, 0.6, 1.0])
    P = handcal.projections(rig, results)
    unity, opengl = handcal.to_unity(rig, results), handcal.to_opengl(rig, results)
    openxr = handcal.to_openxr(rig, results)
    for eye in EYES:
        display = rig.eyes[eye]
        point_V_m = display.T_V_H @ point_H_m
        x, y, depth = P[eye] @ point_V_m
        expected_px = x / depth, y / depth
        for camera, axes in ((unity[eye], (1, -1, 1, 1)), (opengl[eye], (1, -1, -1, 1))):
            clip = camera.projection @ camera.view_from_head @ (axes * point_H_m)
            ndc = clip[:3] / clip[3]
            u_px = 0.5 * (ndc[0] + 1) * display.width_px - 0.5
            v_px = 0.5 * (1 - ndc[1]) * display.height_px - 0.5
            np.testing.assert_allclose((u_px, v_px), expected_px, atol=1e-6)
        pose, fov = openxr[eye]
        right_m, up_m, back_m = (1, -1, -1) * point_V_m[:3] - pose.position_m
        left, right, down, up = map(np.tan, (fov.left_rad, fov.right_rad, fov.down_rad, fov.up_rad))
        u_px = (-right_m / back_m - left) / (right - left) * display.width_px - 0.5
        v_px = (up + up_m / back_m) / (up - down) * display.height_px - 0.5
        np.testing.assert_allclose((u_px, v_px), expected_px, atol=1e-6)


def test_results_are_tables_in_a_notebook(results: Results) -> None:
    page = results._repr_html_()
    for text in ("consistent, 2 alignments", "left", "right", "+4.20 ± 1.14", ", mm", "accept"):
        assert text in page
    assert page.count("<tr>") == page.count("</tr>") == 9
    assert "+4.20 ± 1.14" in results.eyes["left"]._repr_html_()


def test_what_did_not_converge_says_so(results: Results) -> None:
    shift = replace(results.eyes["left"], converged=False, stop_reason="<100 iterations>")
    assert str(shift).endswith("not converged (<100 iterations>)")
    assert "&lt;100 iterations&gt;" in shift._repr_html_()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_docstring_has_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    function = getattr(handcal, name)
    home = vars(importlib.import_module(function.__module__))
    (example,) = doctest.DocTestFinder(recurse=False).find(function, name, globs=dict(home))
    assert example.examples
    failed, _ = doctest.DocTestRunner().run(example)
    assert failed == 0
