import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.core.types import Eye, EyeShift, Verdict, Verification
from handcal.register.benefit import percent
from handcal.register.fuse import Fused, Misfit, Observation
from handcal.register.prior import eye_prior, eye_slice
from handcal.register.verdict import (
    HARDLY,
    MISFIT,
    Advice,
    VerdictSettings,
    advise,
    describe_verified,
    eye_benefit,
    is_helpful,
    judge,
)
from handcal.rig.example import HALF_EYE_DISTANCE_M, example_rig

RIG = example_rig()
SETTINGS = VerdictSettings()
GOOD = EyeShift(
    shift_m=np.array([0.002, -0.001, 0.003]),
    covariance_m2=np.diag([0.0003, 0.0003, 0.001]) ** 2,
    rms_m=0.0012,
    residuals_m=np.zeros(5),
    inlier_ratio=0.95,
    iterations=9,
    converged=True,
    stop_reason="step below 30 µm",
    history_m2=np.ones(9),
    method="fused",
)


def _fused(shifts: Mapping[Eye, EyeShift]) -> Fused:
    """Return estimates as of one alignment of all their eyes, as precise as the left one."""
    eyes = tuple(shifts)
    H = np.zeros((3, 6))
    for eye in eyes:
        H[:, eye_slice(eye)] = np.eye(3) / len(eyes)
    noise_m2 = shifts[eyes[0]].covariance_m2
    observed = Observation(H, np.zeros(3), 0.5 * noise_m2, 0.5 * noise_m2)
    return Fused(shifts, eye_prior(), (observed,), 1.0)


def _judge(
    shifts: Mapping[Eye, EyeShift], settings: VerdictSettings = SETTINGS
) -> dict[Eye, Verdict]:
    return _judge_fused(_fused(shifts), settings)


def _judge_fused(
    fused: Fused, settings: VerdictSettings = SETTINGS, contradictions: Sequence[str] = ()
) -> dict[Eye, Verdict]:
    advice = {eye: advise(RIG, fused, eye, settings) for eye in fused.shifts}
    return judge(RIG, fused, advice, settings, contradictions)


def test_a_surely_better_solution_within_the_target_is_accepted() -> None:
    shifts: dict[Eye, EyeShift] = {"left": GOOD, "right": GOOD}
    for eye, verdict in _judge(shifts).items():
        gain = eye_benefit(RIG, _fused(shifts), eye)
        assert verdict.name == "accept"
        assert verdict.reason == (
            f"The expected error is {gain.after_arcmin:.1f}′ instead of "
            f"{gain.without_arcmin:.1f}′. It is 99\u00a0% sure to be better than no calibration."
        )
        assert 1.0 < gain.after_arcmin < SETTINGS.target_arcmin < gain.without_arcmin


@pytest.mark.parametrize(
    ("changes", "name", "reason"),
    [
        (
            {"shift_m": np.array([0.0, 0.024, 0.007])},
            "implausible",
            "The eye would lie 25 mm from the rig's viewpoint, beyond the 20 mm eye box. "
            "Check how the headset sits, and the rig.",
        ),
        (
            {"converged": False, "stop_reason": "limit of 40 iterations"},
            "repeat",
            "The registration did not converge (limit of 40 iterations).",
        ),
        (
            {"inlier_ratio": 0.42},
            "repeat",
            "Only 42 % of the hand found its place on the cursor. "
            "Hold the hand in the cursor's shape.",
        ),
        (
            {"rms_m": 0.0063},
            "repeat",
            "Hand and cursor differ by 6.3 mm. Hold the hand in the cursor's shape.",
        ),
    ],
)
def test_what_fails_is_named(changes: dict[str, Any], name: str, reason: str) -> None:
    verdict = _judge({"left": replace(GOOD, **changes)})["left"]
    assert (verdict.name, verdict.reason) == (name, reason)


@pytest.mark.parametrize(("apart_mm", "said"), [(49.0, "49"), (81.0, "81")])
def test_eyes_too_near_or_too_far_apart(apart_mm: float, said: str) -> None:
    half_m = 0.5e-3 * apart_mm - HALF_EYE_DISTANCE_M
    shifts: dict[Eye, EyeShift] = {
        "left": replace(GOOD, shift_m=np.array([-half_m, 0.0, 0.0])),
        "right": replace(GOOD, shift_m=np.array([half_m, 0.0, 0.0])),
    }
    for verdict in _judge(shifts).values():
        assert verdict.name == "implausible"
        assert verdict.reason == (
            f"The eyes would lie {said} mm apart. Check the rig, or align one eye at a time."
        )


def test_an_uncertain_eye_asks_for_alignments_and_leaves_the_other_alone() -> None:
    uncertain = replace(GOOD, covariance_m2=np.diag([0.002, 0.002, 0.004]) ** 2)
    shifts: dict[Eye, EyeShift] = {"left": uncertain, "right": GOOD}
    verdicts = _judge(shifts)
    advice = advise(RIG, _fused(shifts), "left", SETTINGS)
    assert verdicts["left"].name == "repeat"
    assert f"{advice.alignments} more alignment" in verdicts["left"].reason
    assert verdicts["right"].name == "accept"


def test_advice_is_the_fewest_alignments_that_are_enough() -> None:
    uncertain = replace(GOOD, covariance_m2=np.diag([0.002, 0.002, 0.004]) ** 2)
    fused = _fused({"left": uncertain, "right": uncertain})
    advice = advise(RIG, fused, "left", SETTINGS)
    assert advice.meets_target
    assert advice.after_arcmin <= SETTINGS.target_arcmin
    # Both eyes at once cannot tell where they differ, so the one eye alone is worth more.
    assert advice.eyes == ("left",)
    stricter = replace(SETTINGS, target_arcmin=0.6 * advice.after_arcmin)
    assert advise(RIG, fused, "left", stricter).alignments > advice.alignments
    hopeless = advise(RIG, fused, "left", replace(SETTINGS, target_arcmin=0.1))
    assert not hopeless.meets_target
    verdict = _judge_fused(fused, replace(SETTINGS, target_arcmin=0.1))["left"]
    assert verdict.reason.endswith("Enter the eye distance, or verify each eye.")


def test_advice_counts_the_plans_own_next_steps() -> None:
    uncertain = replace(GOOD, covariance_m2=np.diag([0.002, 0.002, 0.004]) ** 2)
    fused = _fused({"left": uncertain, "right": uncertain})
    ahead: list[tuple[Eye, ...]] = [("right",), ("left",), ("left", "right")] * 2
    advice = advise(RIG, fused, "left", SETTINGS, ahead)
    assert advice.eyes == ()
    of_left, of_right = (
        advise(RIG, fused, "left", SETTINGS, [one]) for one in (("left",), ("right",))
    )
    assert of_left.after_arcmin < of_right.after_arcmin
    told = judge(RIG, fused, {"left": advice, "right": advice}, SETTINGS)["left"].reason
    assert f"After {advice.alignments} more alignments, " in told
    assert told.endswith("82\u00a0% certainty can be expected.")
    check = Observation(np.eye(3, 6), np.zeros(3), np.zeros((3, 3)), 1e-8 * np.eye(3))
    verifiable = replace(fused, verifiable={"left": check})
    advice = advise(RIG, verifiable, "left", SETTINGS, ahead)
    assert (advice.alignments, advice.verify, advice.is_accepted) == (0, True, True)
    told = judge(RIG, verifiable, {"left": advice, "right": advice}, SETTINGS)["left"].reason
    assert "After verifying each eye, " in told


def test_an_eye_that_alignments_cannot_decide_is_to_be_verified_again() -> None:
    """The reason has the probability then, as that may not be enough either."""
    uncertain = replace(
        GOOD,
        shift_m=np.array([0.0025, 0.0, 0.003]),
        covariance_m2=np.diag([0.0009, 0.0009, 0.0014]) ** 2,
    )
    check = Observation(np.eye(3, 6), np.zeros(3), np.zeros((3, 3)), 4e-6 * np.eye(3))
    fused = replace(
        _fused({"left": uncertain}),
        verified={"left": ()},
        verifiable={"left": check},
    )
    advice = advise(RIG, fused, "left", SETTINGS, [("right",)] * 10)
    assert (advice.alignments, advice.verify, advice.is_accepted) == (0, True, False)
    told = judge(RIG, fused, {"left": advice}, SETTINGS)["left"].reason
    assert told.endswith(
        f"After verifying this eye again, {percent(advice.probability_better)} certainty can be "
        "expected."
    )


@pytest.mark.parametrize("target_arcmin", [2.0, 8.0, 20.0])
def test_no_error_is_foreseen_that_is_not_less_than_now(target_arcmin: float) -> None:
    """Certainty may be what is missing; then no error is said."""
    uncertain = replace(
        GOOD,
        shift_m=np.array([0.0025, 0.0, 0.003]),
        covariance_m2=np.diag([0.0009, 0.0009, 0.0014]) ** 2,
    )
    fused, settings = _fused({"left": uncertain}), replace(SETTINGS, target_arcmin=target_arcmin)
    verdict = _judge_fused(fused, settings)["left"]
    now_arcmin = eye_benefit(RIG, fused, "left").after_arcmin
    assert verdict.name == "repeat"
    _, _, foreseen = verdict.reason.partition("After ")
    said = [float(number) for number in re.findall(r"([\d.]+)′", foreseen)]
    assert all(arcmin < now_arcmin for arcmin in said)
    assert bool(said) == (now_arcmin > target_arcmin)


def test_no_step_is_foreseen_to_harm_and_one_that_hardly_helps_is_called_so() -> None:
    """As where the wearer is judged for several precisions, and foreseen for one."""
    uncertain = replace(
        GOOD,
        shift_m=np.array([0.0025, 0.0, 0.003]),
        covariance_m2=np.diag([0.0009, 0.0009, 0.0014]) ** 2,
    )
    fused = _fused({"left": uncertain})
    (usual,) = fused.observed
    rough_m2 = 1e4 * usual.wearer_m2
    fused = replace(fused, observed=(replace(usual, registration_m2=rough_m2),))
    advice, gain = advise(RIG, fused, "left", SETTINGS), eye_benefit(RIG, fused, "left")
    assert advice.after_arcmin <= gain.after_arcmin
    assert advice.probability_better >= gain.probability_better
    assert not is_helpful(advice, gain, SETTINGS)
    assert _judge_fused(fused)["left"].reason.endswith(HARDLY)


def test_a_verdict_tells_what_the_wearer_moved_and_what_it_changed() -> None:
    fused = _fused({"left": GOOD})
    check = Verification((0.002, -0.001, 0.003), (3.0, -4.0), (0.002, -0.001, 0.003), 0.002)
    first = replace(check, before_m=(0.006, -0.001, 0.003))
    found = describe_verified(RIG, fused, "left", check.after(first))
    # 4 mm to the side, seen at 0.4 to 0.6 m on a display at 2 m.
    expected_arcmin = 60 * np.degrees(np.mean([0.004 * (1 / z - 0.5) for z in (0.4, 0.5, 0.6)]))
    assert found.before_arcmin == pytest.approx(expected_arcmin, rel=0.05)
    assert found.changed_arcmin == pytest.approx(expected_arcmin, rel=0.01)
    assert (found.moved_arcmin, found.moved_size) == (5.0, 0.002)
    advice: dict[Eye, Advice] = {"left": advise(RIG, fused, "left", SETTINGS)}
    told = judge(RIG, fused, advice, SETTINGS, verified={"left": found})["left"].reason
    assert told.startswith(
        "The wearer moved the drawing by 5.0′ and +0.2 % in size in the last of 2 verifications. "
        f"What is drawn has changed by {found.changed_arcmin:.1f}′ since the first began. "
    )
    unmoved = _fused({"left": replace(GOOD, shift_m=np.array([0.0002, 0.0, 0.0]))})
    advice = {"left": advise(RIG, unmoved, "left", SETTINGS)}
    kept = judge(RIG, unmoved, advice, SETTINGS, verified={"left": found})["left"]
    assert kept.name == "keep"
    assert "changed" not in kept.reason


def test_what_no_eye_explains_is_said_and_never_accepted() -> None:
    good = _fused({"left": GOOD})
    assert _judge({"left": GOOD})["left"].name == "accept"
    fused = replace(good, misfit=Misfit(100.0, 12), apart_arcmin={"left": 8.2})
    advice: dict[Eye, Advice] = {"left": advise(RIG, fused, "left", SETTINGS)}
    verdict = judge(RIG, fused, advice, SETTINGS)["left"]
    assert verdict.name == "repeat"
    assert verdict.reason.startswith(MISFIT)
    assert "Two verifications of this eye are 8.2′ apart." in verdict.reason


def test_what_is_hardly_better_than_nothing_keeps_the_offline_calibration() -> None:
    unmoved = replace(GOOD, shift_m=np.array([0.0002, 0.0, 0.0]))
    verdict = _judge({"left": unmoved})["left"]
    assert verdict.name == "keep"
    assert verdict.reason.startswith("The offline calibration is expected to err by only")


def test_evidence_from_outside_contradicts_the_best_result() -> None:
    verdicts = _judge_fused(_fused({"left": GOOD, "right": GOOD}), SETTINGS, ["the picture froze"])
    assert {(verdict.name, verdict.reason) for verdict in verdicts.values()} == {
        ("contradicted", "The picture froze.")
    }


@pytest.mark.parametrize(
    ("sigma_m", "alignments", "name"),
    [(0.0007, 2, "repeat"), (0.0007, 3, "keep"), (0.0005, 3, "repeat")],
)
def test_within_the_target_only_two_more_alignments_are_asked_for(
    sigma_m: float, alignments: int, name: str
) -> None:
    """An offline calibration that is good enough is kept rather than bettered at length.

    Unless what was found is probably better: then it is drawn.
    """
    slight = replace(
        GOOD,
        shift_m=np.array([0.001, 0.0, 0.0]),
        covariance_m2=np.diag([sigma_m, sigma_m, 2.0 * sigma_m]) ** 2,
    )
    fused = _fused({"left": slight})
    gain = eye_benefit(RIG, fused, "left")
    assert gain.after_arcmin < gain.without_arcmin < SETTINGS.target_arcmin
    assert gain.probability_better < 0.99
    soon = Advice(
        ("left",),
        alignments,
        after_arcmin=2.0,
        probability_better=0.995,
        meets_target=True,
        is_accepted=True,
    )
    assert judge(RIG, fused, {"left": soon}, SETTINGS)["left"].name == name
