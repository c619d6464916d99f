"""Views of the wizard's steps that the snapshot alone decides; without Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handcal.calibration.states import State
from handcal.calibration.verifying import VerifyingView
from handcal.core.types import Eye, Verdict, VerdictName
from handcal.register.guard import turn_advice
from handcal.register.results import USED, Results
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.cells import signed
from handcal.session.drawn import drawn_shifts
from handcal.session.session import SessionRecord
from handcal.session.trial import SAME_SHIFT_M
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.preconditions import (
    can_match,
    doubted_eyes,
    eyes_accepted,
    hand_still,
    is_placed,
)
from handcal_gui.calibrate.guide.view import (
    EYE_WORDS,
    Action,
    ButtonSpec,
    Precondition,
    Step,
    WizardView,
)
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import lowered, sentence
from handcal_gui.widgets.times import session_time

VERIFY_AGAIN: dict[Eye, ButtonSpec] = {
    "left": ButtonSpec(Action.VERIFY_LEFT, tr("Verify &left eye")),
    "right": ButtonSpec(Action.VERIFY_RIGHT, tr("Verify &right eye")),
}
LOOK = tr("Keep the hand up, and look slowly to the left and to the right.")
UNUSABLE: frozenset[VerdictName] = frozenset({"implausible", "contradicted"})
SETTLED: frozenset[VerdictName] = frozenset({"accept", "keep"})
"""Verdicts after which a session can be finished without anything left to decide."""
_LEAST_LOOK_NS = 1_500_000_000
"""Time from a drawing to its confirmation: a second press of a key confirms nothing unseen."""
_GATE_MARGIN_M = 0.05
"""From the depth gate to where the hand is to be held: its palm, with fingers before and behind."""
_FOREARM_M = 0.45


def connect_view(snapshot: Snapshot) -> WizardView:
    """Return the view while camera and headset are connected."""
    camera, link = snapshot.camera, snapshot.link
    has_poses = link.connected and link.pose_rate_hz > 0
    preconditions = (
        Precondition(
            tr("No image from the camera")
            if camera.problem
            else tr("Camera: {}").format(camera.name),
            not camera.problem and camera.rate_hz > 0,
        ),
        Precondition(sentence(snapshot.link_problem) or tr("Headset connected"), link.connected),
        Precondition(
            tr("Headset pose: {:.0f} Hz").format(link.pose_rate_hz)
            if has_poses
            else tr("No pose from the headset yet"),
            has_poses,
        ),
    )
    if snapshot.contradiction and not camera.problem:
        preconditions = (Precondition(sentence(snapshot.contradiction), False), *preconditions[1:])
    seen = snapshot.observation
    is_refused = seen is not None and seen.contradiction is not None
    is_refused |= bool(snapshot.contradiction) and snapshot.procedure.results is None
    has_failed = bool(snapshot.contradiction) and is_refused
    # Evidence against a result that is there does not keep anybody from looking at it.
    is_ready = not has_failed and all(
        one.holds for one in preconditions[bool(snapshot.contradiction) :]
    )
    former = snapshot.record.facts.former
    puts_on, label, fact = tr("Put the headset on the wearer"), tr("Begin"), ""
    if begun := _made(snapshot.record):
        label = tr("Continue")
        fact = tr("This session continues where it stopped, with {}.").format(begun)
    elif former:
        puts_on = tr("Make sure that the headset sits well on the wearer")
        fact = tr(
            "The former result is used again ({}): the wearer verifies each eye first, and "
            "alignments follow only if they are needed."
        ).format(session_time(former))
    text = tr("{} and wait until camera and headset are connected.").format(puts_on)
    if is_ready:
        text = tr("{}, then press {}.").format(puts_on, label)
    elif has_failed:
        text = tr("A check has failed. Follow its advice, then press {}.").format(label)
    return WizardView(
        Step.CONNECT,
        text,
        preconditions,
        ButtonSpec(Action.NEXT, label, is_ready),
        fact=fact,
    )


def align_view(snapshot: Snapshot) -> WizardView:
    """Return the view while the wearer overlays the cursor."""
    procedure = snapshot.procedure
    cursor, was = procedure.cursor, procedure.refused_for
    seen_ns = snapshot.t_host_ns - cursor.t_host_ns if cursor is not None else 0
    preconditions = (
        can_match(snapshot),
        _as_cursor(snapshot),
        _looked(tr("Cursor shown for {:g} s"), seen_ns),
    )
    close = ""
    if len(procedure.eyes) == 1:
        close = tr("Close the {} eye. ").format(
            EYE_WORDS["right" if procedure.eyes[0] == "left" else "left"]
        )
    return WizardView(
        Step.ALIGN,
        tr("{}Move the hand until it lies under the cursor, then confirm in the headset.").format(
            close
        ),
        preconditions,
        ButtonSpec(
            Action.CONFIRM,
            tr("Confirm for the wearer"),
            _all_hold(preconditions) and is_placed(snapshot) and snapshot.link.connected,
        ),
        (ButtonSpec(Action.REDO, tr("&Make another cursor"), discards=tr("Discards this cursor")),),
        # The preconditions say what the live hand lacks.
        "" if was or not preconditions[0].holds else procedure.refusal,
        fact=tr("Last refused: {}.").format(lowered(was)) if was else "",
    )


def _as_cursor(snapshot: Snapshot) -> Precondition:
    """Return whether the guard would accept the live hand; if not, with its reason."""
    seen, limit_rad = snapshot.observation, snapshot.settings.guard.limit_rad
    limit_deg = round(float(np.degrees(limit_rad)), 1)
    straight = tr("Hand rotated by less than {:g}°").format(limit_deg)
    if seen is None or seen.rotation_rad is None:
        return Precondition(straight, False)
    angle_rad = float(np.linalg.norm(seen.rotation_rad))
    if seen.has_changed and angle_rad <= limit_rad:
        return Precondition(sentence(seen.shape_text), False)
    if seen.is_over_limit:
        advice = turn_advice(seen.rotation_rad).text
        text = tr("Turned {:.1f}°: {}").format(np.degrees(angle_rad), lowered(advice))
        return Precondition(text, False)
    return Precondition(straight, True)


def sending(results: Results) -> tuple[str, str]:
    """Return what the main button does with a solved result, and its label."""
    kept = _kept(results)
    used = [eye for eye in results.verdicts if eye not in kept]
    if not kept:
        text = tr("Send the corrected projections to the headset.")
        return text, tr("Send to the headset")
    faulty = [eye for eye in kept if results.verdicts[eye].name in UNUSABLE]
    if not used:
        text = tr("Keep the offline calibration of {}.")
        if faulty:
            text = tr(
                "Do not use this result: keep the offline calibration of {}, and follow the "
                "advice below."
            )
        return text.format(eye_names(kept)), tr("Keep offline")
    text = tr("Send the {} eye's projection; the {} eye keeps the offline calibration.")
    if faulty:
        text = tr(
            "Send the {} eye's projection; the {} eye keeps the offline calibration: its result "
            "is {}."
        )
    used_word, kept_word = EYE_WORDS[used[0]], EYE_WORDS[kept[0]]
    text = text.format(used_word, kept_word, VERDICT_WORDS[results.verdicts[kept[0]].name].lower())
    return text, tr("Send {} eye").format(used_word)


def verification_view(snapshot: Snapshot, verifying: VerifyingView) -> WizardView:
    """Return the view while an eye's outline is moved until it covers the hand."""
    eye, moved = verifying.eye, verifying.moved
    other: Eye = "right" if eye == "left" else "left"
    across = EYE_WORDS["left" if moved.right_arcmin < 0 else "right"]
    along = tr("up") if moved.down_arcmin < 0 else tr("down")
    text = tr(
        "Close the {} eye. Move the outline onto the hand: in the headset, or here with the "
        "arrow keys, + and −."
    ).format(EYE_WORDS[other])
    if verifying.is_set_aside:
        text = tr("It was moved aside on purpose: bringing it back is the evidence. {}").format(
            text
        )
    elif eye in snapshot.record.facts.verified:
        text = tr("Once more, to be sure. {}").format(text)
    total_arcmin = float(np.hypot(moved.right_arcmin, moved.down_arcmin))
    seen_ns = snapshot.t_host_ns - verifying.began_host_ns
    preconditions = (
        can_match(snapshot),
        hand_still(snapshot),
        _looked(tr("Outline shown for {:g} s"), seen_ns),
    )
    return WizardView(
        Step.VERIFY,
        text,
        preconditions,
        ButtonSpec(
            Action.VERIFIED,
            tr("It covers the hand"),
            _all_hold(preconditions) and snapshot.link.connected,
        ),
        (
            ButtonSpec(Action.UNDO_NUDGE, tr("&Undo"), verifying.can_undo),
            ButtonSpec(Action.SKIP, tr("&Skip")),
        ),
        snapshot.procedure.refusal,
        fact=tr("{} eye's outline moved by {:.1f}′: {:.1f}′ {}, {:.1f}′ {}, size {}\u00a0%").format(
            EYE_WORDS[eye].capitalize(),
            total_arcmin,
            abs(moved.right_arcmin),
            across,
            abs(moved.down_arcmin),
            along,
            signed(100 * moved.size, 1),
        ),
    )


def falsified_view(
    preconditions: tuple[Precondition, ...], snapshot: Snapshot
) -> WizardView | None:
    """Return the view of a result against which there is evidence, which no alignment removes."""
    if not any(one.verdict == "contradicted" for one in preconditions):
        return None
    return WizardView(
        Step.VERIFY,
        tr("Do not use this result. Finish, follow the advice below, and calibrate again."),
        preconditions,
        ButtonSpec(end_action(snapshot), tr("Finish")),
        (ButtonSpec(Action.ANOTHER, tr("&Add alignment")),),
    )


def end_action(snapshot: Snapshot) -> Action:
    """Return the action that ends the session, by one press unless its data cannot be stored."""
    return Action.NEXT if snapshot.problem else Action.FINISH


def save_view(snapshot: Snapshot) -> WizardView:
    """Return the view of a session that is to be finished, or is."""
    preconditions = (
        Precondition(tr("Saved in {}").format(snapshot.session_path), not snapshot.problem),
        *eyes_accepted(snapshot),
    )
    others = (ButtonSpec(Action.EXPORT, tr("E&xport…")), ButtonSpec(Action.BACK, tr("&Back")))
    judged = preconditions[1:]
    doubted = doubted_eyes(snapshot)
    is_settled = bool(judged) and all(one.verdict in SETTLED for one in judged)
    is_good = bool(judged) and all(one.verdict == "accept" for one in judged)
    is_verified = is_good and len(snapshot.record.verified_now) == len(judged)
    unearned = frozenset() if is_verified else frozenset({Step.VERIFY})
    if snapshot.record.is_finished:
        text = tr(
            "The session is complete. Take the headset off, or continue with the next wearer."
        )
        if kept := [eye for eye in kept_eyes(snapshot) if is_settled]:
            text = tr(
                "The session is complete; the result is not used for {}. Take the headset off, or "
                "continue with the next wearer."
            ).format(eye_names(kept))
        if judged and not is_settled:
            text = tr(
                "The session is finished, but its result is not good yet. Go back to measure more, "
                "or continue with the next wearer."
            )
        elif doubted:
            text = tr(
                "The session is finished, but trials of {} are over the target. Go back to measure "
                "again, or continue with the next wearer."
            ).format(eye_names(doubted))
        main = ButtonSpec(Action.NEXT_WEARER, tr("Next wearer"))
    else:
        text = tr("Everything is already saved. Finish the session when you are done.")
        if judged and not is_settled:
            text = tr("Not good yet. Go back to measure more, or finish as it is; all is saved.")
        elif doubted:
            text = tr(
                "Trials of {} are over the target. Go back to measure again, or finish as it is; "
                "all is saved."
            ).format(eye_names(doubted))
        if snapshot.problem:
            text = tr("Solve the problem below, then finish the session.")
        main = ButtonSpec(Action.FINISH, tr("Finish session"))
    return WizardView(
        Step.SAVE,
        text,
        preconditions,
        main,
        (*others, *keep_choices(snapshot)),
        fact=drawn_fact(snapshot),
        unearned=unearned,
    )


def doubt_sentence(snapshot: Snapshot) -> str:
    """Return the next step after a result that its trials contradict; else empty."""
    doubted = doubted_eyes(snapshot)
    text = tr("Trials of {} are over the target. Add an alignment, or finish as it is.")
    return text.format(eye_names(doubted)) if doubted else ""


def drawn_fact(snapshot: Snapshot) -> str:
    """Return why the headset does not draw the final φ now, or how to go on; empty if it does."""
    procedure, results = snapshot.procedure, snapshot.procedure.results
    if results is None or procedure.state is not State.APPLIED:
        return ""
    final, drawn_m = drawn_shifts(snapshot.record, results), procedure.applied_shift_m
    others: list[Eye] = [
        eye
        for eye in results.eyes
        if np.abs(drawn_m[eye] - final[eye].shift_m).max() >= SAME_SHIFT_M
    ]
    if others:
        text = tr("The headset draws {} with another φ for the moment: {}.")
        moved = tr("it is moved for a trial") if snapshot.trial_eye else tr("it is being set")
        return text.format(eye_names(others), moved)
    former_m, solved_m = procedure.former_shift_m, results.rendered_shift_m
    is_back = any((drawn_m[eye] != solved_m[eye]).any() for eye in solved_m)
    can_return = all(eye in former_m and (former_m[eye] == solved_m[eye]).all() for eye in solved_m)
    return tr("Press G to return to the newest φ.") if is_back and can_return else ""


def keep_choices(snapshot: Snapshot) -> tuple[ButtonSpec, ...]:
    """Return the button that uses results that are no better than before, or drops them again."""
    results = snapshot.procedure.results
    kept = kept_eyes(snapshot)
    if results is None or not kept or snapshot.procedure.state is not State.APPLIED:
        return ()
    final = drawn_shifts(snapshot.record, results)
    if all(final[eye].kind == "solved" for eye in kept):
        return (ButtonSpec(Action.KEEP_OFFLINE, tr("Keep &offline")),)
    return (ButtonSpec(Action.USE_ANYWAY, tr("&Use it anyway")),)


def kept_eyes(snapshot: Snapshot) -> list[Eye]:
    """Return the usable eyes whose result is no better than the offline calibration."""
    results = snapshot.procedure.results
    verdicts = results.verdicts if results is not None else {}
    return [eye for eye in snapshot.plan.usable_eyes if _name(verdicts, eye) == "keep"]


def _name(verdicts: Mapping[Eye, Verdict], eye: Eye) -> str:
    return verdicts[eye].name if eye in verdicts else ""


def _kept(results: Results) -> tuple[Eye, ...]:
    """Return the eyes for which the headset draws with the offline calibration."""
    verdicts = results.verdicts
    return tuple(eye for eye in verdicts if verdicts[eye].name not in USED)


def _looked(text: str, shown_ns: int) -> Precondition:
    """Return whether the wearer has had the time to look at a drawing, as a precondition."""
    return Precondition(text.format(_LEAST_LOOK_NS / 1e9), shown_ns > _LEAST_LOOK_NS)


def _all_hold(preconditions: Sequence[Precondition]) -> bool:
    return all(one.holds for one in preconditions)


def _made(record: SessionRecord) -> str:
    """Return the alignments and verifications so far, in words; empty if there are none."""
    held = (
        (len(record.alignments), tr("alignment"), tr("alignments")),
        (len(record.facts.verified), tr("verified eye"), tr("verified eyes")),
    )
    return ", ".join(pluralize(*one) for one in held if one[0])


def distance(snapshot: Snapshot) -> str:
    """Return how far from the camera the hand is to be held within the depth gate, in words."""
    gate_m = snapshot.settings.segment.reachable_m
    near_m, far_m = gate_m[0] + _GATE_MARGIN_M, gate_m[1] - _GATE_MARGIN_M
    text = tr("{:.0f} to {:.0f} cm from the camera").format(100 * near_m, 100 * far_m)
    is_forearm = near_m <= _FOREARM_M <= far_m
    return tr("at forearm's length, {}").format(text) if is_forearm else text


def eye_names(eyes: Sequence[Eye]) -> str:
    """Return eyes in words."""
    return tr("both eyes") if len(eyes) == 2 else tr("the {} eye").format(EYE_WORDS[eyes[0]])
