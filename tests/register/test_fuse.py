from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import projection_matrix, view_of_eye
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import (
    EYES,
    Alignment,
    DepthCheck,
    DepthEdges,
    Eye,
    EyeShift,
    Float64,
    Verification,
)
from handcal.lab.bench.trials import trial_hand
from handcal.register import fuse
from handcal.register.fuse import Fused, FuseSettings, fuse_alignments
from handcal.register.prior import PriorSettings
from handcal.register.shape import Opening
from handcal.register.sitting import SittingSettings
from handcal.register.solve import solve_alignment, with_eye_box
from handcal.register.surface import describe_surface
from handcal.rig.example import example_rig
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.placement import overlay_hand, view_through
from handcal.sim.raster import visible_points

RIG = replace(example_rig(), depth_edges=DepthEdges(0.0, 1e-9, "measured"))
SETTINGS = FuseSettings(sitting=SittingSettings(0.0, 0.0))
# Of the registration, mixed axes.
_AXES = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
REGISTRATION_M2 = _AXES @ np.diag([0.0003, 0.0005, 0.0010]) ** 2 @ _AXES.T
DEPTH_M = 0.5


@pytest.fixture
def usual_wearer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the wearer as known to be as precise as usual."""
    monkeypatch.setattr(fuse, "_WEARER_SCALES", (1.0,))
    monkeypatch.setattr(fuse, "_WEARER_WEIGHTS", (1.0,))


def _shift(shift_m: Float64, covariance_m2: Float64 = REGISTRATION_M2) -> EyeShift:
    return EyeShift(
        shift_m, covariance_m2, 0.001, np.zeros(5), 0.9, 8, True, "done", np.ones(8), "consistent"
    )


def _flat_hand(eyes: tuple[Eye, ...], T_E_W: Float64) -> Alignment:
    """A square in the middle of the view of both eyes, as if both were at one place."""
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 30), np.linspace(-0.05, 0.05, 30))
    square_m = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, DEPTH_M)])
    hand_m = transform(invert(T_E_W), square_m)
    cut = np.zeros(len(hand_m), dtype=np.bool_)
    return Alignment(hand_m, hand_m, cut, cut, dict.fromkeys(EYES, T_E_W), eyes, np.zeros(3), 0, 1)


BOTH = _flat_hand(EYES, rigid([0.3, -0.2, 1.0], [0.5, 0.1, -0.4]))
ONE: dict[Eye, Alignment] = {eye: _flat_hand((eye,), np.eye(4)) for eye in EYES}


def _prior_m2() -> Float64:
    """Covariance of [φ_left; φ_right] by the settings: each in its box, both nearly the same."""
    box = np.eye(6) / SETTINGS.prior.eye_box_sigma_m**2
    difference = np.hstack([-np.eye(3), np.eye(3)])
    apart = np.diag(np.array(SETTINGS.prior.eye_difference_sigma_m) ** -2.0)
    return np.asarray(np.linalg.inv(box + difference.T @ apart @ difference))


def _wearer_m2() -> Float64:
    """Return the covariance of φ at half a metre: σ is 4′ across and 0.4 % along, times 4/3."""
    across_m = 4 / 3 * DEPTH_M * np.tan(np.radians(4 / 60))
    return np.diag([across_m, across_m, 4 / 3 * DEPTH_M * 0.004]) ** 2


def _align(
    rng: np.random.Generator, alignment: Alignment, true_m: Mapping[Eye, Float64]
) -> tuple[Alignment, dict[Eye, EyeShift]]:
    """Solve as a wearer would have it who, with both eyes open, balances them: their mean."""
    seen_m = np.mean([true_m[eye] for eye in alignment.eyes], axis=0)
    seen_m = seen_m + rng.multivariate_normal(np.zeros(3), REGISTRATION_M2 + _wearer_m2())
    return alignment, {eye: _shift(seen_m) for eye in alignment.eyes}


@pytest.mark.parametrize(
    "alignments",
    [[BOTH], [ONE["left"], ONE["right"]], [BOTH, ONE["left"], BOTH, ONE["right"]]],
    ids=["both", "each", "mixed"],
)
def test_estimates_are_unbiased_and_their_covariance_honest(alignments: list[Alignment]) -> None:
    rng = np.random.default_rng(0)
    trials = 80
    errors_m, squares = [], []
    for _ in range(trials):
        drawn_m = rng.multivariate_normal(np.zeros(6), _prior_m2())
        true_m: dict[Eye, Float64] = {"left": drawn_m[:3], "right": drawn_m[3:]}
        solved = [_align(rng, alignment, true_m) for alignment in alignments]
        for eye, fused in fuse_alignments(solved, RIG, SETTINGS).shifts.items():
            error_m = fused.shift_m - true_m[eye]
            errors_m.append(error_m)
            squares.append(error_m @ np.linalg.solve(fused.covariance_m2, error_m))
    spread_m = np.std(errors_m, axis=0) / np.sqrt(trials)
    assert (np.abs(np.mean(errors_m, axis=0)) < 4 * spread_m).all()
    # Disagreement by chance widens the covariance of several a little.
    assert 2.0 < np.mean(squares) < 3.6


def _check(rng: np.random.Generator, true_m: Float64) -> Verification:
    """A check by a wearer whose error is 2′ across and 0.5 % in size, times 4/3 in φ."""
    across_m = 4 / 3 * DEPTH_M * np.radians(2 / 60)
    sigma_m = np.array([across_m, across_m, 4 / 3 * DEPTH_M * 0.005])
    x, y, z = (true_m + rng.normal(0.0, sigma_m)).tolist()
    return Verification((0.0, 0.0, 0.0), (1.0, 0.0), (x, y, z), 0.0, (0.0, 0.0, DEPTH_M))


@pytest.mark.usefixtures("usual_wearer")
@pytest.mark.parametrize("checks", [1, 2])
def test_checks_alone_give_estimates_with_honest_covariances(checks: int) -> None:
    rng = np.random.default_rng(0)
    errors_m, squares = [], []
    for _ in range(150):
        drawn_m = rng.multivariate_normal(np.zeros(6), _prior_m2())
        verified: dict[Eye, Verification] = {}
        for eye, true_m in zip(EYES, (drawn_m[:3], drawn_m[3:]), strict=True):
            for _ in range(checks):
                verified[eye] = _check(rng, true_m).after(verified.get(eye))
        fused = fuse_alignments([], RIG, SETTINGS, verified=verified)
        for eye, true_m in zip(EYES, (drawn_m[:3], drawn_m[3:]), strict=True):
            error_m = fused.shifts[eye].shift_m - true_m
            errors_m.append(error_m)
            squares.append(error_m @ np.linalg.solve(fused.shifts[eye].covariance_m2, error_m))
    assert (np.abs(np.mean(errors_m, axis=0)) < 4 * np.std(errors_m, axis=0) / np.sqrt(150)).all()
    assert 2.5 < np.mean(squares) < 3.5
    assert set(fused.verifiable) == set(EYES)


@pytest.mark.usefixtures("usual_wearer")
def test_a_check_adds_to_an_alignment_and_says_nothing_without_a_place() -> None:
    rng = np.random.default_rng(1)
    true_m = np.array([0.003, -0.002, 0.004])
    seen: dict[Eye, EyeShift] = {"left": _shift(true_m)}
    check = _check(rng, true_m)
    checks: list[dict[Eye, Verification]] = [
        {}, {"left": check}, {"left": replace(check, hand_E_m=None)},
    ]  # fmt: skip
    alone, checked, nowhere = (
        fuse_alignments([(ONE["left"], seen)], RIG, SETTINGS, verified=verified)
        for verified in checks
    )
    sigma_m = [np.linalg.norm(one.shifts["left"].sigma_m) for one in (alone, checked, nowhere)]
    assert sigma_m[1] < 0.8 * sigma_m[0]
    assert sigma_m[2] == sigma_m[0]
    foreseen_m2 = alone.foreseen_m2([], list(alone.verifiable.values()))[:3, :3]
    np.testing.assert_allclose(foreseen_m2, checked.shifts["left"].covariance_m2, rtol=0.02)


@pytest.mark.usefixtures("usual_wearer")
def test_one_alignment_with_one_eye_is_the_estimate_with_the_prior() -> None:
    seen_m = np.array([0.003, -0.002, 0.004])
    fused = fuse_alignments([(ONE["left"], {"left": _shift(seen_m)})], RIG, SETTINGS).shifts
    assert set(fused) == {"left"}
    prior, noise = _prior_m2()[:3, :3], REGISTRATION_M2 + _wearer_m2()
    gain = prior @ np.linalg.inv(prior + noise)
    np.testing.assert_allclose(fused["left"].shift_m, gain @ seen_m, atol=1e-7)
    covariance_m2 = prior - gain @ prior
    np.testing.assert_allclose(fused["left"].covariance_m2, covariance_m2, rtol=1e-4, atol=1e-12)


def _sigma_x_m(solved: list[tuple[Alignment, dict[Eye, EyeShift]]], eye: Eye = "left") -> float:
    fused = fuse_alignments(solved, RIG, SETTINGS).shifts[eye]
    return float(np.sqrt(fused.covariance_m2[0, 0]))


def test_only_one_eye_at_a_time_shows_the_eye_distance() -> None:
    true_m: dict[Eye, Float64] = {
        "left": np.array([-0.001, 0.0, 0.0]),
        "right": np.array([0.003, 0.0, 0.0]),
    }
    both: tuple[Alignment, dict[Eye, EyeShift]] = (
        BOTH,
        {eye: _shift(np.array([0.001, 0.0, 0.0])) for eye in EYES},
    )
    each: list[tuple[Alignment, dict[Eye, EyeShift]]] = [
        (ONE[eye], {eye: _shift(true_m[eye])}) for eye in EYES
    ]
    at_once, apart = (fuse_alignments(s, RIG, SETTINGS).shifts for s in ([both] * 4, each * 4))
    for eye, shift_m in true_m.items():
        np.testing.assert_allclose(at_once[eye].shift_m, [0.001, 0, 0], atol=5e-5)
        np.testing.assert_allclose(apart[eye].shift_m, shift_m, atol=3e-4)
    # Half the prior on the difference is what no number of alignments with both eyes takes away.
    difference = np.array([-1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    floor_m = 0.5 * np.sqrt(difference @ _prior_m2() @ difference)
    assert floor_m * 0.98 < _sigma_x_m([both] * 20) < _sigma_x_m([both]) < 1.5 * floor_m
    assert _sigma_x_m(each * 4) < 0.5 * floor_m


def test_disagreement_widens_the_covariance() -> None:
    aside_m = np.array([0.004, 0.0, 0.0])

    def fused(offset_m: Float64) -> Fused:
        pair: list[tuple[Alignment, dict[Eye, EyeShift]]] = [
            (ONE["left"], {"left": _shift(sign * offset_m)}) for sign in (-1, 1)
        ]
        return fuse_alignments(pair, RIG, SETTINGS)

    agreeing, disagreeing = fused(0.1 * aside_m), fused(aside_m)
    assert agreeing.wearer_scale < 1.3 < 3.0 < disagreeing.wearer_scale
    sigma_m = disagreeing.shifts["left"].sigma_m
    assert sigma_m[0] > 2.0 * agreeing.shifts["left"].sigma_m[0]
    assert 0.5 < sigma_m[0] / (0.004 / np.sqrt(2)) < 1.5
    np.testing.assert_allclose(disagreeing.shifts["left"].shift_m, 0.0, atol=1e-12)


@pytest.mark.usefixtures("usual_wearer")
@pytest.mark.parametrize("alignments", [[BOTH], [ONE["left"], ONE["right"]]], ids=["both", "each"])
@pytest.mark.parametrize("times", [1, 3])
def test_more_alignments_are_worth_what_repetitions_bring(
    alignments: list[Alignment], times: int
) -> None:
    once = [(one, {eye: _shift(np.zeros(3)) for eye in one.eyes}) for one in alignments]
    two_more = [once[0]] * 2
    now, after = (
        fuse_alignments(all_, RIG, SETTINGS) for all_ in (once * times, once * times + two_more)
    )
    foreseen_m2 = now.foreseen_m2([alignments[0].eyes] * 2)
    for eye, part in zip(EYES, (slice(0, 3), slice(3, 6)), strict=True):
        np.testing.assert_allclose(
            foreseen_m2[part, part], after.shifts[eye].covariance_m2, rtol=0.01, atol=1e-9
        )


def test_eye_box_weighs_as_a_prior_should() -> None:
    covariance_m2 = np.diag([0.001, 0.010, 0.100]) ** 2
    boxed = with_eye_box(_shift(np.full(3, 0.008), covariance_m2))
    # Weights 1/σ² against 1/(10 mm)²: 100:1, 1:1 and 1:100.
    np.testing.assert_allclose(boxed.shift_m, 0.008 * np.array([100 / 101, 1 / 2, 1 / 101]))
    expected = 1e-4 * np.array([1 / 101, 1 / 2, 100 / 101])
    np.testing.assert_allclose(boxed.covariance_m2, np.diag(expected), atol=1e-15)


@pytest.mark.parametrize("apart_m", [-0.004, 0.004])
def test_both_eyes_see_what_the_weights_say(apart_m: float) -> None:
    """An eye distance off by 4 mm misplaces the hand by a centimetre in depth, as predicted."""
    rng = np.random.default_rng(3)
    hand = trial_hand(0)
    half_m = np.array([0.5 * apart_m, 0.0, 0.0])
    true_m: dict[Eye, Float64] = {"left": -half_m, "right": half_m}
    T_H_hand = rigid([0.05, -0.1, 0.02], [0.0, 0.088, 0.51])
    T_D_H = invert(RIG.T_H_D)
    cursor_D_m, cut = visible_points(hand, T_D_H @ T_H_hand, 3000, rng, forearm_m=0.04)
    cursor_m = transform(RIG.T_H_D, cursor_D_m)
    surface = describe_surface(cursor_m, cut, len(cursor_m))
    outline_m = surface.points_m[surface.outline]
    views = [
        view_through(
            RIG.eyes[eye],
            shift_m,
            np.eye(4),
            projection_matrix(RIG.eyes[eye]) @ RIG.eyes[eye].T_V_H,
            outline_m,
        )
        for eye, shift_m in true_m.items()
    ]
    placed = overlay_hand(transform(invert(T_H_hand), outline_m), T_H_hand, views)
    assert placed is not None
    alignment = Alignment(
        cursor_m=cursor_m,
        hand_m=transform(placed[0] @ invert(T_H_hand), cursor_m),
        cursor_is_cut=cut,
        hand_is_cut=cut,
        T_E_W={eye: view_of_eye(RIG.eyes[eye], np.eye(4)) for eye in EYES},
        eyes=EYES,
        rotation_rad=np.zeros(3),
        t_a_ns=0,
        t_b_ns=1,
    )
    solved = solve_alignment(alignment, RIG)
    assert np.sign(apart_m) * solved["left"].shift_m[2] > 0.007
    # With a prior that the eyes are well placed, but no eye distance, this must give it.
    prior = PriorSettings(eye_difference_sigma_m=(0.1, 1e-6, 1e-6), eye_box_sigma_m=0.003)
    unknowing = replace(SETTINGS, prior=prior)
    fused = fuse_alignments([(alignment, solved)], RIG, unknowing).shifts
    for eye, shift_m in true_m.items():
        np.testing.assert_allclose(fused[eye].shift_m, shift_m, atol=5e-4)


SCALE, OFFSET_M = 1.01, 0.002


def _depth_check(views_m2: Float64, scale: float = 1.0, offset_m: float = 0.0) -> DepthCheck:
    return DepthCheck(
        "2026-01-01", 8, scale, offset_m, views_m2, np.array([[0.3, 0.8]]), np.zeros(1), np.zeros(1)
    )


def _by_wrong_depth(alignment: Alignment) -> Alignment:
    """Return an alignment whose hand was measured with a wrong scale and offset of depth."""
    T_D_W = invert(view_of_eye(RIG.eyes["left"], np.eye(4)) @ RIG.T_H_D) @ alignment.T_E_W["left"]
    hand_D_m = transform(T_D_W, alignment.hand_m)
    depth_m = hand_D_m[:, 2:]
    wrong_D_m = hand_D_m * ((SCALE * depth_m + OFFSET_M) / depth_m)
    return replace(alignment, hand_m=transform(invert(T_D_W), wrong_D_m))


@pytest.mark.usefixtures("usual_wearer")
def test_a_bias_of_depth_moves_what_is_observed_as_the_system_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without the hand's size, which a bias of one of the clouds changes as well."""
    monkeypatch.setattr(Opening, "known", lambda *_: (0.0, 0.0))
    alignment = overlay_by_eye(
        np.random.default_rng(2),
        trial_hand(1),
        RIG,
        {"left": np.array([0.003, -0.002, 0.001])},
        2000,
    )
    biased = replace(RIG, depth_check=_depth_check(np.zeros((2, 2)), SCALE, OFFSET_M))
    solved = [
        (one, solve_alignment(one, RIG, "consistent"))
        for one in (alignment, _by_wrong_depth(alignment))
    ]
    right, wrong = (fuse_alignments([one], biased, SETTINGS) for one in solved)
    seen_m = wrong.observed[0].seen_m - right.observed[0].seen_m
    assert np.linalg.norm(seen_m) > 0.004
    by_depth = right.observed[0].by_sitting[:, 4:]
    np.testing.assert_allclose(by_depth @ [SCALE - 1.0, OFFSET_M], seen_m, atol=1e-3)
    # A bias that the check has found is expected: the estimate follows it less, and within σ.
    moved_m = wrong.shifts["left"].shift_m - right.shifts["left"].shift_m
    sure, surely_wrong = (fuse_alignments([one], RIG, SETTINGS).shifts["left"] for one in solved)
    assert abs(moved_m[2]) < 0.5 * abs(surely_wrong.shift_m[2] - sure.shift_m[2])
    assert abs(moved_m[2]) < right.shifts["left"].sigma_m[2]
    assert right.shifts["left"].sigma_m[2] > 1.2 * sure.sigma_m[2]


@pytest.mark.usefixtures("usual_wearer")
def test_an_uncertain_depth_widens_sigma_and_more_alignments_do_not_help() -> None:
    check = _depth_check(np.diag([0.01**2, 0.003**2]))
    checked = replace(RIG, depth_check=check)
    solved = _align(np.random.default_rng(1), ONE["left"], {"left": np.zeros(3)})
    # 1 % of half a metre and 3 mm, times 4/3, is all that is known of φ3, besides the prior.
    depth_m2 = (4 / 3) ** 2 * (0.005**2 + 0.003**2)
    floor_m = np.sqrt(1.0 / (1.0 / _prior_m2()[2, 2] + 1.0 / depth_m2))
    sigmas_m = np.array(
        [
            [
                fuse_alignments([solved] * count, rig, SETTINGS).shifts["left"].sigma_m[2]
                for count in (1, 16)
            ]
            for rig in (RIG, checked)
        ]
    )
    (plain_m, plainly_m), (widened_m, floored_m) = sigmas_m
    assert plainly_m < 0.35 * plain_m
    assert 0.97 * floor_m < floored_m < 1.12 * floor_m
    assert floored_m < widened_m < 1.4 * floor_m
