"""σ on real clouds: one frame twice, with other pixels, so φ is known and no wearer errs."""

from pathlib import Path

import numpy as np
import pytest
from scipy.special import chdtri

from tests.register.real_clouds import halves, read_clouds, solve_overlaid, squared_error


@pytest.mark.parametrize(
    ("name", "every", "median_m"), [("color_aligned_640", 3, 0.0002), ("sr300_320", 2, 0.0005)]
)
def test_disjoint_samples_of_one_real_frame(
    shared_data: Path, name: str, every: int, median_m: float
) -> None:
    """Squared errors over the covariance are below 3: both samples share the sensor's errors.

    A hand that says little about one direction may err by more than 1 mm, and says so in its
    covariance, so only the median is judged in metres.
    """
    squares, errors_m = [], []
    clouds = read_clouds(shared_data / "rgbd" / name, every)
    for number, (_, cloud) in enumerate(clouds):
        for seed in range(3):
            rng = np.random.default_rng([number, seed])
            phi_m = rng.uniform(-0.008, 0.008, 3)
            solved = solve_overlaid(phi_m, cloud[0], *halves(rng, cloud))
            squares.append(squared_error(solved, phi_m))
            errors_m.append(float(np.linalg.norm(solved.shift_m - phi_m)))
    assert np.mean(squares) < 4.5
    assert max(squares) < chdtri(3, 1e-4)
    assert np.median(errors_m) < median_m
