import json

import numpy as np
import pytest

from handcal.core.types import Float64
from handcal.io.settings import read_settings, settings_json
from handcal.register.prior import (
    MIN_SESSIONS,
    LearnedPrior,
    PriorSettings,
    eye_prior,
    learn_prior,
    posterior,
    widened,
)

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


def test_the_default_has_eyes_in_the_box_that_differ_little() -> None:
    prior = eye_prior()
    assert prior.sessions == 0
    np.testing.assert_array_equal(prior.mean_m, np.zeros(6))
    apart = np.hstack([-np.eye(3), np.eye(3)])
    apart_m2 = apart @ prior.covariance_m2 @ apart.T
    assert (np.sqrt(np.diag(apart_m2)) < PriorSettings().eye_difference_sigma_m).all()
    assert (np.diag(prior.covariance_m2) < PriorSettings().eye_box_sigma_m ** 2).all()


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


def test_thirty_sessions_predict_the_next_wearer_better_than_the_default() -> None:
    rng = np.random.default_rng(2)
    learned = learn_prior([_session(rng, [BOTH]) for _ in range(30)])
    lab, default = eye_prior(PriorSettings(learned=learned)), eye_prior()
    assert lab.sessions == 30
    errors_m = []
    for _ in range(300):
        true_m = rng.multivariate_normal(MEAN_M, COVARIANCE_M2)
        noise_m2 = 0.003**2 * np.eye(3)
        seen = BOTH, rng.multivariate_normal(BOTH @ true_m, noise_m2), noise_m2
        errors_m.append(
            [np.linalg.norm(posterior(prior, [seen])[0] - true_m) for prior in (lab, default)]
        )
    with_lab_m, with_default_m = np.mean(errors_m, axis=0)
    assert with_lab_m < 0.85 * with_default_m


def test_without_observations_the_posterior_is_the_prior() -> None:
    prior = eye_prior()
    mean_m, covariance_m2 = posterior(prior, [])
    np.testing.assert_allclose(mean_m, prior.mean_m, atol=1e-15)
    np.testing.assert_allclose(covariance_m2, prior.covariance_m2, rtol=1e-9, atol=1e-18)


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
