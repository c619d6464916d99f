"""Comparison of calibration methods on the same simulated wearers: errors, and the wearers' time.

Every case is a wearer, who does the alignments of every method. `docs/methods.md` lists the
assumptions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy.optimize import brentq

from handcal.core.display import TARGET_DEPTHS_M, arcmin_from_px, target_corners_m
from handcal.core.errors import HandcalError
from handcal.core.geometry import invert, project, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Alignment, Eye, EyeShift, Float64
from handcal.lab.methods import (
    FEWEST_PAIRS,
    solve_eye_from_points,
    solve_indica_recycled,
    solve_mpaam,
    solve_spaam,
    solve_stereo_spaam,
)
from handcal.lab.study.run import Case, Study
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import BEST_ITERATE, solve_by_paper
from handcal.lab.study.wearers import StudyWearer, align_cube, align_hand, align_points, draw_wearer
from handcal.register.fuse import FuseSettings, fuse_alignments
from handcal.register.solve import solve_alignment
from handcal.sim.wearer_settings import WearerSettings

Projections: TypeAlias = Mapping[Eye, Float64]
"""Pixels from points in H, (3, 4), for each eye."""

PAPER = "rcICP (the paper's), 1"
HANDCAL_BOTH, HANDCAL_EACH = "handcal, both eyes,", "handcal, each eye,"
"""Followed by the number of alignments."""

_SPAAM_COUNTS = 6, 12, 25
_STEREO_COUNTS = 12, 25
_HAND_COUNTS = 1, 2, 3, 5
_MPAAM_CUBES = 4
_JUN_COUNT, _MOSER_COUNT = 8, 25
# "Within a time less than 10 seconds" (Hu et al. 2021); handcal takes less than 0.1 s.
_PAPER_SOLVES_S = 10.0


@dataclass(frozen=True, slots=True)
class MethodSettings:
    """Settings of the simulated wearers with whom methods are compared."""

    wearers: int = 100
    eye_distance_sigmas_m: tuple[float, ...] = (0.0, 0.002)
    """Standard deviation of each population's eye distances from the rig's; 0 for a headset that is
    adjusted to its wearer."""
    noise_scale: float = 1.0
    """Scale of the placement errors of `WearerSettings`. With the default, the paper's method has
    its published error (`handcal.lab.study.methods`)."""
    points: int = 1500
    """Number of points of each cloud."""
    depth_sigma_m: float = 0.001
    """Standard deviation of each point's depth."""
    hands: int = 10
    """Number of different hands."""
    pointing_sigma_arcmin: float = 5.9
    """Standard deviation of pointing at crosshairs, about each of two axes, including the tracker:
    the residual of 11 recorded SPAAM calibrations (`handcal.lab.study.recorded`)."""
    fingertip_sigma_m: float = 0.003
    """Additional standard deviation of a tracked fingertip, each axis; an assumption."""
    corner_sigma_m: float = 0.001
    """Standard deviation of a tracked cube's corner, each axis; an assumption."""
    eye_tracker_sigma_m: tuple[float, float, float] = (0.0021, 0.0008, 0.002)
    """Standard deviation of a tracked eye, E axes. x and y: deviation of the tracked eyes of those
    recordings from the eyes solved from their alignments, without the common offset; z is an
    assumption."""
    seed: int = 1


QUICK_METHODS = MethodSettings(wearers=3, points=300)
"""Smoke-test settings: results are not meaningful."""


@dataclass(frozen=True, slots=True, eq=False)
class MethodCalibration:
    """The calibration of one wearer by one method."""

    method: str
    alignments: int
    """Number of alignments, for both eyes together."""
    wearer_s: float
    """Time that the wearer needs."""
    projections: Projections | None
    """(3, 4) each; None if the method refused the alignments. A projection that puts the target
    behind an eye counts as refused, too."""


def methods_study(settings: MethodSettings) -> Study:
    """Return the study: each wearer in every population before the next."""
    cases: list[Case] = [
        {"wearer": wearer, "eye_distance_sigma_mm": 1e3 * sigma_m}
        for wearer in range(settings.wearers)
        for sigma_m in settings.eye_distance_sigmas_m
    ]
    return Study("methods", settings, cases, compare_methods)


def compare_methods(settings: MethodSettings, case: Case) -> list[StudyRow]:
    """Calibrate one wearer by every method; a row for each and each distance of the target.

    The errors in arcmin are of the target's four corners in each eye, as the paper's user test has
    them. Those in mm are between a corner and where both eyes together see it drawn: mean over the
    corners of |x|, |y|, |z| in the headset's axes.
    """
    wearer, placement = study_wearer(settings, case)
    # A wearer's errors with one method do not depend on the other methods.
    seeds = np.random.SeedSequence([settings.seed, int(case["wearer"]), 1]).spawn(4)
    generators = [np.random.default_rng(seed) for seed in seeds]
    calibrations = [
        MethodCalibration(
            "no calibration", 0, 0.0, rendered(wearer, dict.fromkeys(EYES, np.zeros(3)))
        ),
        *_by_points(wearer, generators[0], settings),
        *_by_cubes(wearer, generators[1], placement, settings),
        *_by_both_eyes(wearer, generators[2], placement, settings),
        *_by_each_eye(wearer, generators[3], placement, settings),
    ]
    return [row for found in calibrations for row in method_rows(wearer, found, case)]


def study_wearer(settings: MethodSettings, case: Case) -> tuple[StudyWearer, WearerSettings]:
    """Return a case's wearer and the errors of the wearer's overlays."""
    number = int(case["wearer"])
    usual = WearerSettings()
    placement = replace(
        usual,
        eye_distance_sigma_m=1e-3 * float(case["eye_distance_sigma_mm"]),
        lateral_sigma_arcmin=settings.noise_scale * usual.lateral_sigma_arcmin,
        depth_sigma=settings.noise_scale * usual.depth_sigma,
        rotation_sigma_rad=settings.noise_scale * usual.rotation_sigma_rad,
    )
    rng = np.random.default_rng([settings.seed, number, 0])
    return draw_wearer(rng, number % settings.hands, placement), placement


def target_errors(wearer: StudyWearer, projections: Projections, depth_m: float) -> dict[str, Any]:
    """Return the errors at the target's corners: arcmin in each eye, and mm in space.

    The target is straight ahead of the middle of the viewpoints. NaN if it is drawn behind an eye.
    """
    viewpoints_m = [invert(wearer.T_E_H(eye))[:3, 3] for eye in EYES]
    corners_m = target_corners_m(depth_m) + np.mean(viewpoints_m, axis=0)
    errors: dict[str, Any] = {}
    rays = []
    for eye in EYES:
        P = wearer.true_projection(eye)
        drawn_px = project(projections[eye], corners_m)
        error_px = np.linalg.norm(drawn_px - project(P, corners_m), axis=1)
        for corner, arcmin in enumerate(arcmin_from_px(wearer.rig.eyes[eye], error_px), 1):
            errors[f"{eye}_{corner}_arcmin"] = float(arcmin)
        homogeneous = np.column_stack([drawn_px, np.ones(len(drawn_px))])
        rays.append(np.linalg.solve(P[:, :3], homogeneous.T).T)
    seen_m = np.array(
        [_meet([wearer.eye_m(eye) for eye in EYES], pair) for pair in zip(*rays, strict=True)]
    )
    for axis, error_mm in zip("xyz", 1e3 * np.abs(seen_m - corners_m).mean(axis=0), strict=True):
        errors[f"{axis}_mm"] = float(error_mm)
    return errors


def method_rows(wearer: StudyWearer, found: MethodCalibration, case: Case) -> list[StudyRow]:
    """Return a row for each distance of the target, with the errors of a calibration there."""
    row: StudyRow = {
        **case,
        "method": found.method,
        "alignments": found.alignments,
        "wearer_s": found.wearer_s,
    }
    if found.projections is not None:
        errors = [target_errors(wearer, found.projections, depth_m) for depth_m in TARGET_DEPTHS_M]
        if all(np.isfinite(list(at_depth.values())).all() for at_depth in errors):
            return [
                row | {"refused": False, "depth_m": depth_m} | at_depth
                for depth_m, at_depth in zip(TARGET_DEPTHS_M, errors, strict=True)
            ]
    return [row | {"refused": True, "depth_m": depth_m} for depth_m in TARGET_DEPTHS_M]


def _meet(eyes_m: Sequence[Float64], rays: Sequence[Float64]) -> Float64:
    """Return the point nearest to two rays, each from its eye."""
    across = [np.eye(3) - np.outer(ray, ray) / (ray @ ray) for ray in rays]
    nearest: Float64 = np.linalg.solve(
        np.sum(across, axis=0), sum(A @ eye_m for A, eye_m in zip(across, eyes_m, strict=True))
    )
    return nearest


def rendered(wearer: StudyWearer, shift_m: Mapping[Eye, Float64]) -> Projections:
    """Return the rig's projections for given eye shifts φ, (3,) each."""
    return {eye: wearer.projection(eye, shift_m[eye]) for eye in EYES}


def _seconds(alignments: int, *, by_hand: bool = False) -> float:
    """Return the wearer's time for alignments: noticing, moving, holding still, and raising a hand.

    The durations are those of the simulated wearer.
    """
    usual = WearerSettings()
    raising_s = 2.0 * usual.movement_s if by_hand else 0.0
    return alignments * (usual.reaction_s + usual.movement_s + usual.dwell_s + raising_s)


def _by_points(
    wearer: StudyWearer, rng: np.random.Generator, settings: MethodSettings
) -> Iterator[MethodCalibration]:
    """Calibrate by SPAAM, Stereo-SPAAM, fingertips, and INDICA."""
    sigma_arcmin = settings.pointing_sigma_arcmin
    for count in _SPAAM_COUNTS:
        pairs = {eye: align_points(wearer, rng, count, [eye], sigma_arcmin, 0.0) for eye in EYES}
        solved = _spaam(pairs)
        yield MethodCalibration(f"SPAAM, {count}", 2 * count, _seconds(2 * count), solved)
    for count in _STEREO_COUNTS:
        points_m, pixels = align_points(wearer, rng, count, EYES, sigma_arcmin, 0.0)
        try:
            stereo: Projections | None = solve_stereo_spaam(points_m, pixels)
        except ValueError:
            stereo = None
        yield MethodCalibration(f"Stereo-SPAAM, {count}", count, _seconds(count), stereo)
    yield from _by_fingertips(wearer, rng, settings)
    yield MethodCalibration("INDICA, recycled", 0, 0.0, _indica(wearer, rng, settings))


def _by_fingertips(
    wearer: StudyWearer, rng: np.random.Generator, settings: MethodSettings
) -> Iterator[MethodCalibration]:
    """Calibrate by SPAAM from fingertips, and solve the eye alone from some of them."""
    tips = {
        eye: align_points(
            wearer,
            rng,
            _MOSER_COUNT,
            [eye],
            settings.pointing_sigma_arcmin,
            settings.fingertip_sigma_m,
        )
        for eye in EYES
    }
    count = 2 * _MOSER_COUNT
    yield MethodCalibration(
        f"fingertip SPAAM, {_MOSER_COUNT}", count, _seconds(count), _spaam(tips)
    )
    eyes_m = {}
    for eye, (points_m, pixels) in tips.items():
        # Every third: as few, over the same depths.
        some = slice(None, None, _MOSER_COUNT // _JUN_COUNT)
        points_E_m = transform(wearer.T_E_H(eye), points_m[some][:_JUN_COUNT])
        found_px = pixels[eye][some][:_JUN_COUNT]
        eyes_m[eye] = solve_eye_from_points(points_E_m, found_px, wearer.rig.eyes[eye])
    count = 2 * _JUN_COUNT
    found = rendered(wearer, eyes_m)
    yield MethodCalibration(f"fingertip, eye only, {_JUN_COUNT}", count, _seconds(count), found)


def _spaam(pairs: Mapping[Eye, tuple[Float64, Mapping[Eye, Float64]]]) -> Projections | None:
    """Return SPAAM's projections of both eyes; None if it refuses one."""
    try:
        return {
            eye: solve_spaam(points_m, pixels[eye]) for eye, (points_m, pixels) in pairs.items()
        }
    except ValueError:
        return None


def _indica(wearer: StudyWearer, rng: np.random.Generator, settings: MethodSettings) -> Projections:
    projections = {}
    for eye in EYES:
        tracked_E_m = wearer.true_shift_m[eye] + rng.normal(0.0, settings.eye_tracker_sigma_m)
        tracked_m = transform(invert(wearer.T_E_H(eye)), tracked_E_m[None])[0]
        offline, distance_m = wearer.projection(eye, np.zeros(3)), wearer.rig.eyes[eye].z_C0_S_m
        projections[eye] = solve_indica_recycled(offline, distance_m, tracked_m)
    return projections


def _by_cubes(
    wearer: StudyWearer,
    rng: np.random.Generator,
    placement: WearerSettings,
    settings: MethodSettings,
) -> Iterator[MethodCalibration]:
    """Calibrate by MPAAM with each of its maps, from the same alignments."""
    cubes = [
        align_cube(wearer, rng, placement, settings.corner_sigma_m) for _ in range(_MPAAM_CUBES)
    ]
    tracked_m, shown_m = (np.concatenate(side) for side in zip(*cubes, strict=True))
    offline = rendered(wearer, dict.fromkeys(EYES, np.zeros(3)))
    for model in FEWEST_PAIRS:
        T = solve_mpaam(tracked_m, shown_m, model)
        found = {eye: P @ T for eye, P in offline.items()}
        yield MethodCalibration(
            f"MPAAM, {model}, {_MPAAM_CUBES} × 5", _MPAAM_CUBES, _seconds(_MPAAM_CUBES), found
        )


def _by_both_eyes(
    wearer: StudyWearer,
    rng: np.random.Generator,
    placement: WearerSettings,
    settings: MethodSettings,
) -> Iterator[MethodCalibration]:
    """Calibrate by the paper's method and by handcal, with both eyes open, from the same start."""
    fused = _align_in_turn(wearer, rng, [EYES] * max(_HAND_COUNTS), placement, settings)
    for count, (alignment, shift_m) in enumerate(fused, 1):
        if count == 1:
            solved = solve_alignment(alignment, wearer.rig, "paper")
            found = rendered(wearer, {eye: solved[eye].shift_m for eye in EYES})
            seconds = _seconds(1, by_hand=True) + _PAPER_SOLVES_S
            yield MethodCalibration(PAPER, 1, seconds, found)
        if count in _HAND_COUNTS:
            seconds = _seconds(count, by_hand=True)
            found = rendered(wearer, shift_m)
            yield MethodCalibration(f"{HANDCAL_BOTH} {count}", count, seconds, found)


def _by_each_eye(
    wearer: StudyWearer,
    rng: np.random.Generator,
    placement: WearerSettings,
    settings: MethodSettings,
) -> Iterator[MethodCalibration]:
    """Calibrate by handcal with one eye open at a time, with equally many alignments of each."""
    order: list[tuple[Eye, ...]] = [("left",), ("right",)] * max(_HAND_COUNTS)
    for done, (_, shift_m) in enumerate(_align_in_turn(wearer, rng, order, placement, settings), 1):
        count, half = divmod(done, 2)
        if not half and count in _HAND_COUNTS:
            seconds = _seconds(done, by_hand=True)
            found = rendered(wearer, shift_m)
            yield MethodCalibration(f"{HANDCAL_EACH} {count}", done, seconds, found)


def _align_in_turn(
    wearer: StudyWearer,
    rng: np.random.Generator,
    order: Sequence[tuple[Eye, ...]],
    placement: WearerSettings,
    settings: MethodSettings,
) -> Iterator[tuple[Alignment, Mapping[Eye, Float64]]]:
    """Yield each alignment, and φ fused from all so far, with which the next cursor is drawn."""
    solved: list[tuple[Alignment, Mapping[Eye, EyeShift]]] = []
    shift_m: dict[Eye, Float64] = dict.fromkeys(EYES, np.zeros(3))
    for eyes in order:
        alignment = align_hand(
            wearer, rng, eyes, shift_m, placement, settings.points, settings.depth_sigma_m
        )
        solved.append((alignment, solve_alignment(alignment, wearer.rig)))
        fused = fuse_alignments(solved, wearer.rig, FuseSettings())
        shift_m = shift_m | {eye: found.shift_m for eye, found in fused.shifts.items()}
        yield alignment, shift_m


# Search for the placement errors with which the paper's method has its published error.
#
# A method comparison is only as good as its simulated wearers. All their placement errors, lateral,
# in depth and in rotation, are those of `WearerSettings` times one scale. The published solver may
# swing to its last iteration; the search by its best iterate does not depend on where it stops.

PAPER_MEAN_ARCMIN, PAPER_SD_ARCMIN = 10.79, 3.21
"""Hu et al. 2021, user test: all corners."""

_SCALES = 0.0, 3.0
_NEAR_ENOUGH = 0.02


@dataclass(frozen=True, slots=True)
class NoiseFit:
    """The result of the search."""

    scale: float
    """Scale of the placement errors of `WearerSettings`."""
    mean_arcmin: float
    sd_arcmin: float
    """Error of the paper's method at this scale, over all corners of all wearers."""
    mean_by_scale: dict[float, float]
    """Mean error at each scale tried, in arcmin."""


def fit_noise(
    settings: MethodSettings,
    wearers: int,
    progress: Progress = Progress(),
    method: Literal["paper", "paper, best iterate"] = "paper",
) -> NoiseFit:
    """Search for the scale at which the paper's method has a mean error of 10.79′.

    By Brent's method; a wearer's errors differ between scales only in size. Eye
    distances are the rig's, as the paper's headset was set to its users.

    Parameters
    ----------
    settings : MethodSettings
        `noise_scale` and `wearers` do not matter.
    wearers : int
        Seconds each, for every scale tried.
    progress : Progress
        Reports each scale tried and the mean error with it.
    method : {"paper", "paper, best iterate"}

    Raises
    ------
    HandcalError
        If no scale from 0 to 3 gives it.
    """
    tried: dict[float, Float64] = {}

    def excess(scale: float) -> float:
        if scale not in tried:  # the search asks for its ends again
            scaled = replace(settings, noise_scale=scale)
            tried[scale] = np.array(
                [_errors_arcmin(scaled, wearer)[method] for wearer in range(wearers)]
            )
            progress.at(0.0, f"Noise {scale:.2f} by {method}: {tried[scale].mean():.1f}′")
        return float(tried[scale].mean()) - PAPER_MEAN_ARCMIN

    if excess(_SCALES[0]) > 0.0 or excess(_SCALES[1]) < 0.0:
        means = ", ".join(f"{errors.mean():.1f}′ at {scale:g}" for scale, errors in tried.items())
        raise HandcalError(
            f"no noise gives the paper's {PAPER_MEAN_ARCMIN}′ ({means})",
            "try more wearers",
        )
    scale = float(brentq(excess, *_SCALES, xtol=_NEAR_ENOUGH))
    nearest = min(tried, key=lambda found: abs(found - scale))
    errors = tried[nearest]
    means_arcmin = {found: float(tried[found].mean()) for found in sorted(tried)}
    return NoiseFit(nearest, float(errors.mean()), float(errors.std(ddof=1)), means_arcmin)


@lru_cache(maxsize=512)  # both searches try the same scales first
def _errors_arcmin(settings: MethodSettings, number: int) -> dict[str, Float64]:
    """Return the errors at all corners, (24,), after one alignment: published and best iterate."""
    wearer, placement = study_wearer(settings, {"eye_distance_sigma_mm": 0.0, "wearer": number})
    offline = dict.fromkeys(EYES, np.zeros(3))
    alignment = align_hand(
        wearer,
        np.random.default_rng([settings.seed, number, 2]),
        EYES,
        offline,
        placement,
        settings.points,
        settings.depth_sigma_m,
    )
    solved = {
        eye: solve_by_paper(
            alignment.cursor_m,
            alignment.hand_m,
            alignment.T_E_W[eye],
            wearer.rig.eyes[eye].z_C0_S_m,
        )[1]
        for eye in EYES
    }
    return {
        method: _corner_errors_arcmin(wearer, {eye: solved[eye][method] for eye in EYES})
        for method in ("paper", BEST_ITERATE)
    }


def _corner_errors_arcmin(wearer: StudyWearer, shift_m: Mapping[Eye, Float64]) -> Float64:
    projections = rendered(wearer, shift_m)
    return np.array(
        [
            error
            for depth_m in TARGET_DEPTHS_M
            for name, error in target_errors(wearer, projections, depth_m).items()
            if name.endswith("arcmin")
        ]
    )
