"""The study of procedures: the error that a plan leaves, its time, and the verdicts on it.

Every plan leads the same simulated wearers, with errors of the same distribution. Those of one plan
do not depend on the other plans.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from handcal.core.display import TARGET_DEPTHS_M, arcmin_from_px, target_corners_m
from handcal.core.geometry import invert, project, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, CameraIdentity, DepthEdges, Eye, Float64
from handcal.hand.outline import edges_of
from handcal.lab.methods import solve_spaam
from handcal.lab.settings import ProcedureStudySettings
from handcal.lab.study.procedure_trial import Calibrated, ProcedureModel, lead_through
from handcal.lab.study.run import Case, Study
from handcal.lab.study.seeing import See, seen_with
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import study_hand
from handcal.lab.study.wearers import StudyWearer, align_points, draw_wearer
from handcal.register.benefit import depth_error_m
from handcal.register.placement import PlacementSettings
from handcal.register.prior import LearnedPrior, Observed, fit_wearers, learn_prior
from handcal.register.sitting import LearnedSitting, SittingSettings, sitting_prior
from handcal.rig.example import example_rig
from handcal.sim.people import VARIANTS, Variant, begin_sitting
from handcal.sim.raster import D415
from handcal.sim.sensor import EDGE_SIGMA_PX, fatten_for
from handcal.sim.sensor import border_px as sensor_border_px
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings

EARLIER_SESSIONS = 20
"""Number of simulated sessions that a learned prior is from."""
PEOPLE, SITTINGS = 30, 20
"""People, and sittings of each, that a learned prior of wearers is from."""

# Of each wearer's camera, px: they differ as the real frames of docs/segmentation.md do.
_BORDER_PX = 1.4, 2.2
# Of the variants: by how much more, half a metre away, than is typical of such cameras.
_FAT_M: dict[Variant, float] = {"known-fat-2mm": 0.002, "fat-2mm": 0.002, "fat-1mm": 0.001}
_PX_PER_M = D415.fx / 0.5
_PLAIN = "paper", "recommended", "recommended-unverified"
# `MethodSettings.pointing_sigma_arcmin` for people whose errors are 1.33 times the usual.
_POINTING_ARCMIN = 5.9 / 1.33
# The paper's plan is one alignment; without verification a third one takes less time than it.
_PAPER = PlacementSettings(most=1)
_UNVERIFIED = PlacementSettings(fewest=3)


@dataclass(frozen=True, slots=True)
class ProcedureSettings:
    """Settings of the study's cases."""

    seed: int
    model: ProcedureModel
    sittings: Mapping[Variant, LearnedSitting] = field(default_factory=dict)
    """For people of a variant, the prior of what they see wrongly, as learned from others; the
    default for those not there."""


@dataclass(frozen=True, slots=True)
class ProcedureRow:
    """The figures of one plan, for one kind of people; the mean is over both eyes of all.

    What has no meaning is None: SPAAM has no verdict.
    """

    plan: str
    variant: str
    scale: float
    """Errors of the people, in those of the simulator's usual wearer."""
    before_arcmin: float
    after_arcmin: float
    after_p95_arcmin: float
    """Error without the calibration, with it, and its 95th percentile."""
    seconds: float
    """The wearer's time."""
    worse_share: float
    """Share of the eyes that are worse than before."""
    depth_before_mm: float | None
    depth_after_mm: float | None
    """Error in depth at 0.5 m, of what is drawn (`depth_error_m`)."""
    depth_worse_share: float | None
    """Share of the eyes whose error in depth is larger than before."""
    accepted_share: float | None
    accepted_worse_share: float | None
    """Share of all eyes that are accepted, and that are accepted and worse than before."""
    expected_actual_correlation: float | None
    """Correlation, over the eyes, of the expected and the actual error."""
    expected_over_actual: float | None
    """Ratio of their means."""


def require_known(settings: ProcedureStudySettings) -> None:
    """Raise ValueError if a plan or a variant is unknown."""
    for plan in settings.plans:
        if plan not in _PLAIN and not 6 <= _spaam_count(plan) <= 1000:
            raise ValueError(
                f"unknown plan {plan!r}: choose from {', '.join(_PLAIN)}, spaam-N (6 to 1000)"
            )
    for variant in settings.variants:
        if variant not in VARIANTS:
            raise ValueError(f"unknown variant {variant!r}: choose from {', '.join(VARIANTS)}")


def procedure_cases(settings: ProcedureStudySettings, progress: Progress = Progress()) -> Study:
    """Return the study that the settings describe; errors as of `require_known`."""
    require_known(settings)
    model = ProcedureModel(
        sensor=settings.sensor,
        fatten_px=settings.fatten_px,
        eye_distance=settings.eye_distance,
    )
    if settings.prior == "learned":
        model = replace(model, prior=_learn(settings.seed, progress))
    cases: list[Case] = [
        {"wearer": wearer, "plan": plan, "variant": variant, "scale": scale}
        for wearer in range(settings.wearers)
        for plan in settings.plans
        for variant in settings.variants
        for scale in settings.scales
    ]
    return Study("procedures", ProcedureSettings(settings.seed, model), cases, procedure_trial)


def sitting_cases(settings: ProcedureSettings, variant: Variant, scale: float) -> Study:
    """Return the study of the repeated sittings from which `learn_sittings` learns."""
    cases: list[Case] = [
        {"person": person, "sitting": sitting, "variant": variant, "scale": scale}
        for person in range(PEOPLE)
        for sitting in range(SITTINGS)
    ]
    return Study("sittings", settings, cases, sitting_trial)


def sitting_trial(settings: ProcedureSettings, case: Case) -> list[StudyRow]:
    """Calibrate a person once more; the row holds what was observed."""
    person, number = int(case["person"]), int(case["sitting"])
    rng = np.random.default_rng([settings.seed, person, 3, number])
    own = np.random.default_rng([settings.seed, person, 3])
    usual = WearerSettings()
    own_m = draw_eyes(own, replace(usual, headset_sigma_m=(0.0, 0.0, 0.0)))
    fit_m = rng.normal(0.0, usual.headset_sigma_m)
    wearer = StudyWearer(
        example_rig(),
        study_hand(person % settings.model.hands),
        {eye: shift_m + fit_m for eye, shift_m in own_m.items()},
    )
    variant = cast("Variant", case["variant"])
    scale = float(case["scale"])
    found = _calibrate(rng, settings, wearer, "recommended", variant, scale, farther_too=True)
    fused = found.results.fused
    observed = [
        [part.tolist() for part in one.at(fused.wearer_scale)] for one in fused.all_observed
    ]
    return [{"person": person, "observed": json.dumps(observed)}]


def learn_sittings(rows: Sequence[StudyRow]) -> LearnedSitting:
    """Learn what people see wrongly from the rows of `sitting_cases`."""
    people: dict[object, list[list[Observed]]] = {}
    for row in rows:
        sitting = [
            (np.array(H), np.array(seen_m), np.array(covariance_m2))
            for H, seen_m, covariance_m2 in json.loads(str(row["observed"]))
        ]
        people.setdefault(row["person"], []).append(sitting)
    found = fit_wearers(list(people.values()), sitting_prior(example_rig(), SittingSettings()))
    assert found is not None, "there are enough sittings"
    return found


def procedure_trial(settings: ProcedureSettings, case: Case) -> list[StudyRow]:
    """Calibrate one wearer by one plan; a row for each eye."""
    number, plan, scale = int(case["wearer"]), str(case["plan"]), float(case["scale"])
    wearer = _wearer(settings, number)
    rng = np.random.default_rng([settings.seed, number, 1])
    offline = {eye: wearer.projection(eye, np.zeros(3)) for eye in EYES}
    if plan.startswith("spaam"):
        count = _spaam_count(plan)
        found = _by_spaam(rng, wearer, count, scale)
        usual = WearerSettings()
        seconds = 2 * count * (usual.reaction_s + usual.movement_s + usual.dwell_s)
        return [
            case
            | _errors(wearer, eye, offline[eye], found.get(eye, offline[eye]))
            | {"eye": eye, "seconds": seconds, "verdict": None, "expected_arcmin": None}
            for eye in EYES
        ]
    calibrated = _calibrate(rng, settings, wearer, plan, cast("Variant", case["variant"]), scale)
    return [
        case
        | _errors(wearer, eye, offline[eye], wearer.projection(eye, calibrated.shift_m[eye]))
        | {"eye": eye, "seconds": calibrated.seconds}
        | _told(calibrated, eye)
        | _depth_errors(wearer, eye, calibrated.shift_m[eye])
        for eye in EYES
    ]


def procedure_rows(rows: Sequence[StudyRow]) -> list[ProcedureRow]:
    """Return the figures of each plan, variant and scale, in their order."""
    groups: dict[tuple[str, str, float], list[StudyRow]] = {}
    for row in rows:
        key = str(row["plan"]), str(row["variant"]), float(cast("float", row["scale"]))
        groups.setdefault(key, []).append(row)
    return [_summarise(*key, group) for key, group in groups.items()]


def _summarise(plan: str, variant: str, scale: float, rows: Sequence[StudyRow]) -> ProcedureRow:
    def column(name: str) -> Float64:
        return np.array([row[name] for row in rows], dtype=np.float64)

    before, after = column("before_arcmin"), column("after_arcmin")
    is_worse = after > before
    accepted = worse_too = correlation = ratio = None
    depth_before = depth_after = depth_worse = None
    if rows[0]["verdict"] is not None:
        is_accepted = np.array([row["verdict"] == "accept" for row in rows])
        expected = column("expected_arcmin")
        accepted, worse_too = float(is_accepted.mean()), float((is_accepted & is_worse).mean())
        correlation = float(np.corrcoef(expected, after)[0, 1])
        ratio = float(expected.mean() / after.mean())
        before_mm, after_mm = column("depth_before_mm"), column("depth_after_mm")
        depth_before, depth_after = float(before_mm.mean()), float(after_mm.mean())
        depth_worse = float((after_mm > before_mm).mean())
    return ProcedureRow(
        plan=plan,
        variant=variant,
        scale=scale,
        before_arcmin=float(before.mean()),
        after_arcmin=float(after.mean()),
        after_p95_arcmin=float(np.quantile(after, 0.95)),
        seconds=float(column("seconds").mean()),
        worse_share=float(is_worse.mean()),
        depth_before_mm=depth_before,
        depth_after_mm=depth_after,
        depth_worse_share=depth_worse,
        accepted_share=accepted,
        accepted_worse_share=worse_too,
        expected_actual_correlation=correlation,
        expected_over_actual=ratio,
    )


def _calibrate(
    rng: np.random.Generator,
    settings: ProcedureSettings,
    wearer: StudyWearer,
    plan: str,
    variant: Variant,
    scale: float,
    *,
    farther_too: bool = False,
) -> Calibrated:
    sitting = begin_sitting(rng, WearerSettings(), variant, scale)
    wearer, see = _with_camera(rng, wearer, settings.model, variant)
    model = replace(settings.model, sitting=settings.sittings.get(variant))
    if plan == "paper":
        return lead_through(
            rng, wearer, see, sitting, model, "paper", verify=False, placement=_PAPER
        )
    return lead_through(
        rng,
        wearer,
        see,
        sitting,
        model,
        "recommended",
        verify=plan == "recommended",
        placement=PlacementSettings() if plan == "recommended" else _UNVERIFIED,
        farther_too=farther_too,
    )


def _told(calibrated: Calibrated, eye: Eye) -> dict[str, Any]:
    """Return the verdict on an eye, its expected error, and the alignments that it takes."""
    results = calibrated.results
    name, gain = results.verdicts[eye].name, results.benefits[eye]
    advice = results.advice.get(eye)
    return {
        "verdict": name,
        "expected_arcmin": gain.without_arcmin if name == "keep" else gain.after_arcmin,
        "alignments": len(results.alignments),
        "more_alignments": None if advice is None else advice.alignments,
    }


def _wearer(settings: ProcedureSettings, number: int) -> StudyWearer:
    rng = np.random.default_rng([settings.seed, number, 0])
    return draw_wearer(rng, number % settings.model.hands, WearerSettings())


def _with_camera(
    rng: np.random.Generator, wearer: StudyWearer, model: ProcedureModel, variant: Variant
) -> tuple[StudyWearer, See]:
    """Return a wearer with a depth camera on the headset, and what the camera measures.

    The rig knows the camera's edges with the error of a depth check, unless nobody made one.
    """
    model_name = "AHAT" if model.sensor == "ahat" else "RealSense D415"
    typical = replace(wearer.rig, depth_camera=CameraIdentity(model_name))
    border_px = float(rng.uniform(*_BORDER_PX))
    found_px = rng.normal(0.0, EDGE_SIGMA_PX)
    if model.sensor == "exact":
        border_px = sensor_border_px(0.0)
    elif model.sensor == "ahat":
        border_px = edges_of(typical).fatten_px
    elif model.fatten_px is not None:
        border_px = sensor_border_px(model.fatten_px)
    elif variant in _FAT_M:
        border_px = edges_of(typical).fatten_px + _FAT_M[variant] * _PX_PER_M
    is_known = variant not in ("unmeasured", "fat-2mm", "fat-1mm")
    edges = DepthEdges(border_px + found_px, EDGE_SIGMA_PX, "measured") if is_known else None
    return replace(wearer, rig=replace(typical, depth_edges=edges)), seen_with(
        model.sensor, fatten_for(border_px)
    )


def _errors(
    wearer: StudyWearer, eye: Eye, before: Float64, after: Float64
) -> dict[str, float | int | str | bool | None]:
    """Return an eye's errors of two projections from H, as `reprojection_arcmin` has them."""
    corners_E_m = np.concatenate([target_corners_m(depth_m) for depth_m in TARGET_DEPTHS_M])
    corners_m = transform(invert(wearer.T_E_H(eye)), corners_E_m)
    needed_px = project(wearer.true_projection(eye), corners_m)
    display = wearer.rig.eyes[eye]

    def error_arcmin(P: Float64) -> float:
        apart_px = np.linalg.norm(project(P, corners_m) - needed_px, axis=1)
        return float(arcmin_from_px(display, apart_px).mean())

    return {"before_arcmin": error_arcmin(before), "after_arcmin": error_arcmin(after)}


def _depth_errors(wearer: StudyWearer, eye: Eye, shift_m: Float64) -> dict[str, float]:
    display, true_m = wearer.rig.eyes[eye], wearer.true_shift_m[eye]
    return {
        "depth_before_mm": float(1e3 * depth_error_m(display, true_m)),
        "depth_after_mm": float(1e3 * depth_error_m(display, shift_m - true_m)),
    }


def _by_spaam(
    rng: np.random.Generator, wearer: StudyWearer, count: int, scale: float
) -> Mapping[Eye, Float64]:
    """Return SPAAM's projections from H; an eye whose alignments it refuses is left out."""
    found: dict[Eye, Float64] = {}
    for eye in EYES:
        points_m, pixels = align_points(wearer, rng, count, [eye], scale * _POINTING_ARCMIN, 0.0)
        try:
            found[eye] = solve_spaam(points_m, pixels[eye])
        except ValueError:
            continue
    return found


def _spaam_count(plan: str) -> int:
    """Return N of ``spaam-N``; 0 for another plan."""
    match = re.fullmatch(r"spaam-(\d{1,4})", plan)
    return int(match[1]) if match else 0


def _learn(seed: int, progress: Progress) -> LearnedPrior | None:
    """Learn the prior from verified sessions of other simulated wearers."""
    settings = ProcedureSettings(seed, ProcedureModel())
    sessions = []
    for number in range(EARLIER_SESSIONS):
        progress.at(0.0, f"Earlier session {number + 1} of {EARLIER_SESSIONS}")
        rng = np.random.default_rng([seed, number, 2])
        earlier = _wearer(replace(settings, seed=seed + 1_000_003), number)
        found = _calibrate(rng, settings, earlier, "recommended", "plain", 1.33)
        fused = found.results.fused
        sessions.append([one.at(fused.wearer_scale) for one in fused.all_observed])
    return learn_prior(sessions, sitting=sitting_prior(example_rig(), SittingSettings()))
