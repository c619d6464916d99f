"""The PDF report: what was found for each eye, how sure it is, and what it was found from."""

from __future__ import annotations

import io
import platform
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from handcal.export import figures
from handcal.export.definitions import DEFINITIONS
from handcal.export.outcome import Origin, Outcome
from handcal.files import write_atomic
from handcal.register.verdict import expected_error_arcmin
from handcal.report.page import Column, Document, plain
from handcal.results import Results
from handcal.trial import ErrorStatistics, summarise
from handcal.types import EYES, Alignment, Eye, EyeShift, VerdictName

if TYPE_CHECKING:
    from typing_extensions import Buffer

_ORIGINS: Mapping[Origin, str] = {
    "fine_tuned": "fine-tuned by hand",
    "solved": "as solved",
    "offline": "offline calibration",
}
_VERDICTS: Mapping[VerdictName, str] = {
    "accept": "accepted",
    "repeat": "to be aligned again",
    "implausible": "implausible",
}
# More settings than these are left to settings.json.
_MAX_SETTINGS = 120


def write_report(path: Path, outcome: Outcome, checkpoint: Callable[[float], None]) -> None:
    """Write the report as PDF, A4, with its fonts.

    Parameters
    ----------
    path : Path
    outcome : Outcome
    checkpoint : callable
        Told the share done, many times a second; what it raises ends the writing.
    """
    pages = compose(outcome, lambda share: checkpoint(0.4 * share))
    stream = _CheckedStream(checkpoint, 0.4)
    # TrueType rather than Type 3, which publishers refuse; pictures at 200 dots an inch.
    with matplotlib.rc_context({"pdf.fonttype": 42, "savefig.dpi": 200}):
        pdf: Any = PdfPages(stream, metadata=_metadata(outcome))
        for done, page in enumerate(pages):
            stream.share = 0.4 + 0.5 * done / len(pages)
            pdf.savefig(page)
        stream.share = 0.9
        pdf.close()  # not after an error: it would go on writing
    write_atomic(path, stream.getvalue())


def compose(outcome: Outcome, checkpoint: Callable[[float], None]) -> list[Figure]:
    """Return the report's pages; arguments as `write_report`."""
    document = Document(f"{outcome.name} · {outcome.record.wearer or 'wearer not named'}")
    sections = list(_sections(document, outcome))
    for done, section in enumerate(sections):
        checkpoint(done / len(sections))
        section()
    return document.finish()


class _CheckedStream(io.BytesIO):
    """Bytes whose every writing is a checkpoint: matplotlib works for long between two pages."""

    def __init__(self, checkpoint: Callable[[float], None], share: float) -> None:
        super().__init__()
        self.share = share
        self._checkpoint = checkpoint

    def write(self, data: Buffer, /) -> int:
        self._checkpoint(self.share)
        return super().write(data)


def _sections(document: Document, outcome: Outcome) -> Iterator[Callable[[], None]]:
    """Yield what sets each part of the report, in order; none takes long."""
    results = outcome.results
    yield lambda: _summary(document, outcome)
    if results is not None:
        yield lambda: _alignments(document, outcome, results)
        yield lambda: _shift_plots(document, outcome, results)
        yield lambda: _convergence(document, outcome, results)
        yield from _residuals(document, outcome, results)
        yield from _overlays(document, outcome)
    if outcome.record.trials:
        yield lambda: _user_test(document, outcome)
        yield lambda: _running_mean(document, outcome)
        yield lambda: _trials(document, outcome)
    if outcome.record.notes.strip():
        yield lambda: _notes(document, outcome.record.notes)
    yield lambda: _conditions(document, outcome)
    yield lambda: _definitions(document)


def _summary(document: Document, outcome: Outcome) -> None:
    record, results = outcome.record, outcome.results
    document.title("Eye-display calibration")
    document.text(_verdict(outcome), points=11.0)
    document.space(4.0)
    facts = {
        "Wearer": record.wearer or "not named",
        "Session": outcome.name,
        "Begun": _time(outcome.started),
        "Rig": record.rig.name,
        "Method": outcome.settings.method,
        "Alignments": str(len(record.alignments)),
        "Confirmations refused": str(sum(event.name == "refused" for event in record.events)),
        "Trials of the user test": str(len(record.trials)),
        "Made with": f"handcal {version('handcal')}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, on {platform.system()} {platform.machine()}",
        "Made at": _time(datetime.now(UTC).isoformat()),
    }
    document.table([Column(align="left"), Column(align="left")], list(facts.items()))
    document.heading("Eye shift φ")
    document.table(
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
    if results is None:
        document.text("There is no alignment, so nothing was solved.")
        return
    document.heading("How it was solved")
    document.table(
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
                f"{expected_error_arcmin(record.rig.eyes[eye], shift):.1f}",
                f"{1e3 * shift.rms_m:.2f}",
                f"{100 * shift.inlier_ratio:.0f}",
                str(shift.iterations),
                f"{results.verdicts[eye].reason} (stopped: {shift.stop_reason})",
            ]
            for eye, shift in results.shifts.items()
        ],
    )
    if results.eye_distance_m is not None:
        document.text(f"Implied eye distance: {1e3 * results.eye_distance_m:.1f} mm.")


def _verdict(outcome: Outcome) -> str:
    """Return the verdict in one sentence."""
    if outcome.results is None:
        return "Nothing is solved: the session holds no alignment."
    parts = [
        f"{eye} eye {_VERDICTS[verdict.name]}: {verdict.reason}"
        for eye, verdict in outcome.results.verdicts.items()
    ]
    tuned = [eye for eye in EYES if outcome.final(eye) == "fine_tuned"]
    if tuned:
        parts.append(f"{' and '.join(tuned)} fine-tuned by hand since")
    sentence = "; ".join(parts)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _shift_cells(outcome: Outcome, eye: Eye, origin: Origin) -> list[str]:
    if origin == "solved" and outcome.results is not None:
        return _with_sigma(outcome.results.shifts[eye])
    return [_mm(value) for value in outcome.shifts_m[eye][origin]]


def _alignments(document: Document, outcome: Outcome, results: Results) -> None:
    record = outcome.record
    times = {
        event.data.get("number"): event.time
        for event in record.events
        if event.name == "alignment_saved"
    }
    document.heading("Alignments")
    document.table(
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
                f"{1e3 * shift.rms_m:.2f}",
                f"{100 * shift.inlier_ratio:.0f}",
                str(shift.iterations),
            ]
            for number, alignment, shifts in zip(
                record.alignment_numbers, record.alignments, results.alignments, strict=True
            )
            for eye, shift in shifts.items()
        ],
    )
    document.caption(
        "Each alignment solved alone, without priors; eyes: those open. One alignment with both "
        "eyes open shows one hand displacement for both; fusing shares it out between them."
    )


def _shift_plots(document: Document, outcome: Outcome, results: Results) -> None:
    numbers = outcome.record.alignment_numbers
    document.heading("φ of each alignment, and fused", room_mm=75.0)
    figures.draw_shifts(document.axes(58.0, 3), outcome, results)
    document.caption("Bars are ± σ. Tuned: set by hand, hollow, where there is one.")
    figures.draw_ellipses(document.axes(68.0, 2), numbers, results)
    document.caption(
        "Grey: each alignment by its number; coloured: fused. Ellipses are 1σ (39 % of cases); the "
        "cross at 0 is the viewpoint of the offline calibration."
    )


def _convergence(document: Document, outcome: Outcome, results: Results) -> None:
    document.heading("Convergence", room_mm=70.0)
    figures.draw_convergence(document.axes(55.0, 2), outcome.record.alignment_numbers, results)
    document.caption("Root mean square distance of the pairs at each iteration.")


def _residuals(
    document: Document, outcome: Outcome, results: Results
) -> Iterator[Callable[[], None]]:
    record = outcome.record
    residuals_m = [shift.residuals_m for each in results.alignments for shift in each.values()]
    most_mm = 1e3 * float(np.nanpercentile(np.concatenate(residuals_m), 98))

    def draw(index: int) -> None:
        number, alignment = record.alignment_numbers[index], record.alignments[index]
        axes = document.axes(66.0, 2)
        for ax, eye in zip(axes, EYES, strict=True):
            if eye in results.alignments[index]:
                shift = results.alignments[index][eye]
                figures.draw_residuals(ax, alignment, eye, shift, most_mm)
                ax.set_title(f"alignment {number}, {eye} eye", fontsize=8.5, loc="left")
            else:
                ax.remove()

    yield lambda: document.heading("Residuals on the hand", room_mm=80.0)
    for index in range(len(results.alignments)):
        yield partial(draw, index)
    yield lambda: document.caption(
        "The hand as the eye faces it, in E, mm; colour: mean residual in cells of 2.5 mm; grey: "
        "only outliers, or points that belong to a cut edge."
    )


def _overlays(document: Document, outcome: Outcome) -> Iterator[Callable[[], None]]:
    """Yield what draws each eye's newest alignment."""
    record = outcome.record
    newest = {
        eye: (number, alignment)
        for number, alignment in zip(record.alignment_numbers, record.alignments, strict=True)
        for eye in alignment.eyes
    }

    def draw(eye: Eye, number: int, alignment: Alignment) -> None:
        shifts_m = {"before": np.zeros(3), "after": outcome.final_shift_m(eye)}
        for ax, (when, shift_m) in zip(document.axes(58.0, 2), shifts_m.items(), strict=True):
            figures.draw_overlay(ax, record.rig.eyes[eye], alignment, eye, shift_m)
            ax.set_title(f"alignment {number}, {eye} eye, {when}", fontsize=8.5, loc="left")

    yield lambda: document.heading("Hand and cursor through the display", room_mm=75.0)
    for eye, (number, alignment) in newest.items():
        yield partial(draw, eye, number, alignment)
    yield lambda: document.caption(
        "When the wearer confirmed, the hand (filled) covered the cursor (dashed, as the headset "
        "drew it then). Before: what the offline calibration predicts for that moment. After: what "
        "the final φ predicts; the better φ is, the better they agree. Pixels; the frame is the "
        "display, beyond which nothing is drawn."
    )


def _user_test(document: Document, outcome: Outcome) -> None:
    record = outcome.record
    statistics = summarise(record.trials)
    document.heading("User test")
    groups = {"all": statistics.total} if statistics.total else {}
    groups |= {f"{eye} eye": errors for eye, errors in statistics.by_eye.items()}
    groups |= {f"at {depth_m:g} m": errors for depth_m, errors in statistics.by_depth_m.items()}
    document.table(
        [
            Column("trials", "left"),
            Column("number"),
            Column("corners"),
            Column("mean ± SD, px"),
            Column("median (min–max), px"),
            Column("mean ± SD, arcmin"),
            Column("median (min–max), arcmin"),
        ],
        [[name, *_error_cells(errors)] for name, errors in groups.items()],
    )
    document.caption("Reprojection error; each corner of the target counts once.")
    figures.draw_trial_errors(document.axes(62.0, 2), record.trials)
    document.caption(
        "Boxes: quartiles and median; whiskers: the farthest within 1.5 interquartile ranges."
    )


def _running_mean(document: Document, outcome: Outcome) -> None:
    record = outcome.record
    figures.draw_running_mean(document.axes(48.0, 1)[0], record.trial_numbers, record.trials)
    document.caption("Points: mean error of each trial; lines: mean of all so far.")


def _trials(document: Document, outcome: Outcome) -> None:
    record = outcome.record
    document.heading("Trials", room_mm=30.0)
    document.table(
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
                "\u00a0\u00a0".join(map(_mm, trial.calibrated_shift_m)),
                "\u00a0\u00a0".join(map(_mm, trial.adjusted_shift_m)),
                f"{trial.error_px.mean():.2f}",
                f"{trial.error_arcmin.mean():.2f}",
            ]
            for number, trial in zip(record.trial_numbers, record.trials, strict=True)
        ],
    )


def _error_cells(errors: ErrorStatistics) -> list[str]:
    return [
        str(errors.trials),
        str(errors.corners),
        *(
            cell
            for spread in (errors.px, errors.arcmin)
            for cell in (
                f"{spread.mean:.2f} ± {spread.sd:.2f}",
                f"{spread.median:.2f} ({spread.min:.2f}–{spread.max:.2f})",
            )
        ),
    ]


def _notes(document: Document, notes: str) -> None:
    document.heading("Notes")
    document.text(notes)


def _conditions(document: Document, outcome: Outcome) -> None:
    record = outcome.record
    columns = Column(align="left"), Column(align="left")
    links = [event for event in record.events if event.name == "link"]
    if links:
        document.heading(f"Link to the headset, at {_time(links[-1].time)}")
        document.table(columns, _flat(links[-1].data)[:_MAX_SETTINGS])
    settings = _flat(record.settings)
    document.heading("Settings")
    document.table(columns, settings[:_MAX_SETTINGS])
    if len(settings) > _MAX_SETTINGS:
        document.text(f"and {len(settings) - _MAX_SETTINGS:,} more, in the session's settings.json")


def _definitions(document: Document) -> None:
    document.new_page()
    document.heading("Definitions")
    document.table([Column(align="left"), Column(align="left")], list(DEFINITIONS.items()))


def _flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return nested values as rows of a name with dots and a short text."""
    rows: list[tuple[str, str]] = []
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            rows += _flat(value, f"{prefix}{name}.")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            rows.append((_short(f"{prefix}{name}"), _short(text)))
    return rows


def _short(text: str) -> str:
    return text if len(text) <= 200 else f"{text[:199]}…"


def _with_sigma(shift: EyeShift) -> list[str]:
    sigma_m = np.sqrt(np.diag(shift.covariance_m2))
    return [
        f"{_mm(value)}\u00a0±\u00a0{1e3 * sigma:.2f}"
        for value, sigma in zip(shift.shift_m, sigma_m, strict=True)
    ]


def _mm(value_m: float) -> str:
    return f"{1e3 * value_m:.2f}".replace("-", "−")


def _yes(truth: bool) -> str:
    return "yes" if truth else "no"


def _time(iso: str) -> str:
    return f"{iso[:10]} {iso[11:16]} UTC"


def _metadata(outcome: Outcome) -> dict[str, str]:
    wearer = plain(outcome.record.wearer)
    return {
        "Title": f"Eye-display calibration {f'of {wearer}' if wearer else plain(outcome.name)}",
        "Subject": f"Session {plain(outcome.name)}, begun {_time(outcome.started)}",
        "Creator": f"handcal {version('handcal')}",
    }
