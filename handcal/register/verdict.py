"""The verdict on a solved eye shift: accept, repeat, keep the offline calibration, or implausible.

A calibration is accepted for its benefit: it must be better than no calibration with high
probability, and its expected error within the lab's target. Evidence from outside the solver can
contradict it, whatever the solver says.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from types import MappingProxyType

import numpy as np

from handcal.core.types import EYES, Eye, EyeShift, PlanName, Rig, Verdict, Verification
from handcal.register.benefit import Benefit, benefit, expected_arcmin, foreseen_benefit, percent
from handcal.register.fuse import Fused, Observation
from handcal.register.prior import eye_position_m, eye_slice

MOST_ALIGNMENTS = 10
MISFIT = "Drawing and hand differ in a way that no eye explains. Check the rig's depth edges."
"""Said of observations beyond what 95 % of usual wearers make."""
HARDLY = "More measurements would hardly change that. It can be used as it is."
"""Said where no step that can be advised brings *accept* nearer."""
RMS_MAX_M = 0.005
"""Largest distance of hand and cursor, root mean square, that is not to be repeated."""
# Least probability that the calibration is better than none. High, as a careless wearer whose few
# observations happen to agree passes for a usual one.
_PROBABILITY_MIN = 0.99
# Longest plausible φ.
_EYE_BOX_M = 0.020
# Plausible distances between the eyes (adults, ANSUR II: 52 to 78 mm).
_EYE_DISTANCES_M = 0.050, 0.080
_INLIER_RATIO_MIN = 0.6
# An eye whose calibration is as probably better as this is drawn with it, although not accepted.
_LIKELY = 0.8
# Least gain of probability that is worth a step.
_LEAST_GAIN = 0.01
# More than this are not worth it where the offline calibration is within the target.
_FEW_ALIGNMENTS = 2
# Each eye in turn, then both, which a wearer sees best and which determines the eyes' common part.
_IN_TURN: tuple[tuple[Eye, ...], ...] = ("left",), ("right",), EYES


@dataclass(frozen=True, slots=True)
class VerdictSettings:
    """Limits of the verdict."""

    target_arcmin: float = 8.0
    """Largest expected error in the display that the lab accepts."""


@dataclass(frozen=True, slots=True)
class Advice:
    """The alignments that would lead to *accept*, as far as can be predicted."""

    eyes: tuple[Eye, ...]
    """Eyes to keep open in each of them; empty if they follow a plan."""
    alignments: int
    after_arcmin: float
    """Error to expect then."""
    probability_better: float
    """Probability that the calibration is then better than none."""
    meets_target: bool
    """True if that error is within the target."""
    is_accepted: bool
    """True if both are enough for *accept*."""
    verify: bool = False
    """True if each eye that was not verified is to be verified after the alignments; if all were,
    this eye again, as no alignments are enough."""


def planned_eyes(
    plan: PlanName, done: Sequence[tuple[Eye, ...]], usable: tuple[Eye, ...] = EYES
) -> tuple[Eye, ...]:
    """Return the eyes to keep open in a plan's next alignment.

    ``paper``: both. ``recommended``: left, right and both in turn; what is missing, as after an
    alignment was deleted, comes first. With one usable eye, always that one.
    """
    if len(usable) == 1 or plan == "paper":
        return usable
    return min(_IN_TURN, key=lambda eyes: sum(set(one) == set(eyes) for one in done))


def eye_distance_m(rig: Rig, shifts: Mapping[Eye, EyeShift]) -> float | None:
    """Return the distance between the solved eyes, or None unless both are solved."""
    if set(shifts) != set(EYES):
        return None
    left_m, right_m = (eye_position_m(rig.eyes[eye], shifts[eye].shift_m) for eye in EYES)
    return float(np.linalg.norm(right_m - left_m))


def eye_benefit(rig: Rig, fused: Fused, eye: Eye) -> Benefit:
    """Return the benefit of a solved eye's φ."""
    part, shift = eye_slice(eye), fused.shifts[eye]
    return benefit(
        rig.eyes[eye],
        fused.prior.mean_m[part],
        fused.prior.covariance_m2[part, part],
        shift.shift_m,
        shift.covariance_m2,
    )


@dataclass(frozen=True, slots=True)
class Verified:
    """The outcome of an eye's verifications."""

    before_arcmin: float
    now_arcmin: float
    """Expected error before the first of them and now, from all that is known."""
    moved_arcmin: float
    moved_size: float
    """By how much the wearer moved the drawing in the last one, and made it grow."""
    changed_arcmin: float
    """By how much all that is drawn has changed since the first one began."""
    count: int
    """Number of the verifications."""


def describe_verified(rig: Rig, fused: Fused, eye: Eye, verification: Verification) -> Verified:
    """Return what an eye's verifications found, the last with the earlier ones."""
    display, shift = rig.eyes[eye], fused.shifts[eye]
    first = (*verification.earlier, verification)[0]
    changed_m = shift.shift_m - first.before_m
    moved = np.add(verification.nudge_arcmin, verification.offset_arcmin)
    return Verified(
        before_arcmin=expected_arcmin(display, changed_m, shift.covariance_m2),
        now_arcmin=expected_arcmin(display, np.zeros(3), shift.covariance_m2),
        moved_arcmin=float(np.linalg.norm(moved)),
        moved_size=verification.nudge_size + verification.offset_size,
        changed_arcmin=expected_arcmin(display, changed_m, np.zeros((3, 3))),
        count=1 + len(verification.earlier),
    )


def advise(
    rig: Rig,
    fused: Fused,
    eye: Eye,
    settings: VerdictSettings,
    upcoming: Sequence[tuple[Eye, ...]] = (),
) -> Advice:
    """Return the fewest further alignments after which an eye is expected to be accepted.

    With a plan, those are its next alignments, `upcoming`, and a verification may follow. Without
    one, alignments with this eye alone open are compared with alignments with all solved eyes open.
    """
    part, shift = eye_slice(eye), fused.shifts[eye]
    now = foreseen_benefit(rig.eyes[eye], shift.shift_m, shift.covariance_m2)

    def foresee(eyes: tuple[Eye, ...], count: int, then: Collection[Observation] = ()) -> Advice:
        aligned = [eyes] * count if eyes else upcoming[:count]
        after_arcmin, probability = foreseen_benefit(
            rig.eyes[eye],
            shift.shift_m,
            fused.foreseen_m2(aligned, tuple(then))[part, part],
        )
        # It is foreseen for one precision of the wearer, and judged for several: no step harms.
        after_arcmin, probability = min(after_arcmin, now[0]), max(probability, now[1])
        is_accepted = _is_enough(after_arcmin, probability, settings)
        meets_target = after_arcmin <= settings.target_arcmin
        return Advice(eyes, count, after_arcmin, probability, meets_target, is_accepted, bool(then))

    solved = tuple(fused.shifts)
    if not upcoming:
        plans = [solved, (eye,)] if len(solved) > 1 else [solved]
        counts = range(1, MOST_ALIGNMENTS + 1)
        return _best_advice(foresee(eyes, count) for count in counts for eyes in plans)
    unverified = [one for other, one in fused.verifiable.items() if other not in fused.verified]
    options = [foresee((), count) for count in range(1, len(upcoming) + 1)]
    if unverified:
        options += [foresee((), count, unverified) for count in range(len(upcoming) + 1)]
    elif eye in fused.verified and not _best_advice(options).is_accepted:
        options.append(foresee((), 0, [fused.verifiable[eye]]))
    return _best_advice(options)


def is_helpful(advice: Advice, gain: Benefit, settings: VerdictSettings) -> bool:
    """Return whether what is advised can be expected to bring *accept* nearer."""
    return (
        advice.is_accepted
        or advice.probability_better >= gain.probability_better + _LEAST_GAIN
        or (gain.after_arcmin > settings.target_arcmin and advice.meets_target)
    )


def _best_advice(options: Iterable[Advice]) -> Advice:
    return reduce(lambda best, one: one if _is_better_advice(one, best) else best, options)


def _is_better_advice(one: Advice, other: Advice) -> bool:
    """Return whether advice leads further, or as far with fewer alignments or a smaller error."""
    steps = one.is_accepted - other.is_accepted or one.meets_target - other.meets_target
    if steps or not other.meets_target:
        return steps > 0 or (steps == 0 and one.after_arcmin < other.after_arcmin)
    fewer = other.alignments - one.alignments
    return fewer > 0 or (fewer == 0 and one.after_arcmin < other.after_arcmin)


def judge(
    rig: Rig,
    fused: Fused,
    advice: Mapping[Eye, Advice],
    settings: VerdictSettings,
    contradictions: Sequence[str] = (),
    verified: Mapping[Eye, Verified] = MappingProxyType({}),
) -> dict[Eye, Verdict]:
    """Judge every solved eye; the first reason that applies is given.

    Parameters
    ----------
    rig : Rig
    fused : Fused
    advice : mapping of eye to Advice
        As `advise` gives it, for each solved eye.
    settings : VerdictSettings
    contradictions : sequence of str
        Sentences of evidence from outside the solver against the result.
    verified : mapping of eye to Verified
        They are part of `fused`, and so of the verdict; here they are added to the reason.
    """
    apart_m = eye_distance_m(rig, fused.shifts)
    if contradictions:
        return {
            eye: Verdict("contradicted", _sentences(*dict.fromkeys(contradictions)))
            for eye in fused.shifts
        }
    verdicts = {
        eye: _fault(shift, apart_m)
        or _judge_benefit(
            eye_benefit(rig, fused, eye),
            advice[eye],
            _further_text(fused, advice[eye], eye),
            settings,
        )
        for eye, shift in fused.shifts.items()
    }
    for eye, verdict in verdicts.items():
        if verdict.name in ("accept", "repeat", "keep"):
            verdicts[eye] = _with_evidence(verdict, fused, eye, verified.get(eye))
    return verdicts


def _with_evidence(verdict: Verdict, fused: Fused, eye: Eye, verified: Verified | None) -> Verdict:
    """Return a verdict with what the verifications and the misfit add to it."""
    reasons = []
    if fused.misfit is not None and fused.misfit.ratio > 1.0:
        reasons.append(MISFIT)
        if verdict.name == "accept":
            verdict = replace(verdict, name="repeat")
    if (apart_arcmin := fused.apart_arcmin.get(eye)) is not None:
        reasons.append(f"Two verifications of this eye are {apart_arcmin:.1f}′ apart.")
    if verified is not None:
        last = f" in the last of {verified.count} verifications" if verified.count > 1 else ""
        size = f"{100 * verified.moved_size:+.1f}".replace("-", "\N{MINUS SIGN}")
        reasons.append(
            f"The wearer moved the drawing by {verified.moved_arcmin:.1f}′ and {size} % in "
            f"size{last}."
        )
        if verdict.name != "keep":
            changed = verified.changed_arcmin
            since = "the first began" if verified.count > 1 else "then"
            reasons.append(f"What is drawn has changed by {changed:.1f}′ since {since}.")
    return replace(verdict, reason=" ".join([*reasons, verdict.reason]))


def _fault(shift: EyeShift, apart_m: float | None) -> Verdict | None:
    """Return the verdict on a result that is wrong in itself, else None."""
    length_m = float(np.linalg.norm(shift.shift_m))
    if length_m > _EYE_BOX_M:
        return Verdict(
            "implausible",
            f"The eye would lie {1e3 * length_m:.0f} mm from the rig's viewpoint, beyond the "
            f"{1e3 * _EYE_BOX_M:.0f} mm eye box. Check how the headset sits, and the rig.",
        )
    if apart_m is not None and not (_EYE_DISTANCES_M[0] <= apart_m <= _EYE_DISTANCES_M[1]):
        return Verdict(
            "implausible",
            f"The eyes would lie {1e3 * apart_m:.0f} mm apart. "
            "Check the rig, or align one eye at a time.",
        )
    if not shift.converged:
        return Verdict("repeat", f"The registration did not converge ({shift.stop_reason}).")
    if shift.inlier_ratio < _INLIER_RATIO_MIN:
        return Verdict(
            "repeat",
            f"Only {100 * shift.inlier_ratio:.0f} % of the hand found its place on the cursor. "
            "Hold the hand in the cursor's shape.",
        )
    if shift.rms_m > RMS_MAX_M:
        return Verdict(
            "repeat",
            f"Hand and cursor differ by {1e3 * shift.rms_m:.1f} mm. "
            "Hold the hand in the cursor's shape.",
        )
    return None


def _judge_benefit(gain: Benefit, advice: Advice, more: str, settings: VerdictSettings) -> Verdict:
    sure = percent(gain.probability_better)
    if _is_enough(gain.after_arcmin, gain.probability_better, settings):
        return Verdict(
            "accept",
            f"The expected error is {gain.after_arcmin:.1f}′ instead of "
            f"{gain.without_arcmin:.1f}′. It is {sure} sure to be better than no calibration.",
        )
    is_soon_accepted = advice.is_accepted and advice.alignments <= _FEW_ALIGNMENTS
    if gain.without_arcmin <= gain.after_arcmin or (
        gain.without_arcmin <= settings.target_arcmin
        and gain.probability_better < _LIKELY
        and not is_soon_accepted
    ):
        return Verdict(
            "keep",
            f"The offline calibration is expected to err by only {gain.without_arcmin:.1f}′ here. "
            f"This result is expected to err by {gain.after_arcmin:.1f}′. It is only {sure} sure "
            "to be better.",
        )
    now = [f"The expected error is {gain.after_arcmin:.1f}′."]
    if gain.after_arcmin > settings.target_arcmin:
        now.append(f"The target is {settings.target_arcmin:g}′.")
    now.append(f"It is {sure} sure to be better than no calibration.")
    if gain.probability_better < _PROBABILITY_MIN:
        now.append(f"{percent(_PROBABILITY_MIN)} are needed.")
    return Verdict("repeat", " ".join([*now, *_foreseen(gain, advice, more, settings)]))


def _foreseen(gain: Benefit, advice: Advice, more: str, settings: VerdictSettings) -> list[str]:
    """Return what further steps are expected to change: only what they improve."""
    if advice.meets_target and not is_helpful(advice, gain, settings):
        return [HARDLY]
    then = []
    if gain.after_arcmin > settings.target_arcmin and advice.after_arcmin < gain.after_arcmin:
        only = "" if advice.meets_target else "only "
        then.append(f"{only}{advice.after_arcmin:.1f}′")
    if gain.probability_better < _PROBABILITY_MIN and advice.meets_target:
        then.append(f"{percent(advice.probability_better)} certainty")
    found = [f"After {more}, {' and '.join(then)} can be expected."] if then else []
    if not advice.meets_target:
        found.append("Enter the eye distance, or verify each eye.")
    return found


def _further_text(fused: Fused, advice: Advice, eye: Eye) -> str:
    """Return what advice asks for: ``2 more alignments, then verifying each eye``."""
    count = advice.alignments
    steps = [f"{count} more alignment{'s' * (count != 1)}"] if count else []
    if advice.eyes:
        steps[0] += " with both eyes open" if len(advice.eyes) > 1 else f" with the {eye} eye alone"
    if advice.verify:
        is_again = set(fused.shifts) <= set(fused.verified)
        steps.append("verifying this eye again" if is_again else "verifying each eye")
    return ", then ".join(steps)


def _sentences(*texts: str) -> str:
    return " ".join(f"{text[:1].upper()}{text[1:].rstrip('.')}." for text in texts)


def _is_enough(after_arcmin: float, probability_better: float, settings: VerdictSettings) -> bool:
    return probability_better >= _PROBABILITY_MIN and after_arcmin <= settings.target_arcmin
