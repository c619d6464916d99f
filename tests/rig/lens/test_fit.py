import numpy as np

from handcal.rig.lens.fit import clustered_covariance, marginal_covariance


def test_it_is_the_shared_part_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(1)
    blocks = [(rng.normal(size=(30, 3)), rng.normal(size=(30, 2))) for _ in range(4)]
    whole = np.zeros((120, 3 + 8))
    for number, (shared, own) in enumerate(blocks):
        rows = slice(30 * number, 30 * (number + 1))
        whole[rows, :3] = shared
        whole[rows, 3 + 2 * number : 5 + 2 * number] = own
    residuals = rng.normal(size=120)
    variance = residuals @ residuals / (120 - 11)
    expected = variance * np.linalg.inv(whole.T @ whole)[:3, :3]
    covariance = marginal_covariance(blocks, residuals)
    np.testing.assert_allclose(covariance, expected, rtol=1e-9)  # type: ignore[arg-type]


def test_parameters_that_the_views_do_not_determine_have_none() -> None:
    rng = np.random.default_rng(1)
    own = rng.normal(size=(30, 2))
    same = rng.normal(size=(30, 1))
    assert marginal_covariance([(np.hstack([same, same]), own)], np.ones(30)) is None
    assert marginal_covariance([(np.zeros((30, 1)), own)], np.ones(30)) is None


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
