from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Alignment, Eye, Float64, PlanName, VerdictName, Verification
from handcal.lab.study.trials import study_hand
from handcal.register.placement import PlacementSettings, Planned, next_alignment, next_verification
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.register.verdict import Advice, planned_eyes
from handcal.rig.example import example_rig
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.raster import visible_points

RIG = example_rig()
SOLVE = SolveSettings()
USUAL = PlacementSettings()
DRAWN = {eye: np.zeros(3) for eye in EYES}
T_W_H = rigid([0.2, -0.4, 0.1], [0.3, 1.2, -0.5])
TRUE_M: dict[Eye, Float64] = {
    "left": np.array([0.003, -0.002, 0.004]),
    "right": np.array([0.004, -0.002, 0.003]),
}


def _raised(depth_m: float = 0.51) -> tuple[Float64, np.ndarray]:
    """Return a hand before the displays, in W, and which of its points are cut."""
    T_H_hand = rigid([0.05, 0.1, -0.03], [0.0, 0.088, depth_m])
    points_D_m, is_cut = visible_points(
        study_hand(3), invert(RIG.T_H_D) @ T_H_hand, 800, np.random.default_rng(1), forearm_m=0.04
    )
    return transform(T_W_H @ RIG.T_H_D, points_D_m), is_cut


def _next(
    done: Sequence[tuple[Eye, ...]] = (),
    results: Results | None = None,
    settings: PlacementSettings = USUAL,
    plan: PlanName = "recommended",
    depth_m: float = 0.51,
    usable_eyes: tuple[Eye, ...] = EYES,
) -> Planned | None:
    points_m, is_cut = _raised(depth_m)
    return next_alignment(
        points_m, is_cut, T_W_H, RIG, results, done, DRAWN,
        plan=plan, usable_eyes=usable_eyes, settings=settings, solve=SOLVE,
    )  # fmt: skip


def _solved(alignments: Sequence[Alignment]) -> Results:
    return solve_session(alignments, RIG, SOLVE, plan="recommended")


def test_each_eye_in_turn_then_both_and_what_is_missing_first() -> None:
    assert planned_eyes("recommended", []) == ("left",)
    assert planned_eyes("recommended", [("left",)]) == ("right",)
    assert planned_eyes("recommended", [("left",), ("right",)]) == EYES
    assert planned_eyes("recommended", [("left",), ("right",), EYES]) == ("left",)
    assert planned_eyes("recommended", [("left",), EYES]) == ("right",)
    assert planned_eyes("recommended", [], ("right",)) == ("right",)
    assert planned_eyes("paper", [EYES]) == EYES


@pytest.mark.parametrize("nearest_m", [0.38, 0.44, 0.50])
@pytest.mark.parametrize("raised_m", [0.47, 0.55])
def test_the_cursor_is_as_near_as_the_camera_measures(nearest_m: float, raised_m: float) -> None:
    planned = _next(settings=PlacementSettings(nearest_m=nearest_m), depth_m=raised_m)
    assert planned is not None
    points_m, _ = _raised(raised_m)
    cursor_D_m = transform(invert(T_W_H @ RIG.T_H_D), points_m + planned.displacement_W_m)
    assert cursor_D_m[:, 2].min() > nearest_m - 2e-3
    if nearest_m >= 0.44:  # nearer, the displays may show too little of the hand
        assert cursor_D_m[:, 2].min() == pytest.approx(nearest_m, abs=2e-3)


def test_the_cursor_is_on_the_display() -> None:
    planned = _next()
    assert planned is not None
    display = RIG.eyes["left"]
    points_m, _ = _raised()
    drawn = eye_projection(display) @ view_of_eye(display, T_W_H)
    pixels = project(drawn, points_m + planned.displacement_W_m)
    inside = (pixels >= 0.0) & (pixels <= [display.width_px, display.height_px])
    assert inside.all(axis=1).mean() > 0.6


def test_no_cursor_is_put_where_a_display_shows_little_of_the_hand(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    eyes = {eye: replace(display, width_px=500) for eye, display in RIG.eyes.items()}
    monkeypatch.setitem(globals(), "RIG", replace(RIG, eyes=eyes))
    planned = _next()
    assert planned is not None
    assert "no other place is on the displays" in planned.reason


def test_the_papers_cursor_is_where_the_hand_is() -> None:
    planned = _next(plan="paper")
    assert planned is not None
    assert planned.eyes == EYES
    assert not planned.displacement_W_m.any()


def test_the_plan_ends_when_nothing_more_is_needed_or_the_most_were_made() -> None:
    rng = np.random.default_rng(4)
    eyes: list[tuple[Eye, ...]] = [("left",), ("right",), EYES] * 2
    alignments = [
        overlay_by_eye(rng, study_hand(3), RIG, {eye: TRUE_M[eye] for eye in one}, 800)
        for one in eyes
    ]
    few, many = _solved(alignments[:1]), _solved(alignments)
    assert _next(eyes[:1], few) is not None
    assert all(one.name == "accept" for one in many.verdicts.values())
    assert _next(eyes, many) is None
    # As many are wanted before the eyes are verified, however good the result is.
    assert _next(eyes, many, PlacementSettings(fewest=7, most=10)) is not None
    # An eye that is not accepted is verified first, and again; more alignments come after that.
    refused = _all_named(many, "repeat")
    assert _next(eyes, refused, PlacementSettings(most=10)) is None
    check = many.fused.observed[0]
    once, often = (
        replace(refused, fused=replace(many.fused, verified=dict.fromkeys(EYES, (check,) * count)))
        for count in (1, PlacementSettings().verifications)
    )
    assert _next(eyes, once, PlacementSettings(most=10)) is None
    # … if they can lead to *accept*.
    useful = Advice((), 3, 3.0, 0.99, meets_target=True, is_accepted=True)
    for advice, most, is_planned in (
        (useful, 9, True),
        (useful, 8, False),
        (replace(useful, is_accepted=False), 9, False),
        (replace(useful, verify=True), 9, False),
    ):
        advised = replace(often, advice={"left": advice})
        assert (_next(eyes, advised, PlacementSettings(most=most)) is not None) == is_planned


def test_each_eye_is_verified_once_and_again_if_it_is_not_accepted() -> None:
    rng = np.random.default_rng(4)
    solved = _solved([overlay_by_eye(rng, study_hand(3), RIG, TRUE_M, 800)])
    check = Verification((0.0, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0))
    unsure, sure = _all_named(solved, "repeat"), _all_named(solved, "accept")
    assert next_verification(None, {}) is None
    assert next_verification(sure, {}) == "left"
    assert next_verification(sure, {"left": check}) == "right"
    assert next_verification(sure, {"left": check}, usable_eyes=("left",)) is None
    both: dict[Eye, Verification] = {"left": check, "right": check}
    assert next_verification(sure, both) is None
    assert next_verification(unsure, both) == "left"
    again: dict[Eye, Verification] = both | {"left": check.after(check)}
    assert next_verification(unsure, again) == "right"
    often = check
    for _ in range(PlacementSettings().verifications - 1):
        assert next_verification(unsure, dict.fromkeys(EYES, often)) == "left"
        often = check.after(often)
    assert next_verification(unsure, dict.fromkeys(EYES, often)) is None


def _all_named(results: Results, name: VerdictName) -> Results:
    verdicts = {eye: replace(one, name=name) for eye, one in results.verdicts.items()}
    return replace(results, verdicts=verdicts)
