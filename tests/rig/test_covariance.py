import numpy as np

from handcal.rig.covariance import clustered_covariance


def test_a_mean_of_groups_that_err_together_is_known_as_well_as_the_groups() -> None:
    rng = np.random.default_rng(1)
    groups, each = 30, 50
    group = np.repeat(np.arange(groups), each)
    J = np.ones((groups * each, 1))
    told, actual = [], []
    for _ in range(100):
        errors = rng.normal(0.0, 1.0, groups)[group]
        mean = errors.mean()
        told.append(clustered_covariance(J, errors - mean, group)[0, 0])
        actual.append(mean**2)
    assert 0.7 < np.mean(told) * groups < 1.3
    assert 0.6 < np.mean(actual) / np.mean(told) < 1.6


def test_groups_that_do_not_err_together_give_the_usual_covariance() -> None:
    rng = np.random.default_rng(2)
    J = rng.normal(size=(4000, 2))
    residuals = rng.normal(0.0, 0.5, 4000)
    usual = 0.25 * np.linalg.inv(J.T @ J)
    found = clustered_covariance(J, residuals, np.arange(4000) // 4)
    np.testing.assert_allclose(np.diag(found), np.diag(usual), rtol=0.1)
