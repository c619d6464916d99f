"""The report of a session: each eye's result, its uncertainty and the data behind it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handcal.core.types import EYES, Alignment, Eye, EyeShift, Verdict, Verification
from handcal.export import figures
from handcal.export.definitions import DEFINITIONS
from handcal.export.figure_rows import (
    convergence_rows,
    distance_rows,
    overlay_rows,
    residual_rows,
)
from handcal.export.figures import ResidualCells
from handcal.export.outcome import SessionOutcome, printable
from handcal.export.tables import parameter_rows
from handcal.export.trial_sections import (
    comparisons_section,
    trials_section,
    user_test_section,
)
from handcal.io.settings import settings_json
from handcal.register.benefit import BY_DISTANCE
from handcal.register.results import Results
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.cells import length_mm, signed
from handcal.report.document import Column, Figure, Item, Report, Section, Table, facts
from handcal.report.provenance import at_minute, made_with, settings_items
from handcal.session.comparison import read_comparisons
from handcal.session.drawn import ShiftKind
from handcal.session.judged_trials import EyeTrials, is_doubted
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
        yield _distances(results)
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
        f"{eye.capitalize()} eye: {verdict_text(verdict, outcome.trials.get(eye))}, "
        f"{error_text(outcome, eye)}."
        for eye, verdict in results.verdicts.items()
    )


def verdict_text(verdict: Verdict, trials: EyeTrials | None) -> str:
    """Return the word of a verdict, with what the trials of an accepted eye say against it."""
    word = VERDICT_WORDS[verdict.name]
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
    is_verified = (
        outcome.results is not None
        and eye in outcome.results.verified
        and eye in outcome.record.verified_now
    )
    how = "verified by the wearer" if is_verified and drawn.kind == "solved" else "expected"
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
                VERDICT_WORDS[verdict.name],
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
        f"{eye.capitalize()} eye: {_reason(verdict, results.eyes[eye])}."
        for eye, verdict in results.verdicts.items()
    )
    return Section("", [table, *reasons])


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
                    "Plan": record.facts.plan or "not recorded",
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


def _distances(results: Results) -> Section:
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
        "Expected error, arcmin, without the calibration and with it, and the interval that holds "
        f"95 %. {BY_DISTANCE}",
    )
    figure = Figure(
        "distances",
        "Grey: without the calibration; coloured: with it; shaded: 95 %.",
        lambda axes: figures.draw_distances(axes, results),
        list(distance_rows(results)),
        height_mm=55.0,
        columns=2,
    )
    return Section("Error against distance", [table, figure])


def _reason(verdict: Verdict, shift: EyeShift) -> str:
    """Return why an eye is judged so, and why the solver stopped if it ran."""
    return (
        f"{verdict.reason} (stopped: {shift.stop_reason})" if shift.iterations else verdict.reason
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
    residuals_m = [
        shift.residuals_m for each in results.alignments.values() for shift in each.values()
    ]
    most_mm = 1e3 * float(np.nanpercentile(np.concatenate(residuals_m), 98))

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
