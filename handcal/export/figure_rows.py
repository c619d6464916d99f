"""The raw data of the session report's figures; those of φ and trials are in `tables`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from handcal.core.types import Eye, Float64
from handcal.export.figures import ResidualCells
from handcal.register.results import Results
from handcal.report.document import FigureRow
from handcal.session.trial import Trial


def convergence_rows(results: Results) -> Iterator[FigureRow]:
    """Yield a row for every iteration of every alignment and eye."""
    for number, shifts in results.alignments.items():
        for eye, shift in shifts.items():
            for iteration, rms_m in enumerate(np.sqrt(shift.history_m2), 1):
                yield {
                    "alignment": number,
                    "eye": eye,
                    "iteration": iteration,
                    "rms_mm": 1e3 * float(rms_m),
                }


def distance_rows(results: Results) -> Iterator[FigureRow]:
    """Yield a row for every eye and distance of the error against distance."""
    for eye, benefit in results.benefits.items():
        for one in benefit.by_distance:
            yield {"eye": eye, **asdict(one)}


def residual_rows(number: int, cells: Mapping[Eye, ResidualCells]) -> Iterator[FigureRow]:
    """Yield a row for every cell of an alignment's residual maps."""
    for eye, of_eye in cells.items():
        for x_mm, y_mm, points, inliers, mean_mm in zip(
            of_eye.x_mm, of_eye.y_mm, of_eye.points, of_eye.inliers, of_eye.mean_mm, strict=True
        ):
            yield {
                "alignment": number,
                "eye": eye,
                "x_mm": float(x_mm),
                "y_mm": float(y_mm),
                "points": int(points),
                "inliers": int(inliers),
                "mean_residual_mm": float(mean_mm) if inliers else None,
            }


def overlay_rows(
    number: int, eye: Eye, outlines: Mapping[str, Mapping[str, Sequence[Float64]]]
) -> Iterator[FigureRow]:
    """Yield a row for every corner of the outlines, by calibration and object."""
    for when, of_what in outlines.items():
        for what, closed in of_what.items():
            for place, outline in enumerate(closed, 1):
                for x_px, y_px in outline.tolist():
                    yield {
                        "alignment": number,
                        "eye": eye,
                        "calibration": when,
                        "of": what,
                        "outline": place,
                        "x_px": x_px,
                        "y_px": y_px,
                    }


def running_mean_rows(trials: Mapping[int, Trial]) -> Iterator[FigureRow]:
    """Yield a row for every trial, with the mean of the eye's trials so far."""
    errors: dict[Eye, list[float]] = {}
    for number, trial in trials.items():
        so_far = errors.setdefault(trial.eye, [])
        so_far.append(float(trial.error_arcmin.mean()))
        yield {
            "trial": number,
            "eye": trial.eye,
            "mean_arcmin": so_far[-1],
            "mean_so_far_arcmin": float(np.mean(so_far)),
        }
