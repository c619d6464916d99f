import json

import numpy as np
import pytest

from handcal.core.types import Float64
from handcal.io.settings import read_settings, settings_json
from handcal.register.fuse import verified_observation
from handcal.register.prior import (
    MIN_SESSIONS,
    MIN_SITTINGS,
    LearnedPrior,
    Observed,
    PriorSettings,
    eye_prior,
    learn_prior,
    learn_wearers,
    widened,
)
from handcal.register.sitting import SittingSettings, sitting_prior
from handcal.rig.example import example_rig

MEAN_M = np.array([0.002, -0.003, 0.004, 0.001, -0.003, 0.004])
_ROOT = np.diag([0.001, 0.0015, 0.003, 0.001, 0.0015, 0.003])
COVARIANCE_M2 = _ROOT @ (np.kron(np.full((2, 2), 0.8), np.eye(3)) + 0.2 * np.eye(6)) @ _ROOT
BOTH = np.hstack([0.5 * np.eye(3), 0.5 * np.eye(3)])
EACH = [np.hstack([np.eye(3), np.zeros((3, 3))]), np.hstack([np.zeros((3, 3)), np.eye(3)])]


def _session(
    rng: np.random.Generator, seen_by: list[Float64]
) -> list[tuple[Float64, Float64, Float64]]:
    """Observe a wearer of the population with 1 mm of noise."""
    true_m = rng.multivariate_normal(MEAN_M, COVARIANCE_M2)
    noise_m2 = 0.001**2 * np.eye(3)
    return [(H, rng.multivariate_normal(H @ true_m, noise_m2), noise_m2) for H in seen_by]


def test_few_sessions_make_no_prior() -> None:
    rng = np.random.default_rng(0)
    assert learn_prior([_session(rng, EACH) for _ in range(MIN_SESSIONS - 1)]) is None


@pytest.mark.parametrize("seen_by", [EACH, [BOTH]], ids=["each", "both"])
def test_many_sessions_find_the_population(seen_by: list[Float64]) -> None:
    rng = np.random.default_rng(1)
    learned = learn_prior([_session(rng, seen_by) for _ in range(400)])
    assert learned is not None
    assert learned.sessions == 400
    covariance_m2 = np.reshape(learned.covariance_m2, (6, 6))
    # The mean of both eyes is seen either way; it must be found, with the spread among wearers.
    np.testing.assert_allclose(BOTH @ learned.mean_m, BOTH @ MEAN_M, atol=0.0004)
    seen_m = np.sqrt(np.diag(BOTH @ covariance_m2 @ BOTH.T))
    true_m = np.sqrt(np.diag(BOTH @ COVARIANCE_M2 @ BOTH.T))
    np.testing.assert_allclose(seen_m, true_m, rtol=0.2)


def test_a_learned_prior_is_a_setting_that_can_be_stored() -> None:
    rng = np.random.default_rng(3)
    settings = PriorSettings(learned=learn_prior([_session(rng, EACH) for _ in range(12)]))
    stored = json.loads(json.dumps(settings_json(settings)))
    assert read_settings(PriorSettings, stored) == settings


def test_a_moved_headset_is_uncertain_in_common_and_keeps_the_eyes_apart() -> None:
    known_m2 = 1e-8 * np.eye(6)
    prior = eye_prior(PriorSettings(learned=widened(np.arange(6.0), known_m2, (0.002, 0.001, 0.0))))
    np.testing.assert_array_equal(prior.mean_m, np.arange(6.0))
    apart = np.hstack([np.eye(3), -np.eye(3)])
    np.testing.assert_allclose(apart @ prior.covariance_m2 @ apart.T, 2e-8 * np.eye(3), atol=1e-20)
    np.testing.assert_allclose(
        np.diag(prior.covariance_m2) - 1e-8, [4e-6, 1e-6, 0.0] * 2, atol=1e-18
    )


@pytest.mark.parametrize(
    ("mean", "covariance"),
    [((0.0,) * 5, tuple(np.eye(6).ravel())), ((0.0,) * 6, tuple(-np.eye(6).ravel()))],
)
def test_a_damaged_prior_is_refused(mean: tuple[float, ...], covariance: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="prior"):
        LearnedPrior(mean, covariance, 12)


RIG = example_rig()
DEFAULT = sitting_prior(RIG, SittingSettings())
ARCMIN = np.radians(1.0 / 60.0)


def sitting(rng: np.random.Generator, error: Float64) -> list[Observed]:
    """Return four verifications of the left eye, near and far, by someone with an error."""
    shift_m = rng.multivariate_normal(np.zeros(6), eye_prior().covariance_m2)
    observed = []
    for depth_m in (0.4, 0.7, 0.4, 0.7):
        one = verified_observation(RIG, "left", (0, 0, 0), (0.0, 0.0, depth_m))
        H, _, noise_m2 = one.at(1.0)
        truth = np.concatenate([shift_m, error, np.zeros(3)])
        observed.append((H, rng.multivariate_normal(H @ truth, noise_m2), noise_m2))
    return observed


def test_constant_errors_of_people_are_found_with_their_interval() -> None:
    rng = np.random.default_rng(1)
    people = []
    for _ in range(15):
        angle = rng.uniform(0.0, 2.0 * np.pi, 20)
        people.append(
            [
                sitting(rng, np.array([6 * ARCMIN * np.cos(a), 6 * ARCMIN * np.sin(a), 0.03]))
                for a in angle
            ]
        )
    found = learn_wearers(people, DEFAULT)
    assert found is not None
    assert (found.people, found.learned.sittings) == (15, 300)
    right, down, size = found.sigma
    # 6′ in any direction are 4.2′ along each of two; the default, 1′ and 0.25 %, takes part.
    assert 3.0 < right / ARCMIN < 5.0
    assert 3.0 < down / ARCMIN < 5.0
    assert 0.015 < size < 0.035
    assert found.learned.mean[2] > 0.01
    for low, middle, high in zip(found.sigma_low, found.sigma, found.sigma_high, strict=True):
        assert low <= 1.1 * middle
        assert middle <= 1.1 * high


def test_people_without_constant_errors_have_small_ones() -> None:
    rng = np.random.default_rng(2)
    people = [[sitting(rng, np.zeros(3)) for _ in range(20)] for _ in range(15)]
    found = learn_wearers(people, DEFAULT)
    assert found is not None
    assert max(found.sigma[:2]) < 1.5 * ARCMIN


def test_few_sittings_make_no_prior() -> None:
    rng = np.random.default_rng(3)
    one = sitting(rng, np.zeros(3))
    assert learn_wearers([[one] * MIN_SITTINGS], DEFAULT) is None
    assert learn_wearers([[one]] * 6, DEFAULT) is None
