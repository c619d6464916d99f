"""Errors that repeat in a sitting: what more observations do not average out."""

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import EYES, DepthEdges, Eye, Float64, Verification
from handcal.register import fuse
from handcal.register.fuse import Fused, FuseSettings, fuse_alignments
from handcal.register.model import nudged_shift_m
from handcal.register.prior import PriorSettings
from handcal.register.results import SolveSettings, conclude
from handcal.register.sitting import LearnedSitting, SittingSettings
from handcal.rig.example import example_rig

RIG = replace(example_rig(), depth_edges=DepthEdges(1.8, 0.2, "measured"))
NEAR_M, FAR_M = (0.0, 0.02, 0.42), (0.0, 0.02, 0.7)
NOTHING = SittingSettings(0.0, 0.0)


def verified(
    places_m: list[tuple[float, float, float]],
    true_m: Float64,
    *,
    sees: tuple[float, float, float] = (0.0, 0.0, 0.0),
    eye: Eye = "left",
) -> dict[Eye, Verification]:
    """Return verifications by a wearer without other errors, who sees the hand wrongly."""
    found: Verification | None = None
    for place_m in places_m:
        after_m = nudged_shift_m(RIG.eyes[eye], true_m, place_m, *sees)
        one = Verification((0, 0, 0), (5.0, 1.0), tuple(after_m.tolist()), 0.01, place_m)
        found = one.after(found)
    assert found is not None
    return {eye: found}


def fused(places_m: list[tuple[float, float, float]], sitting: SittingSettings) -> Fused:
    return fuse_alignments(
        [], RIG, FuseSettings(sitting=sitting), verified=verified(places_m, np.zeros(3))
    )


def test_what_repeats_does_not_average_out() -> None:
    rig = replace(RIG, depth_edges=DepthEdges(1.8, 1e-6, "measured"))
    sitting = SittingSettings(3.0, 0.01)
    settings, without = FuseSettings(sitting=sitting), FuseSettings(sitting=NOTHING)
    many = verified([NEAR_M] * 40, np.zeros(3))
    of_many = fuse_alignments([], rig, settings, verified=many).shifts["left"]
    alone = fuse_alignments([], rig, without, verified=many).shifts["left"]
    # 3′ and 1 % of a hand at 0.42 m before a display at 2 m; the prior of φ takes a little of it.
    across_m, along_m = (0.42 / (1.0 - 0.21)) * np.array([np.radians(3.0 / 60.0), 0.01])
    assert alone.sigma_m[0] < 0.15 * across_m
    np.testing.assert_allclose(of_many.sigma_m[:2], across_m, rtol=0.1)
    assert 3.0 * alone.sigma_m[2] < of_many.sigma_m[2] < along_m


@pytest.mark.parametrize(("axis", "sees"), [(0, (4.0, 0.0, 0.0)), (2, (0.0, 0.0, 0.01))])
def test_the_derivatives_are_those_of_a_nudge(axis: int, sees: tuple[float, float, float]) -> None:
    """A wearer's constant error moves the φ that a verification finds as the system says."""
    right, down, size = sees
    one = fused([NEAR_M], SittingSettings()).verified["left"][0]
    moved_m = nudged_shift_m(RIG.eyes["left"], np.zeros(3), NEAR_M, *sees)
    error = np.array([np.radians(right / 60.0), np.radians(down / 60.0), size, 0.0, 0.0, 0.0])
    np.testing.assert_allclose((one.by_sitting @ error)[axis], moved_m[axis], rtol=0.03)


def test_near_and_far_tell_a_constant_error_from_the_eyes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuse, "_VERIFIED_SIGMA_ARCMIN", 0.3)
    wide = FuseSettings(
        sitting=SittingSettings(6.0, 0.004),
        prior=PriorSettings(eye_box_sigma_m=0.01),
    )
    true_m, sees = np.array([0.003, 0.0, 0.0]), (4.0, 0.0, 0.0)
    errors_m = []
    for places_m in ([NEAR_M] * 4, [NEAR_M, FAR_M] * 2):
        seen = verified(places_m, true_m, sees=sees)
        shift = fuse_alignments([], RIG, wide, verified=seen).shifts["left"]
        errors_m.append(abs(shift.shift_m[0] - true_m[0]))
    assert errors_m[1] < 0.5 * errors_m[0]


def test_learned_errors_of_wearers_are_corrected() -> None:
    sees = (0.0, 0.0, 0.01)
    learned = LearnedSitting((0.0, 0.0, 0.01), tuple(np.diag([1e-8, 1e-8, 1e-8]).ravel()), 600)
    seen = verified([NEAR_M] * 4, np.zeros(3), sees=sees)
    default_m, learned_m = (
        abs(
            fuse_alignments([], RIG, FuseSettings(sitting=sitting), verified=seen)
            .shifts["left"]
            .shift_m[2]
        )
        for sitting in (SittingSettings(), SittingSettings(learned=learned))
    )
    assert default_m > 0.002
    assert learned_m < 0.0005


def test_a_verification_without_a_nudge_is_no_evidence() -> None:
    moved = verified([NEAR_M, NEAR_M], np.array([0.003, 0.0, 0.0]))
    unmoved = replace(
        moved["left"], nudge_arcmin=(0.0, 0.0), nudge_size=0.0, earlier=(), after_m=(0, 0, 0)
    )
    both = unmoved.after(moved["left"])
    settings = FuseSettings()
    with pytest.raises(ValueError, match="at least one"):
        fuse_alignments([], RIG, settings, verified={"left": unmoved})
    without, ignored = (
        fuse_alignments([], RIG, settings, verified={"left": one}).shifts["left"].shift_m
        for one in (moved["left"], both)
    )
    np.testing.assert_array_equal(without, ignored)


def test_verifications_that_contradict_each_other_widen_sigma() -> None:
    shifts_m = [np.zeros(3), np.array([0.0018, 0.0, 0.0])]  # 9′ apart
    (one,), (other,) = (verified([NEAR_M], shift_m).values() for shift_m in shifts_m)
    apart = fuse_alignments([], RIG, FuseSettings(), verified={"left": other.after(one)})
    alike = fuse_alignments([], RIG, FuseSettings(), verified={"left": one.after(one)})
    assert 6.0 < apart.apart_arcmin["left"] < 12.0
    assert not alike.apart_arcmin
    assert apart.shifts["left"].sigma_m[0] > 1.5 * alike.shifts["left"].sigma_m[0]


def test_an_eye_that_nobody_has_is_a_misfit_and_not_accepted() -> None:
    seen = {
        eye: one
        for eye in EYES
        for one in verified([NEAR_M, NEAR_M], np.array([0.0, 0.0, -0.019]), eye=eye).values()
    }
    found = conclude([], RIG, SolveSettings(), verified=seen)
    assert found.evidence == ("misfit",)
    assert {verdict.name for verdict in found.verdicts.values()} <= {"repeat", "keep"}
    usual = conclude([], RIG, SolveSettings(), verified=verified([NEAR_M], np.zeros(3)))
    assert usual.evidence == ()


def test_an_outline_that_nobody_measured_may_be_wrong_by_more() -> None:
    """Then φ3 is drawn to where eyes are, instead of being believed."""
    fat = verified([NEAR_M, NEAR_M], np.array([0.0, 0.0, -0.012]))
    measured, typical = (
        fuse_alignments([], rig, FuseSettings(), verified=fat).shifts["left"]
        for rig in (RIG, replace(RIG, depth_edges=None))
    )
    assert abs(typical.shift_m[2]) < 0.7 * abs(measured.shift_m[2])
    assert typical.sigma_m[2] > 1.1 * measured.sigma_m[2]
