import numpy as np

from handcal.rig.least_squares import marginal_covariance


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
