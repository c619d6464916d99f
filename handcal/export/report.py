"""The report of a session: each eye's result, its uncertainty and the data behind it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from handcal.core.types import EYES, Alignment, Eye, EyeShift, Verdict, VerdictName
from handcal.export import figures
from handcal.export.definitions import DEFINITIONS
from handcal.export.figure_rows import (
    convergence_rows,
    distance_rows,
    overlay_rows,
    residual_rows,
)
from handcal.export.figures import ResidualCells
from handcal.export.outcome import SessionOutcome, ShiftOrigin, printable
from handcal.export.tables import parameter_rows
from handcal.export.trial_sections import (
    comparisons_section,
    trials_section,
    user_test_section,
)
from handcal.register.benefit import BY_DISTANCE
from handcal.register.results import Results
from handcal.report.cells import length_mm
from handcal.report.document import (
    Column,
    Figure,
    Item,
    Report,
    Section,
    Table,
    at_minute,
    facts,
    made_with,
    settings_items,
)
from handcal.session.comparison import read_comparisons
from handcal.session.judged_trials import EyeTrials, eye_trials, is_doubted

_ORIGINS: Mapping[ShiftOrigin, str] = {
    "fine_tuned": "fine-tuned by hand",
    "solved": "as solved",
    "offline": "offline calibration",
}
_VERDICTS: Mapping[VerdictName, str] = {
    "accept": "accepted",
    "repeat": "not accepted yet",
    "keep": "offline calibration kept",
    "implausible": "implausible",
    "contradicted": "contradicted",
}


def session_report(outcome: SessionOutcome) -> Report:
    """Return the report of a session."""
    return Report(
        title="Eye-display calibration",
        subject=f"{outcome.name} · {outcome.record.wearer or 'wearer not named'}",
        lead=_verdict(outcome),
        sections=list(_sections(outcome)),
    )


def _sections(outcome: SessionOutcome) -> Iterator[Section]:
    record, results = outcome.record, outcome.results
    yield _summary(outcome)
    yield _shifts(outcome)
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
    yield Section("Settings", settings_items(record.settings))
    yield Section("Definitions", [facts(DEFINITIONS)], starts_page=True)


def _verdict(outcome: SessionOutcome) -> str:
    """Return the verdict in one sentence, with what contradicts it in the trials."""
    if outcome.results is None:
        return "Nothing is solved: the session holds no alignment."
    trials = eye_trials(outcome.results, outcome.record, outcome.settings.verdict.target_arcmin)
    parts = [
        f"{eye} eye {_VERDICTS[verdict.name]}{_doubt(verdict, trials.get(eye))}: {verdict.reason}"
        for eye, verdict in outcome.results.verdicts.items()
    ]
    set_since = [eye for eye in EYES if outcome.final(eye) == "fine_tuned"]
    by_hand = outcome.record.set_by_hand_m
    for how, eyes in (
        ("fine-tuned by hand since", [eye for eye in set_since if eye in by_hand]),
        ("set to another φ since, by going back", [eye for eye in set_since if eye not in by_hand]),
    ):
        if eyes:
            parts.append(f"{' and '.join(eyes)} {how}")
    sentence = "; ".join(parts)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _doubt(verdict: Verdict, trials: EyeTrials | None) -> str:
    """Return that an accepted eye's trials are over the lab's target; empty for others."""
    if trials is None or not is_doubted(verdict.name, trials):
        return ""
    return (
        f", but wrong by {trials.mean_arcmin:.1f} arcmin in its trials (n = {trials.count}), over "
        f"the lab's target of {trials.target_arcmin:g} arcmin"
    )


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
                _ORIGINS[origin],
                *_shift_cells(outcome, eye, origin),
                _yes(outcome.final(eye) == origin),
                _yes(outcome.is_applied(eye, origin)),
            ]
            for eye in EYES
            for origin in outcome.shifts_m[eye]
            if origin != "offline" or outcome.final(eye) == origin
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
            Column("verdict", "left"),
            Column("expected error, arcmin"),
            Column("RMS, mm"),
            Column("inliers, %"),
            Column("iterations"),
            Column("reason", "left"),
        ],
        [
            [
                eye,
                results.verdicts[eye].name,
                f"{results.benefits[eye].after_arcmin:.1f}",
                *_registered(shift),
                _reason(results.verdicts[eye], shift),
            ]
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
                "Bars are ± σ. Hollow: set by hand, if there is one.",
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
    shifts_m = {"before": np.zeros(3), "after": outcome.final_shift_m(eye)}
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


def _shift_cells(outcome: SessionOutcome, eye: Eye, origin: ShiftOrigin) -> list[str]:
    if origin == "solved" and outcome.results is not None:
        return _with_sigma(outcome.results.eyes[eye])
    return [length_mm(value) for value in outcome.shifts_m[eye][origin]]


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
