"""The noise study: sensitivity of the solvers to rotation, noise and other disturbances.

The paper's simulation (Hu et al. 2021, "Simulation test on rotation-constrained ICP"), and what it
left out. Every section varies one thing, on the same people and with the same random numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from handcal.core.types import EYES, METHODS, EyeShift, Float64, Intrinsics, Method
from handcal.lab.study.run import Case, Study
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import floor_error_m, solve_by_paper, solve_trial, study_hand
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.alignments import AlignmentSettings, simulate_alignment
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.placement import PlacementError
from handcal.sim.wearer import draw_eyes, draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

FLOOR = "known pairs"
"""Name of the lower bound: least squares with the true pairs, disturbed only by a rotated hand."""
ERRORS_MM = "error_1_mm", "error_2_mm", "error_3_mm"
"""The columns of φ's error."""
HANDS = "hand shape"
"""The section in which the hand varies."""

# A D415's smaller images, which are drawn three times as fast, show enough points.
_CAMERA = Intrinsics(width=640, height=360, fx=502.5, fy=502.5, cx=319.5, cy=179.5)


@dataclass(frozen=True, slots=True)
class NoiseSettings:
    """Settings and numbers of the simulated alignments.

    Whatever a section does not vary has these values: clouds sampled independently, with noise of
    `depth_sigma_m`, the hand rotated by `angle_deg`, φ uniform within ± 10 mm.
    """

    seed: int = 1
    trials: int = 100
    """Alignments of each value, for ``consistent`` and ``icp``."""
    linear_trials: int = 20
    paper_trials: int = 8
    """Number of these that are also solved by ``linear``, and by ``paper``, which is slow; not in
    the section of hand shapes."""
    open3d: bool = False
    """Solve all of them by ``icp-open3d`` too."""
    hands: int = 20
    """Number of people, each with several alignments; the errors of one person are correlated."""
    points: int = 1000
    """Number of points of each cloud."""
    depth_sigma_m: float = 0.001
    angle_deg: float = 3.0
    coarse_deg: tuple[float, ...] = tuple(5.0 * i for i in range(13))
    fine_deg: tuple[float, ...] = tuple(float(i) for i in range(21))
    """Rotations of the paper's two figures."""
    kept_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0)
    """Rotations of a hand of constant size; that of the paper's simulation changes a little."""
    wrist_deg: tuple[float, ...] = (3.0, 6.0, 9.0, 12.0)
    """Rotations of a hand that is cut at the wrist."""
    shift_max_m: tuple[float, ...] = (0.005, 0.010, 0.015, 0.020, 0.030)
    """Limits of φ: each component is uniform within ± the value."""
    depth_sigmas_m: tuple[float, ...] = (0.0, 0.0005, 0.001, 0.002, 0.004)
    """Standard deviations of each point's depth."""
    forearms_m: tuple[float, ...] = (0.0, 0.02, 0.04, 0.06, 0.08)
    """Length of forearm in the hand's cloud; the cursor's shows 40 mm."""
    counts: tuple[int, ...] = (250, 500, 1000, 2000, 4000)
    """Points of each cloud."""
    shapes: int = 24
    shape_trials: int = 20
    """Number of other people's hands, and of alignments of each."""
    slips: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0)
    """Placement errors of a wearer who looks through the displays, as multiples of the default."""


QUICK_NOISE = NoiseSettings(
    trials=2,
    linear_trials=2,
    paper_trials=1,
    points=300,
    coarse_deg=(0.0, 5.0, 30.0),
    fine_deg=(0.0, 5.0, 9.0),
    kept_deg=(0.0, 9.0),
    wrist_deg=(9.0,),
    shift_max_m=(0.005, 0.020),
    depth_sigmas_m=(0.0, 0.002),
    forearms_m=(0.02, 0.04),
    counts=(250, 500),
    shapes=2,
    shape_trials=2,
    slips=(0.0, 1.0),
)
"""Smoke-test settings: results are not meaningful."""

_Scenario: TypeAlias = "tuple[AlignmentSettings, float]"


@dataclass(frozen=True, slots=True)
class NoiseSection:
    """A part of the study, in which one value varies."""

    name: str
    values: Callable[[NoiseSettings], Sequence[float]]
    """Returns its values from the settings."""
    scenario: Callable[[NoiseSettings, float], _Scenario] | None
    """Returns the settings of the alignments and their rotation in degrees, given settings and
    value; None for alignments that a simulated wearer makes."""
    label: str
    """Name of the value that varies, with the unit in which it is shown."""
    scale: float = 1.0
    """Factor from a value to that unit."""


def _measured(settings: NoiseSettings, **changes: Any) -> _Scenario:
    usual = AlignmentSettings(
        count=settings.points, resample=True, depth_sigma_m=settings.depth_sigma_m
    )
    return replace(usual, **changes), settings.angle_deg


SECTIONS: Mapping[str, NoiseSection] = {
    section.name: section
    for section in (
        NoiseSection(
            "rotation",
            lambda settings: sorted({*settings.coarse_deg, *settings.fine_deg}),
            lambda settings, angle: (AlignmentSettings(settings.points, exact=False), angle),
            "rotation, °",
        ),
        NoiseSection(
            "rotation, size kept",
            lambda settings: settings.kept_deg,
            lambda settings, angle: (AlignmentSettings(settings.points), angle),
            "rotation, °",
        ),
        NoiseSection(
            "rotation, to the wrist",
            lambda settings: settings.wrist_deg,
            lambda settings, angle: (
                AlignmentSettings(
                    settings.points, exact=False, cursor_forearm_m=0.0, hand_forearm_m=0.0
                ),
                angle,
            ),
            "rotation, °",
        ),
        NoiseSection(
            "eye box",
            lambda settings: settings.shift_max_m,
            lambda settings, shift: _measured(settings, shift_max_m=shift),
            "each component of φ within ±, mm",
            1e3,
        ),
        NoiseSection(
            "depth noise",
            lambda settings: settings.depth_sigmas_m,
            lambda settings, sigma: _measured(settings, depth_sigma_m=sigma),
            "σ of each point's depth, mm",
            1e3,
        ),
        NoiseSection(
            "forearm",
            lambda settings: settings.forearms_m,
            lambda settings, forearm: _measured(settings, hand_forearm_m=forearm),
            "forearm of the hand's cloud, mm",
            1e3,
        ),
        NoiseSection(
            "points",
            lambda settings: settings.counts,
            lambda settings, count: _measured(settings, count=int(count)),
            "points of each cloud",
        ),
        NoiseSection(
            HANDS,
            lambda settings: range(settings.shapes),
            lambda settings, _hand: _measured(settings),
            "hand",
        ),
        NoiseSection(
            "wearer", lambda settings: settings.slips, None, "wearer's errors, × the usual"
        ),
    )
}


def noise_study(settings: NoiseSettings) -> Study:
    """Return the study of all sections; each case is one alignment."""
    cases: list[Case] = [
        {"section": name, "value": value, "trial": trial}
        for name, section in SECTIONS.items()
        for value in section.values(settings)
        for trial in range(settings.shape_trials if name == HANDS else settings.trials)
    ]
    return Study("noise", settings, cases, noise_trial)


def noise_trial(settings: NoiseSettings, case: Case) -> list[StudyRow]:
    """Simulate one alignment and solve it by every method that uses this trial.

    Returns
    -------
    list of dict
        For each method, and for the best iterate of ``paper``: the case, ``hand``, ``method``, the
        ``iterations`` that it took, and the error of φ in mm, ``error_1_mm`` to ``error_3_mm``.
    """
    trial, section = int(case["trial"]), SECTIONS[str(case["section"])]
    hand = int(case["value"]) if section.name == HANDS else trial % settings.hands
    first = {"linear": settings.linear_trials, "paper": settings.paper_trials}
    if section.name == HANDS:
        first = dict.fromkeys(first, 0)
    if not settings.open3d:
        first["icp-open3d"] = 0
    methods = [method for method in METHODS if trial < first.get(method, settings.trials)]
    rng = np.random.default_rng([settings.seed, trial])
    solved = (
        _solve_wearer(settings, float(case["value"]), rng, hand, trial, methods)
        if section.scenario is None
        else _solve(*section.scenario(settings, float(case["value"])), rng, hand, methods)
    )
    rows: list[StudyRow] = []
    for method, iterations, error_m in solved:
        errors_mm = dict(zip(ERRORS_MM, (1e3 * error_m).tolist(), strict=True))
        rows.append({**case, "hand": hand, "method": method, "iterations": iterations, **errors_mm})
    return rows


_Solved: TypeAlias = Iterator[tuple[str, int, Float64]]


def _solve(
    scenario: AlignmentSettings,
    angle_deg: float,
    rng: np.random.Generator,
    hand: int,
    methods: Sequence[Method],
) -> _Solved:
    made = simulate_alignment(rng, study_hand(hand), np.radians(angle_deg), scenario, _CAMERA)
    yield FLOOR, 0, floor_error_m(made, exact=scenario.exact)
    clouds = made.cursor_m, made.hand_m, made.T_E_W, made.display_distance_m
    yield from _by_each(methods, clouds, made.shift_m, lambda method: solve_trial(made, method))


def _by_each(
    methods: Sequence[Method],
    clouds: tuple[Float64, Float64, Float64, float],
    true_m: Float64,
    solve: Callable[[Method], EyeShift],
) -> _Solved:
    """Solve by each method; `clouds` are those of `solve`. The paper's method has two results."""
    for method in methods:
        if method == "paper":
            iterations, shifts_m = solve_by_paper(*clouds)
            for name, shift_m in shifts_m.items():
                yield name, iterations, shift_m - true_m
        else:
            solved = solve(method)
            yield method, solved.iterations, solved.shift_m - true_m


def _solve_wearer(
    settings: NoiseSettings,
    error_scale: float,
    rng: np.random.Generator,
    hand: int,
    trial: int,
    methods: Sequence[Method],
) -> _Solved:
    """Solve one eye's alignment by a wearer who looks through the displays."""
    rig, usual, eye = example_rig(), WearerSettings(), EYES[trial // settings.hands % 2]
    true_m = draw_eyes(rng, usual)[eye]
    drawn = draw_placement_error(rng, usual)
    alignment = overlay_by_eye(
        rng,
        study_hand(hand),
        rig,
        {eye: true_m},
        settings.points,
        settings.depth_sigma_m,
        placement_error=PlacementError(
            error_scale * drawn.rotation_rad,
            error_scale * drawn.lateral_rad,
            error_scale * drawn.depth_ratio,
        ),
    )
    cursor_m, hand_m, T_E_W = alignment.cursor_m, alignment.hand_m, alignment.T_E_W[eye]
    yield from _by_each(
        methods,
        (cursor_m, hand_m, T_E_W, rig.eyes[eye].z_C0_S_m),
        true_m,
        lambda method: solve_alignment(alignment, rig, method)[eye],
    )
