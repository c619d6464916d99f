"""Preconditions of the wizard's steps, from a snapshot; without Qt."""

from __future__ import annotations

from math import ceil

from handcal.core.types import Eye
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.session.judged_trials import EyeTrials, eye_trials, is_doubted
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.view import EYE_WORDS, Precondition
from handcal_gui.widgets.sentence import sentence


def is_steady(snapshot: Snapshot) -> bool:
    """Return whether a cursor can be made of the hand."""
    return snapshot.observation is not None and snapshot.observation.is_steady


def hand_still(snapshot: Snapshot) -> Precondition:
    """Return whether the hand is held still and can be placed in time, as a precondition."""
    if needs_look(snapshot):
        return Precondition(tr("The wearer has looked slowly to the left and to the right"), False)
    return Precondition(tr("Hand held still"), is_steady(snapshot))


def is_unsolved(snapshot: Snapshot) -> bool:
    """Return whether a running session has no result, or none of its present alignments."""
    return snapshot.procedure.results is None and not snapshot.record.is_finished


def needs_look(snapshot: Snapshot) -> bool:
    """Return whether the wearer must turn the head before a hand can be placed in time."""
    return snapshot.observation is not None and snapshot.observation.needs_delay


def is_placed(snapshot: Snapshot) -> bool:
    """Return whether the newest hand has a place in the world."""
    return snapshot.observation is not None and snapshot.observation.hand is not None


def hand_found(snapshot: Snapshot) -> Precondition:
    """Return whether a hand is found, as a precondition, with the reason if there is none."""
    seen = snapshot.observation
    # A hand that is seen without a problem is placed with one of the next frames.
    if is_placed(snapshot) or (seen and seen.cloud is not None and not seen.problem):
        return Precondition(tr("Hand found"), True)
    without = tr("No image from the camera") if snapshot.camera.problem else tr("No hand in view")
    return Precondition((seen and sentence(seen.problem)) or without, False)


def can_match(snapshot: Snapshot) -> Precondition:
    """Return whether a confirmation would find its image: a hand is found, in enough of them."""
    needed_hz = ceil(0.5 / snapshot.settings.match_tolerance_s)
    rate_hz = snapshot.camera.rate_hz
    if snapshot.camera.problem or rate_hz >= needed_hz:
        return hand_found(snapshot)
    text = tr("Images per second: {:.0f} of the {} needed. Close other programs.")
    return Precondition(text.format(rate_hz, needed_hz), False)


def trials_of(snapshot: Snapshot) -> dict[Eye, EyeTrials]:
    """Return the user-test trials of the present results."""
    results = snapshot.procedure.results
    if results is None:
        return {}
    return eye_trials(results, snapshot.record, snapshot.settings.solve.verdict.target_arcmin)


def doubted_eyes(snapshot: Snapshot) -> list[Eye]:
    """Return the accepted eyes whose user-test trials are over the lab's target."""
    results = snapshot.procedure.results
    verdicts = results.verdicts if results is not None else {}
    return [eye for eye, one in trials_of(snapshot).items() if is_doubted(verdicts[eye].name, one)]


def eyes_accepted(snapshot: Snapshot) -> tuple[Precondition, ...]:
    """Return the verdict on each solved eye that the plan is for, as a precondition."""
    results = snapshot.procedure.results
    if results is None:
        return ()
    return tuple(
        Precondition(
            tr("{} eye: {}. {}").format(
                EYE_WORDS[eye].capitalize(), VERDICT_WORDS[verdict.name], verdict.reason
            ),
            verdict.name == "accept",
            verdict.name,
        )
        for eye, verdict in results.verdicts.items()
        if eye in snapshot.plan.usable_eyes
    )
