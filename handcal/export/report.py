"""The report of a session: each eye's result, its uncertainty and the data behind it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handcal.core.types import (
    EYES,
    PLAN_WORDS,
    Alignment,
    Eye,
    EyeShift,
    Float64,
    Verdict,
    Verification,
)
from handcal.export import figures
from handcal.export.figures import ResidualCells
from handcal.export.outcome import SessionOutcome, printable
from handcal.export.tables import corner_rows, parameter_rows
from handcal.io.settings import settings_json
from handcal.register.benefit import BY_DISTANCE
from handcal.register.results import Results, residuals_reach_m
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.cells import (
    extremes,
    interval_ends,
    length_mm,
    mean_sd,
    median_quartiles,
    signed,
)
from handcal.report.document import (
    Column,
    Figure,
    FigureRow,
    Item,
    Report,
    Section,
    Table,
    at_minute,
    facts,
    made_with,
    settings_items,
)
from handcal.report.statistics import mean_interval
from handcal.session.drawn import ShiftKind, is_judged, result_word
from handcal.session.record import eye_trials
from handcal.session.trial import (
    Comparison,
    ErrorStatistics,
    Trial,
    calibration_numbers,
    count_comparisons,
    is_doubted,
    read_comparisons,
    summarise_trials,
)
from handcal.station.settings import StationSettings


def session_report(outcome: SessionOutcome) -> Report:
    """Return the report of a session."""
    return Report(
        title="Eye-display calibration",
        subject=f"{outcome.name} · {outcome.record.wearer or 'wearer not named'}",
        lead=_answer(outcome),
        sections=list(_sections(outcome)),
    )


def _sections(outcome: SessionOutcome) -> Iterator[Section]:
    record, results = outcome.record, outcome.results
    if results is not None:
        yield _eyes(outcome, results)
    yield _summary(outcome)
    yield _shifts(outcome)
    if any(_verifications(outcome, eye) for eye in EYES):
        yield _verifications_section(outcome)
    if results is not None:
        yield _solution(results)
        yield _distances(outcome, results)
    if results is not None and results.alignments:
        yield _alignments(outcome, results)
        yield _shift_plots(outcome, results)
        yield _convergence(results)
        yield _residuals(outcome, results)
        yield _overlays(outcome)
    if record.trials:
        yield user_test_section(outcome)
        yield trials_section(outcome)
    comparisons = read_comparisons(record.events)
    if comparisons:
        yield comparisons_section(comparisons)
    if record.notes.strip():
        yield Section("Notes", [record.notes])
    links = [event for event in record.events if event.name == "link"]
    if links:
        title = f"Link to the headset, at {at_minute(links[-1].time)}"
        yield Section(title, settings_items(links[-1].data, "journal.jsonl"))
    yield Section(
        "Settings that differ from the defaults",
        settings_items(record.settings, defaults=_default_settings()),
    )
    yield Section("Definitions", [facts(DEFINITIONS)], starts_page=True)


def _answer(outcome: SessionOutcome) -> str:
    """Return the verdict of each eye in a sentence, with its error."""
    results = outcome.results
    if results is None:
        return "Nothing is solved: the session holds no alignment."
    return " ".join(
        f"{eye.capitalize()} eye: {_verdict_text(outcome, eye, verdict)}, "
        f"{error_text(outcome, eye)}."
        for eye, verdict in results.verdicts.items()
    )


def _verdict_text(outcome: SessionOutcome, eye: Eye, verdict: Verdict) -> str:
    """Return the word for an eye, with what the trials of an accepted one say against it."""
    kind, trials = outcome.drawn[eye].kind, outcome.trials.get(eye)
    word = result_word(verdict.name, kind)
    if not is_judged(verdict.name, kind):
        return f"{word}, not judged"
    if trials is None or not is_doubted(verdict.name, trials):
        return word
    return (
        f"{word}, but wrong by {trials.mean_arcmin:.1f}′ in its trials (n = {trials.count}; "
        f"target {trials.target_arcmin:g}′)"
    )


def error_text(outcome: SessionOutcome, eye: Eye) -> str:
    """Return the error of an eye's final φ, whether it was verified, and the error before."""
    drawn = outcome.drawn[eye]
    arcmin, before = (outcome.expected_arcmin(eye, kind) for kind in (drawn.kind, "offline"))
    if arcmin is None:
        return "not solved"
    if drawn.kind == "offline":
        return f"error {arcmin:.1f}′ expected with the offline calibration"
    how = "expected"
    if outcome.is_verified(eye):
        how = "expected after the wearer's verification"
    return f"error {arcmin:.1f}′ {how}, {before:.1f}′ before"


def _eyes(outcome: SessionOutcome, results: Results) -> Section:
    """Return the answer: each eye in a row, and why it is judged so."""
    table = Table(
        [
            Column("eye", "left"),
            Column("verdict", "left"),
            Column("before, ′"),
            Column("verification found, ′"),
            Column("after, ′"),
            Column("target, ′"),
            Column("verifications"),
            Column("trials"),
            Column("final φ", "left"),
        ],
        [
            [
                eye,
                result_word(verdict.name, outcome.drawn[eye].kind),
                f"{results.benefits[eye].without_arcmin:.1f}",
                f"{verified.before_arcmin:.1f}" if (verified := results.verified.get(eye)) else "–",
                f"{outcome.expected_arcmin(eye, outcome.drawn[eye].kind):.1f}",
                f"{outcome.settings.verdict.target_arcmin:g}",
                str(len(_verifications(outcome, eye))),
                f"{trials.mean_arcmin:.1f}′, n = {trials.count}"
                if (trials := outcome.trials.get(eye))
                else "–",
                str(outcome.drawn[eye]),
            ]
            for eye, verdict in results.verdicts.items()
        ],
    )
    reasons = (
        f"{eye.capitalize()} eye{_unjudged(outcome, eye, verdict)}: "
        f"{_reason(verdict, results.eyes[eye])}."
        for eye, verdict in results.verdicts.items()
    )
    return Section("", [table, *reasons])


def _unjudged(outcome: SessionOutcome, eye: Eye, verdict: Verdict) -> str:
    """Return that the verdict on an eye is about another φ than the final one, if it is so."""
    if is_judged(verdict.name, outcome.drawn[eye].kind):
        return ""
    return f", the solved φ, which is not final ({VERDICT_WORDS[verdict.name]})"


def _verifications(outcome: SessionOutcome, eye: Eye) -> list[Verification]:
    """Return the verifications of an eye, the oldest first."""
    newest = outcome.record.facts.verified.get(eye)
    return [*newest.earlier, newest] if newest else []


def _verifications_section(outcome: SessionOutcome) -> Section:
    table = Table(
        [
            Column("eye", "left"),
            Column("no."),
            Column("moved right, ′"),
            Column("moved down, ′"),
            Column("size, %"),
            Column("φ before, mm"),
            Column("φ that fitted, mm"),
        ],
        [
            [
                eye,
                str(number),
                *(
                    signed(moved + aside, 1)
                    for moved, aside in zip(each.nudge_arcmin, each.offset_arcmin, strict=True)
                ),
                signed(100 * (each.nudge_size + each.offset_size), 1),
                *("\u00a0\u00a0".join(map(length_mm, m)) for m in (each.before_m, each.after_m)),
            ]
            for eye in EYES
            for number, each in enumerate(_verifications(outcome, eye), 1)
        ],
        "How far the wearer moved the drawing until it covered the hand, at the hand's distance. "
        "0 in all three: the wearer moved it back to where it was, or not at all.",
    )
    return Section("Verifications", [table])


def _default_settings() -> dict[str, Any]:
    """Return the settings of a session in which nothing was chosen, as they are stored."""
    station = json.loads(json.dumps(settings_json(StationSettings()), default=str))
    return {"calibration": station.pop("calibration"), "station": station}


def _summary(outcome: SessionOutcome) -> Section:
    record = outcome.record
    return Section(
        "",
        [
            facts(
                {
                    "Wearer": record.wearer or "not named",
                    "Session": outcome.name,
                    "Begun": at_minute(outcome.started),
                    "Rig": record.rig.name,
                    **({"Simulated": record.simulated} if record.simulated else {}),
                    "Plan": PLAN_WORDS[record.facts.plan],
                    "Method": outcome.settings.method,
                    "Alignments": str(len(record.alignments)),
                    "Confirmations refused": str(record.refused),
                    "Trials of the user test": str(len(record.trials)),
                    **({"Damaged": printable(record.left_out)} if record.left_out else {}),
                    **made_with(),
                }
            )
        ],
    )


def _shifts(outcome: SessionOutcome) -> Section:
    table = Table(
        [
            Column("eye", "left"),
            Column("φ", "left"),
            Column("φ₁ ± σ, mm"),
            Column("φ₂ ± σ, mm"),
            Column("φ₃ ± σ, mm"),
            Column("final"),
            Column("applied"),
        ],
        [
            [
                eye,
                kind,
                *_shift_cells(outcome, eye, kind),
                _yes(kind == outcome.drawn[eye].kind),
                _yes(outcome.is_applied(eye, kind)),
            ]
            for eye in EYES
            for kind in outcome.shifts_m[eye]
            if kind != "offline" or outcome.drawn[eye].kind == kind
        ],
    )
    items: list[Item] = [table]
    if outcome.results is None:
        items.append("There is no alignment, so nothing was solved.")
    return Section("Eye shift φ", items)


def _solution(results: Results) -> Section:
    table = Table(
        [
            Column("eye", "left"),
            Column("expected error, arcmin"),
            Column("RMS, mm"),
            Column("inliers, %"),
            Column("iterations"),
        ],
        [
            [eye, f"{results.benefits[eye].after_arcmin:.1f}", *_registered(shift)]
            for eye, shift in results.eyes.items()
        ],
    )
    depths = (f"{eye} {results.benefits[eye].depth}" for eye in results.eyes)
    items: list[Item] = [table, f"Expected error in depth: {'; '.join(depths)}."]
    if results.eye_distance_m is not None:
        items.append(f"Implied eye distance: {1e3 * results.eye_distance_m:.1f} mm.")
    return Section("How it was solved", items)


def _distances(outcome: SessionOutcome, results: Results) -> Section:
    """Return the section with the error expected at other distances than those of the verdict."""
    eyes = list(results.benefits)
    table = Table(
        [
            Column("distance, m"),
            *(Column(f"{eye}, {which}") for eye in eyes for which in ("without", "with")),
        ],
        [
            [f"{at[0].distance_m:g}", *(text for one in at for text in one.texts)]
            for at in zip(*(results.benefits[eye].by_distance for eye in eyes), strict=True)
        ],
        "Expected error, arcmin, without the calibration and with the solved φ, and the interval "
        f"that holds 95 %. {BY_DISTANCE}",
    )
    figure = Figure(
        "distances",
        "Grey: without the calibration; coloured: with the solved φ; shaded: 95 %.",
        lambda axes: figures.draw_distances(axes, results),
        list(distance_rows(results)),
        height_mm=55.0,
        columns=2,
    )
    others = [
        f"The final φ of the {eye} eye is another ({outcome.drawn[eye].kind})."
        for eye in eyes
        if outcome.drawn[eye].kind != "solved"
    ]
    return Section("Error against distance", [*others, table, figure])


def _reason(verdict: Verdict, shift: EyeShift) -> str:
    """Return why an eye is judged so, and why the solver stopped if it ran."""
    return (
        f"{verdict.reason} (registration stopped: {shift.stop_reason})"
        if shift.iterations
        else verdict.reason
    )


def _alignments(outcome: SessionOutcome, results: Results) -> Section:
    record = outcome.record
    times = {
        event.data.get("number"): event.time
        for event in record.events
        if event.name == "alignment_saved"
    }
    table = Table(
        [
            Column("no."),
            Column("time, UTC"),
            Column("eyes", "left"),
            Column("rotation,\u00a0°"),
            Column("eye", "left"),
            Column("φ₁ ± σ, mm"),
            Column("φ₂ ± σ, mm"),
            Column("φ₃ ± σ, mm"),
            Column("RMS, mm"),
            Column("inliers, %"),
            Column("iterations"),
        ],
        [
            [
                str(number),
                times.get(number, "")[11:19],
                "both" if len(alignment.eyes) == 2 else alignment.eyes[0],
                f"{np.degrees(np.linalg.norm(alignment.rotation_rad)):.1f}",
                eye,
                *_with_sigma(shift),
                *_registered(shift),
            ]
            for number, alignment in record.alignments.items()
            for eye, shift in results.alignments[number].items()
        ],
        "Each alignment solved alone, without priors; eyes: those open. One alignment with both "
        "eyes open shows one hand displacement for both; fusing shares it out between them.",
    )
    return Section("Alignments", [table])


def _shift_plots(outcome: SessionOutcome, results: Results) -> Section:
    rows = list(parameter_rows(outcome))
    return Section(
        "φ of each alignment, and fused",
        [
            Figure(
                "shifts",
                "Bars are ± σ. Hollow: the final φ, if it is not the solved one.",
                lambda axes: figures.draw_shifts(axes, outcome, results),
                rows,
                height_mm=58.0,
                columns=3,
            ),
            Figure(
                "ellipses",
                "Grey: each alignment by its number; coloured: fused. Ellipses are 1σ (39 % of "
                "cases); the cross at 0 is the viewpoint of the offline calibration.",
                lambda axes: figures.draw_ellipses(axes, results),
                rows,
                height_mm=68.0,
                columns=2,
            ),
        ],
    )


def _convergence(results: Results) -> Section:
    figure = Figure(
        "convergence",
        "Root mean square distance of the pairs at each iteration. The method consistent measures "
        "it along the surface's normals, which is less than the rms in the table.",
        lambda axes: figures.draw_convergence(axes, results),
        list(convergence_rows(results)),
        height_mm=55.0,
        columns=2,
    )
    return Section("Convergence", [figure])


def _residuals(outcome: SessionOutcome, results: Results) -> Section:
    record = outcome.record
    most_mm = 1e3 * residuals_reach_m(results)

    def draw(number: int, cells: Mapping[Eye, ResidualCells], axes: Sequence[Axes]) -> None:
        for ax, eye in zip(axes, EYES, strict=True):
            if eye in cells:
                figures.draw_residuals(ax, cells[eye], most_mm)
                ax.set_title(f"alignment {number}, {eye} eye", fontsize=8.5, loc="left", y=1.0)
            else:
                ax.remove()

    items: list[Item] = [
        "The hand as seen from the eye, in E, mm; colour: mean residual in cells of "
        f"{figures.CELL_MM:g} mm; grey: only outliers, or points that belong to a cut edge."
    ]
    for number, alignment in record.alignments.items():
        cells = {
            eye: figures.residual_cells(alignment, eye, shift)
            for eye, shift in results.alignments[number].items()
        }
        rows = list(residual_rows(number, cells))
        drawn = partial(draw, number, cells)
        items.append(Figure(f"residuals-{number}", "", drawn, rows, height_mm=66.0, columns=2))
    return Section("Residuals on the hand", items)


def _overlays(outcome: SessionOutcome) -> Section:
    """Return a section with each eye's newest alignment as seen by the eye."""
    record = outcome.record
    newest = {
        eye: (number, alignment)
        for number, alignment in record.alignments.items()
        for eye in alignment.eyes
    }
    items: list[Item] = [
        "When the wearer confirmed, the hand (filled) covered the cursor (dashed, as the headset "
        "drew it then). Before: what the offline calibration predicts for that moment. After: what "
        "the final φ predicts; the better φ is, the better they agree. Pixels; the frame is the "
        "display, beyond which nothing is drawn."
    ]
    items += [_overlay(outcome, eye, *found) for eye, found in newest.items()]
    return Section("Hand and cursor through the display", items)


def _overlay(outcome: SessionOutcome, eye: Eye, number: int, alignment: Alignment) -> Figure:
    display = outcome.record.rig.eyes[eye]
    shifts_m = {"before": np.zeros(3), "after": outcome.drawn[eye].shift_m}
    outlines = {
        when: figures.overlay_outlines(display, alignment, eye, shift_m)
        for when, shift_m in shifts_m.items()
    }

    def draw(axes: Sequence[Axes]) -> None:
        for ax, (when, found) in zip(axes, outlines.items(), strict=True):
            figures.draw_overlay(ax, display, found)
            ax.set_title(f"alignment {number}, {eye} eye, {when}", fontsize=8.5, loc="left", y=1.0)

    rows = list(overlay_rows(number, eye, outlines))
    return Figure(f"overlay-{eye}", "", draw, rows, height_mm=58.0, columns=2)


def _shift_cells(outcome: SessionOutcome, eye: Eye, kind: ShiftKind) -> list[str]:
    if kind == "solved" and outcome.results is not None:
        return _with_sigma(outcome.results.eyes[eye])
    return [length_mm(value) for value in outcome.shifts_m[eye][kind]]


def _with_sigma(shift: EyeShift) -> list[str]:
    sigma_m = np.sqrt(np.diag(shift.covariance_m2))
    return [
        f"{length_mm(value)}\u00a0±\u00a0{1e3 * sigma:.2f}"
        for value, sigma in zip(shift.shift_m, sigma_m, strict=True)
    ]


def _registered(shift: EyeShift) -> list[str]:
    """Return RMS, share of inliers and iterations; none without an alignment."""
    if not shift.residuals_m.size:
        return ["–"] * 3
    return [f"{1e3 * shift.rms_m:.2f}", f"{100 * shift.inlier_ratio:.0f}", str(shift.iterations)]


def _yes(truth: bool) -> str:
    return "yes" if truth else "no"


DEFINITIONS = {
    "φ = (φ₁, φ₂, φ₃)": (
        "Position of the wearer's eye relative to the viewpoint camera of the offline calibration: "
        "right, down and forward, along the axes of E."
    ),
    "± σ": (
        "One standard deviation, from the covariance's diagonal. For the method “consistent” it "
        "covers the registration and, if fused, how precisely people align. For an alignment by "
        "another method it is plain least squares with independent pairs, which is optimistic."
    ),
    "solved": (
        "All alignments and verifications combined, weighted by their covariances, with the prior: "
        "the size of the eye box, and how far the φ of the two eyes differ."
    ),
    "final, applied": (
        "The final φ of an eye is the one that the headset draws with, or will once it is sent: "
        "solved, offline (zero), set by hand, or earlier (of results before the newest). It is "
        "applied if the headset acknowledged it and rendered with it at the end."
    ),
    "verdict": (
        "Good: accepted. Not yet: the error is over the target, or it is not sure enough that the "
        "calibration is better than none; the headset draws with it all the same. No better than "
        "before: the offline calibration is kept. Impossible: the eye would lie where no eye is. "
        "Contradicted: camera, headset or rig speak against the result. In CSV and JSON: accept, "
        "repeat, keep, implausible, contradicted."
    ),
    "expected error": (
        "Error in the display that φ's covariance predicts: mean over the corners of an 8 cm "
        "square straight ahead at 0.4, 0.5 and 0.6 m, in arcminutes (′, a sixtieth of a degree)."
    ),
    "error in depth": (
        "Distance along the viewing direction by which an object at 0.5 m must move to cover its "
        "drawing: expected without the calibration → with it."
    ),
    "eye distance": "Distance between the two solved eyes, from φ and the rig.",
    "residual, RMS": (
        "Distance of a hand point to its partner on the cursor after registration; RMS over the "
        "inliers of all alignments."
    ),
    "inliers": (
        "Share of the hand's points whose partner is near, and not beside a cut edge such as the "
        "forearm's."
    ),
    "rotation": "Angle between the hand and the cursor at the confirmation.",
    "reprojection error": (
        "In the user test: distance in the display between a corner of the target drawn with the "
        "calibrated φ (the solved one, or 0 for an eye that keeps the offline calibration) and "
        "with the φ that was adjusted by hand until the drawn target covered the real one."
    ),
    "W, H, D": "Frames: the world, the headset's rig, the depth camera.",
    "C0, C1": "The viewpoint of the offline calibration, and the wearer's eye.",
    "E, S, V": (
        "The ideal on-axis eye-display camera at C0, the display's focal plane, and the headset's "
        "rendering camera. Axes: x right, y down, z forward."
    ),
    "method": (
        "Hu, Rodriguez y Baena, Cutolo: Rotation-constrained optical see-through headset "
        "calibration with bare-hand alignment. ISMAR 2021. “paper” is its solver as published; "
        "“linear” the same model with all equations of each pair; “consistent” the exact model, "
        "robust to cut edges and a rotated hand; “icp” the rigid baseline."
    ),
}


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


def user_test_section(outcome: SessionOutcome) -> Section:
    """Return the errors of all trials together, by eye and by distance."""
    record = outcome.record
    statistics = summarise_trials(record.trials.values())
    groups = {"all": statistics.total} if statistics.total else {}
    groups |= {f"{eye} eye": errors for eye, errors in statistics.by_eye.items()}
    groups |= {f"at {depth_m:g} m": errors for depth_m, errors in statistics.by_depth_m.items()}
    table = Table(
        [
            Column("trials", "left"),
            Column("number"),
            Column("corners"),
            Column("mean ± SD, px"),
            Column("mean ± SD, arcmin"),
            Column("median (quartiles), arcmin"),
            Column("min–max, arcmin"),
        ],
        [[name, *_error_cells(errors)] for name, errors in groups.items()],
        "Reprojection error; each corner of the target counts once.",
    )
    boxes = Figure(
        "trial-errors",
        "Boxes: quartiles and median; whiskers: the farthest within 1.5 interquartile ranges.",
        lambda axes: figures.draw_trial_errors(axes, record.trials.values()),
        list(corner_rows(record.trials)),
        height_mm=62.0,
        columns=2,
    )
    running = Figure(
        "running-mean",
        "Points: mean error of each trial; lines: mean of all so far.",
        lambda axes: figures.draw_running_mean(axes[0], record.trials),
        list(running_mean_rows(record.trials)),
        height_mm=48.0,
    )
    return Section("User test", [table, _interval(outcome), boxes, running])


def _interval(outcome: SessionOutcome) -> str:
    """Return sentences on the calibrations that were tried and the uncertainty of the mean."""
    trials = outcome.record.trials
    calibrations = list(calibration_numbers(trials).values())
    judged = eye_trials(outcome.results, outcome.record, math.inf) if outcome.results else {}
    former = len(trials) - sum(one.count for one in judged.values())
    said = (
        f"{former} of {len(trials)} trials judge an earlier φ than the result. " if former else ""
    )
    if len(set(calibrations)) < 2:
        return said + (
            "All trials judge one calibration, so how far another would differ is not known: no "
            "interval is given for the mean."
        )
    errors = [float(trial.error_arcmin.mean()) for trial in trials.values()]
    found = mean_interval(errors, calibrations)
    return said + (
        f"Mean over {found.clusters} calibrations of this wearer: {found.mean:.2f} arcmin "
        f"({100 * found.level:g} % interval {interval_ends(found)})."
    )


def trials_section(outcome: SessionOutcome) -> Section:
    """Return each trial with its two φ and its error."""
    record = outcome.record
    table = Table(
        [
            Column("no."),
            Column("time, UTC"),
            Column("eye", "left"),
            Column("distance, m"),
            Column("calibrated φ, mm"),
            Column("adjusted φ, mm"),
            Column("mean error, px"),
            Column("mean error, arcmin"),
        ],
        [
            [
                str(number),
                trial.time[11:19],
                trial.eye,
                f"{trial.target_depth_m:g}",
                "\u00a0\u00a0".join(map(length_mm, trial.calibrated_shift_m)),
                "\u00a0\u00a0".join(map(length_mm, trial.adjusted_shift_m)),
                f"{trial.error_px.mean():.2f}",
                f"{trial.error_arcmin.mean():.2f}",
            ]
            for number, trial in record.trials.items()
        ],
    )
    return Section("Trials", [table])


def comparisons_section(comparisons: Sequence[Comparison]) -> Section:
    """Return the answers of the blinded comparisons, and their sign test."""
    counts = count_comparisons(comparisons)
    table = Table(
        [
            Column("time, UTC"),
            Column("shown first", "left"),
            Column("answer", "left"),
            Column("better", "left"),
        ],
        [[one.time[11:19], one.first, one.answer, one.better or "neither"] for one in comparisons],
        "offline: without the calibration; applied: with it. The order was drawn by lot, and "
        "neither wearer nor technician knew it.",
    )
    sentence = (
        f"Better with the calibration: {counts.applied}; without it: {counts.offline}; neither: "
        f"{counts.neither}. Two-sided sign test of this wearer's answers: p = {counts.p_value:.3f}."
    )
    return Section("Blinded comparison", [sentence, table])


def _error_cells(errors: ErrorStatistics) -> list[str]:
    return [
        str(errors.trials),
        str(errors.corners),
        mean_sd(errors.px),
        mean_sd(errors.arcmin),
        median_quartiles(errors.arcmin),
        extremes(errors.arcmin),
    ]
