"""The prior of what wearers see wrongly, learned from sittings with known truth."""

import numpy as np

from handcal.core.types import Float64
from handcal.register.fuse import verified_observation
from handcal.register.prior import MIN_SITTINGS, Observed, eye_prior, learn_wearers
from handcal.register.sitting import SittingSettings, sitting_prior
from handcal.rig.example import example_rig

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
