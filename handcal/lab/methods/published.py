"""Published results of these methods, as collected by Hu et al. 2021 (their tables 2 and 3).

Conditions differ between studies: displays, distances, users and what counts as truth.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PublishedReprojection:
    """Reprojection error in arcmin: median, quartiles, extremes."""

    study: str
    median: float
    q1: float
    q3: float
    min: float
    max: float


@dataclass(frozen=True, slots=True)
class PublishedMisalignment:
    """Misalignment at arm's reach, each as "mean ± sd" where given."""

    study: str
    alignments: str
    x_mm: str = "–"
    y_mm: str = "–"
    z_mm: str = "–"
    across_mm: str = "–"
    across_arcmin: str = "–"
    """Combined error in x and y."""
    rotation_deg: str = "–"
    whole_mm: str = ""
    """Total error, where components are not given."""


REPROJECTION = (
    PublishedReprojection("Hu et al. 2021, rcICP, 1", 10.87, 8.18, 13.18, 5.55, 17.16),
    PublishedReprojection("Itoh & Klinker 2014, SPAAM", 11.76, 10.25, 13.26, 7.11, 16.67),
    PublishedReprojection("Itoh & Klinker 2014, INDICA", 14.49, 12.10, 16.08, 10.42, 17.32),
    PublishedReprojection("Moser & Swan 2016, stylus, 25", 9.57, 6.13, 14.80, 0.66, 13.09),
    PublishedReprojection("Moser & Swan 2016, finger, 25", 16.98, 10.83, 25.51, 0.93, 46.87),
)
"""The row on SPAAM is in the paper's source but not in its table. The stylus's third quartile is
above its maximum, as printed."""

MISALIGNMENT = (
    PublishedMisalignment(
        *("Hu et al. 2021", "1, hand", "0.85 ± 0.52", "0.88 ± 0.53", "2.85 ± 2.03"),
        *("1.37 ± 0.42", "8.81 ± 2.69", "1.76 ± 0.99"),
    ),
    PublishedMisalignment(
        *("Azimi et al. 2017", "4 × 5, cube", "0.94 ± 0.74", "0.83 ± 0.63", "3.51 ± 2.67"),
    ),
    PublishedMisalignment("Guo et al. 2019", "5, box", rotation_deg="5.42", whole_mm="6.83"),
    PublishedMisalignment("Jun & Kim 2016", "8, fingertip", whole_mm="about 10"),
)
"""Measured with cameras or users; not all of the same quantity."""
