"""Results as table rows of formatted text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from handcal.core.types import EYES, Eye, EyeShift, VerdictName
from handcal.register import verdict_words
from handcal.register.results import Results
from handcal.report.cells import signed
from handcal.session.trial import EyeTrials, Trial, is_doubted
from handcal_gui.app.translation import tr
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Row

EYE_NAMES: Mapping[Eye, str] = {"left": tr("Left eye"), "right": tr("Right eye")}
_SYMBOLS: Mapping[VerdictName, str] = {
    "accept": "✓",
    "repeat": "↻",
    "keep": "↩",
    "implausible": "✕",
    "contradicted": "✕",
}
VERDICT_WORDS: Mapping[VerdictName, str] = {
    name: f"{_SYMBOLS[name]} {word}" for name, word in verdict_words.VERDICT_WORDS.items()
}
VERDICT_COLORS: Mapping[VerdictName, str] = {
    "accept": "good",
    "repeat": "warning",
    "keep": "warning",
    "implausible": "red",
    "contradicted": "red",
}
"""Names of the theme's colours."""
VERDICT_ICONS: Mapping[VerdictName, str] = {
    "accept": "check",
    "repeat": "redo",
    "keep": "undo",
    "implausible": "cross",
    "contradicted": "cross",
}
NOTHING = "–"


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of an eye shift."""

    name: str
    suffix: str
    meaning: str
    """Explanation for a tooltip. The unit is in the name or the suffix."""
    value: Callable[[EyeShift], float]
    """Computes the number in its unit from the shift."""
    decimals: int
    sigma: Callable[[EyeShift], float] | None = None
    """Computes the number's standard deviation from the shift."""
    is_registered: bool = False
    """True if there is none without an alignment, as after a slipped headset."""

    def text(self, shift: EyeShift) -> str:
        """Return the number, with its standard deviation if it has one."""
        if not self._is_known(shift):
            return NOTHING
        value = self.value(shift)
        if self.sigma is None:
            return f"{value:.{self.decimals}f}{self.suffix}"
        return (
            f"{signed(value, self.decimals)} ± {self.sigma(shift):.{self.decimals}f}{self.suffix}"
        )

    def difference(self, shift: EyeShift, other: EyeShift) -> str:
        """Return the other's number minus this one."""
        if not (self._is_known(shift) and self._is_known(other)):
            return NOTHING
        apart = self.value(other) - self.value(shift)
        return f"{signed(apart, self.decimals)}{self.suffix}"

    def _is_known(self, shift: EyeShift) -> bool:
        return not self.is_registered or shift.residuals_m.size > 0


def _phi(index: int, direction: str) -> Quantity:
    return Quantity(
        tr("φ{} (mm)").format(index + 1),
        "",
        tr(
            "Distance of the eye {} the rig's viewpoint,\n± one standard deviation (σ). Both eyes "
            "are solved together:\nan alignment of one may change the other, too."
        ).format(direction),
        lambda shift: 1e3 * float(shift.shift_m[index]),
        2,
        lambda shift: 1e3 * float(shift.covariance_m2[index, index]) ** 0.5,
    )


PHI = (_phi(0, tr("to the right of")), _phi(1, tr("below")), _phi(2, tr("in front of")))
_EXPECTED_ERROR = tr("Expected error")
_EXPECTED_ERROR_MEANING = tr(
    "Expected angle between real and drawn points at 0.4 to 0.6 m due to the uncertainty of φ,\n"
    "in arcminutes. 1′ is 0.15 mm at 0.5 m."
)
REGISTRATION = (
    Quantity(
        tr("Point RMS (mm)"),
        "",
        tr(
            "Distance from the hand's points to their partners on the cursor after registration,\n"
            "root mean square over the inliers"
        ),
        lambda shift: 1e3 * shift.rms_m,
        2,
        is_registered=True,
    ),
    Quantity(
        tr("Inliers"),
        " %",
        tr("Share of the hand's points with a partner on the cursor"),
        lambda shift: 100 * shift.inlier_ratio,
        0,
        is_registered=True,
    ),
    Quantity(
        tr("Iterations"),
        "",
        tr("Sum over all alignments"),
        lambda shift: float(shift.iterations),
        0,
        is_registered=True,
    ),
)
_ANOTHER = tr("Expected error after one more alignment like these")
_ALONE: Mapping[Eye, str] = {"left": tr("{} left"), "right": tr("{} right")}
_TRIALS = tr(
    "Error of this φ in the user-test trials, the mean, and their number; trials of an earlier φ\n"
    "are only counted. ⚠: over the lab's target; look at the trials, and calibrate again if φ was\n"
    "set well by hand."
)
_EYE_DISTANCE = tr("Eye distance")
_EYE_DISTANCE_MEANING = tr("Distance between the two solved eye positions")


def trial_row(judged: Mapping[Eye, EyeTrials], trials: Iterable[Trial]) -> Row:
    """Return the mean error of each eye's trials; ⚠ marks one over the lab's target.

    Of an eye with trials of an earlier φ only, their number.
    """
    counts = Counter(one.eye for one in trials)
    cells = (_trials_cell(judged.get(eye), counts[eye]) for eye in EYES)
    return Row(tr("Trials"), tuple(cells), _TRIALS)


def _trials_cell(found: EyeTrials | None, count: int) -> str:
    if found is None:
        return tr("{} of earlier φ").format(count) if count else NOTHING
    text = tr("⚠ {:.1f}′ n={}") if found.is_over else tr("{:.1f}′ n={}")
    return text.format(found.mean_arcmin, found.count)


def result_rows(results: Results, trials: Row | None = None) -> list[Row]:
    """Return the numbers of each eye, one column per eye, and those of both eyes."""
    rows = [_row(quantity, results) for quantity in PHI]
    expected = {eye: one.after_arcmin for eye, one in results.benefits.items()}
    rows.append(Row(_EXPECTED_ERROR, _cells(expected), _EXPECTED_ERROR_MEANING))
    another = _cells(results.expected_after_another_arcmin)
    rows += [Row(tr("One more alignment"), another, _ANOTHER), *filter(None, [trials])]
    rows += [_row(quantity, results) for quantity in REGISTRATION]
    solved = tr("Eye distance, solved")  # as another may be measured
    rows.append(Row(solved, (eye_distance_text(results),), _EYE_DISTANCE_MEANING))
    if measured := results.measured_eye_distance:
        meaning = tr("Used in the results; {}").format(measured.source)
        rows.append(Row(tr("Eye distance measured"), (str(measured),), meaning))
    if sessions := results.fused.prior.sessions:
        counted = pluralize(sessions, tr("session"), tr("sessions"))
        learned = tr("learned from {}").format(counted)
        rows.append(
            Row(tr("Prior"), (learned,), tr("Where eyes are expected before any alignment"))
        )
    if warning := results.fused.prior.warning:
        rows.append(Row(tr("Learned prior"), (tr("not used"),), tr("Not used: {}").format(warning)))
    held = (
        (len(results.alignments), tr("alignment"), tr("alignments")),
        (len(results.fused.verified), tr("verified eye"), tr("verified eyes")),
    )
    fused = ", ".join(pluralize(*one) for one in held if one[0])
    meaning = tr("Alignments and verified eyes that were fused; solver: {}").format(results.method)
    return [*rows, Row(tr("Solved from"), (fused,), meaning)]


def eyes_text(eyes: Sequence[Eye]) -> str:
    """Return the name of one eye, or of both."""
    return EYE_NAMES[eyes[0]] if len(eyes) == 1 else tr("Both eyes")


def verdict_word(results: Results, eye: Eye, trials: EyeTrials | None = None) -> str:
    """Return an eye's verdict in a word, or the doubt that trials cast on it."""
    name = results.verdicts[eye].name
    if trials is not None and is_doubted(name, trials):
        return doubt_word(trials.target_arcmin)
    return VERDICT_WORDS[name]


def doubt_word(target_arcmin: float) -> str:
    """Return the word for an accepted eye whose trials are over the target."""
    return tr("⚠ Trials over {:g}′").format(target_arcmin)


def verdict_color(verdict: VerdictName, trials: EyeTrials | None) -> str:
    """Return the name of the theme's colour for a verdict."""
    return "warning" if is_doubted(verdict, trials) else VERDICT_COLORS[verdict]


def verdict_reason(results: Results, eye: Eye, trials: EyeTrials | None = None) -> str:
    """Return the reason of an eye's verdict, or advice on trials over the target."""
    verdict = results.verdicts[eye]
    if trials is None or not is_doubted(verdict.name, trials):
        return sentence(verdict.reason)
    advice = tr("Trials found {:.1f}′. If φ was set carefully in them, measure again.")
    return advice.format(trials.mean_arcmin)


def verdict_rows(results: Results, trials: Mapping[Eye, EyeTrials] = {}) -> list[Row]:
    """Return each solved eye's verdict and its reason."""
    rows = []
    for eye in results.verdicts:
        given = results, eye, trials.get(eye)
        rows.append(Row(EYE_NAMES[eye], (verdict_word(*given), verdict_reason(*given))))
    return rows


def another_text(results: Results) -> str:
    """Return the expected benefit of one more alignment."""
    gains = ", ".join(
        f"{EYE_NAMES[eye].lower()} {_arcmin(results.benefits[eye].after_arcmin)}"
        f" → {_arcmin(arcmin)}"
        for eye, arcmin in results.expected_after_another_arcmin.items()
    )
    return tr("One more alignment like these: expected error {}.").format(gains)


def eye_distance_text(results: Results) -> str:
    """Return the distance between the solved eyes."""
    distance_m = results.eye_distance_m
    return NOTHING if distance_m is None else f"{1e3 * distance_m:.1f} mm"


def single_alignment_rows(results: Results) -> list[Row]:
    """Return φ from each alignment alone, one row per eye."""
    return [
        Row(_ALONE[eye].format(number), tuple(q.text(shift) for q in PHI))
        for number, shifts in results.alignments.items()
        for eye, shift in shifts.items()
    ]


def comparison_rows(results: Results, other: Results) -> list[Row]:
    """Return both results and their differences, eye by eye."""
    rows = []
    for eye in EYES:
        if eye in results.eyes and eye in other.eyes:
            rows.append(Row(EYE_NAMES[eye], ("", "", "")))
            one, two = results.eyes[eye], other.eyes[eye]
            expected = [of.benefits[eye].after_arcmin for of in (results, other)]
            apart = f"{signed(expected[1] - expected[0], 1)}′"
            texts = (*map(_arcmin, expected), apart)
            compared = [
                Row(q.name, (q.text(one), q.text(two), q.difference(one, two)), q.meaning)
                for q in (*PHI, *REGISTRATION)
            ]
            compared.insert(len(PHI), Row(_EXPECTED_ERROR, texts, _EXPECTED_ERROR_MEANING))
            rows += compared
    if results.eye_distance_m is not None and other.eye_distance_m is not None:
        apart_mm = 1e3 * (other.eye_distance_m - results.eye_distance_m)
        texts = (*map(eye_distance_text, (results, other)), f"{signed(apart_mm, 1)} mm")
        rows.append(Row(_EYE_DISTANCE, texts, _EYE_DISTANCE_MEANING))
    return rows


def _row(quantity: Quantity, results: Results) -> Row:
    eyes = results.eyes
    cells = (quantity.text(eyes[eye]) if eye in eyes else NOTHING for eye in EYES)
    return Row(quantity.name, tuple(cells), quantity.meaning)


def _cells(arcmin: Mapping[Eye, float]) -> tuple[str, ...]:
    return tuple(_arcmin(arcmin[eye]) if eye in arcmin else NOTHING for eye in EYES)


def _arcmin(arcmin: float) -> str:
    return f"{arcmin:.1f}′"
