"""A calibration station: camera, headset, procedure and session, opened and closed together.

One thread owns a station: it calls `step` repeatedly, and other methods in between.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path

from handcal.calibration.former import Former, end_former, read_former
from handcal.calibration.hands import PlacedHand
from handcal.calibration.plan import NextStep, Plan, StepName
from handcal.calibration.procedure import Calibration
from handcal.calibration.states import Observation, ProcedureError, State
from handcal.calibration.verifying import skipped_eyes
from handcal.camera.camera import Camera
from handcal.camera.feed import CameraFeed
from handcal.core.errors import FileError, LinkError
from handcal.core.geometry import transform
from handcal.core.types import Frame, HeadsetIdentity
from handcal.io.closable import Closable
from handcal.link.pairing import Pairing, Pairings, new_pairing_key
from handcal.link.server import LOOPBACK, HeadsetServer
from handcal.link.statistics import LinkStatistics
from handcal.link.transport import reachable_address
from handcal.rig.rig_file import read_rig
from handcal.session.state import Kind
from handcal.sim.process import VirtualHeadset
from handcal.sim.simulation import Simulation
from handcal.station.checks.headset import link_problem
from handcal.station.eye_views import EyeViews
from handcal.station.opening import (
    open_camera,
    plan_of_session,
    resume_or_create,
    start_headset,
)
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.user_test.trials import Trials
from handcal.station.weak import weakly

_STORE_PERIOD_S = 1.0


class Station(Closable):
    """A station with one wearer.

    Parameters
    ----------
    settings : StationSettings
    wearer : str
        Name or code; stored in the session.
    resume : Path, optional
        A session to resume, instead of a new one.
    former : Path, optional
        A stored session of the same wearer and rig: the new one begins with its φ, to be verified
        first, and with its posterior, widened, as prior.
    pairings : Pairings or str
        The network headsets that may connect, or a key alone; the virtual headset gets a new key.

    Attributes
    ----------
    calibration : Calibration
    session : Session
    plan : Plan
    trials : Trials
    holds_plan : bool
        True to hold an automatic plan before its next step.

    Raises
    ------
    FileError
        If the rig or the session cannot be read, or no session can be created.
    LinkError
        If the network address cannot be bound, or the key is too short.
    """

    def __init__(
        self,
        settings: StationSettings,
        wearer: str = "",
        resume: Path | None = None,
        pairings: Pairings | str = "",
        former: Path | None = None,
    ) -> None:
        begun = Former()
        if former is not None and resume is None:
            begun = read_former(former, read_rig(settings.rig_path))
        is_virtual = settings.headset == "virtual"
        if is_virtual or isinstance(pairings, str):
            key = new_pairing_key() if is_virtual else str(pairings)
            pairings = Pairings((Pairing(key),))
        self._pairings = pairings
        self.watch_views = False
        self._watchers: list[Callable[[Snapshot], object]] = []
        self.holds_plan = False
        self._next_step: NextStep | None = None
        self._observation: Observation | None = None
        self._simulation: Simulation | None = None
        with ExitStack() as stack:
            self.session, settings = stack.enter_context(
                resume_or_create(settings, wearer, resume, begun)
            )
            self.settings = settings
            self.rig = self.worn_rig = self.session.contents.rig
            self._worn_rig_path = Path(settings.worn_rig or self.session.path / "rig.yaml")
            bind = LOOPBACK if is_virtual else (settings.host, settings.port)
            self._link = stack.enter_context(HeadsetServer(pairings, bind))
            if is_virtual:
                self._simulation = stack.enter_context(
                    Simulation(settings.seed, weakly(self._start_headset), settings.side)
                )
                self.worn_rig = read_rig(self._worn_rig_path)
            self._feed = stack.enter_context(CameraFeed(weakly(self._open_camera)))
            plan = plan_of_session(self.session, settings.plan, is_resumed=resume is not None)
            if former is not None and resume is None:
                self.session.save_facts(former=former.name)
                self.session.save_fine_tuned(begun.shift_m)
                with suppress(FileError):  # as on a read-only disk: it is only offered again
                    end_former(former)
            self.calibration = Calibration(
                self.session, self._link, settings.calibration, begun.shift_m
            )
            record = self.session.contents
            self.plan = Plan(
                self.calibration,
                plan,
                verifies_first=bool(record.facts.former),
                skipped=skipped_eyes(record.events),
            )
            self._views = EyeViews(
                self.calibration, self.rig, settings, self._simulation, self.worn_rig
            )
            self._stack = stack.pop_all()
        self.trials = Trials(self.calibration, self.rig, self._link, self.session)
        self._number = 0
        self._frame: Frame | None = None
        self._not_applied = self._not_stored = ""
        self._next_store_s = 0.0

    @property
    def pairing_key(self) -> str:
        """The key with which the next new headset connects."""
        return self._pairings.open_key()

    @property
    def link(self) -> HeadsetServer:
        """The PC's end of the link; safe to use from several threads."""
        return self._link

    @property
    def headset(self) -> HeadsetIdentity | None:
        """The connected headset, as it introduced itself; None before it has."""
        return self._link.device

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that the headset connects to, reachable from other machines."""
        with suppress(LinkError):  # no network yet
            return reachable_address(self._link.address)
        return self._link.address

    def step(self) -> Snapshot:
        """Process the next frame, if one arrives soon, and return the new snapshot."""
        observation = self._observe()
        self._advance(observation)
        self._store_waiting()
        if observation is not None and observation.hand is not None:
            self._show(observation.hand)
        snapshot = self._make_snapshot(observation)
        for watcher in self._watchers:
            watcher(snapshot)
        return snapshot

    def _observe(self) -> Observation | None:
        """Return what the next frame shows; None if none arrives."""
        frame = self._feed.read()
        if frame is None:
            return None
        self._frame = frame
        self.calibration.camera = self._feed.status.identity
        try:
            observation = self.calibration.step(frame)
        except LinkError as error:
            self._not_applied = str(error)
            return None
        cloud = observation.cloud
        self._feed.expose_for(None if cloud is None else cloud.points_m)
        return observation

    def _advance(self, observation: Observation | None) -> None:
        """Take what the headset has acknowledged, and the plan's next step if its time has come."""
        # The session keeps what it cannot write; `_store_waiting` reports the problem.
        try:
            if self.calibration.state is State.APPLYING:
                with suppress(FileError):
                    self.calibration.poll_applied()
            if observation is not None:
                self._observation = observation
                with suppress(FileError):
                    self._next_step = self._follow_plan(observation)
        except LinkError as error:
            self._not_applied = str(error)
        # An automatic plan sends them again at once; the reason lasts until it has succeeded.
        if self.calibration.state not in (State.SOLVED, State.APPLYING):
            self._not_applied = ""
        self.trials.follow_procedure()

    def _make_snapshot(self, observation: Observation | None) -> Snapshot:
        self._number += 1
        link = self._link.statistics()
        return Snapshot(
            number=self._number,
            t_host_ns=time.monotonic_ns(),
            frame=self._frame,
            observation=observation,
            camera=self._feed.status,
            link=link,
            link_problem=self._link_problem(link),
            procedure=self.calibration.now(),
            record=self.session.contents,
            settings=self.settings.calibration,
            plan=self.plan.settings,
            next_step=self._next_step,
            not_applied=self._not_applied,
            not_stored=self._not_stored,
            contradiction=self._contradiction(observation),
            # A view of what the headset draws would reveal which drawing is shown.
            views={} if self.trials.comparing.shown else dict(self._views.shown),
            comparing=self.trials.comparing.shown,
            has_compared_both=self.trials.comparing.has_seen_both,
            trial_eye=next(iter(self.trials.target_E_m), None),
        )

    def watch(self, watcher: Callable[[Snapshot], object]) -> None:
        """Call `watcher` with every new snapshot, in the station's thread; it must not wait."""
        self._watchers.append(watcher)

    def _follow_plan(self, observation: Observation) -> NextStep:
        """Take the plan's next step if it is automatic and not held; return it."""
        if self.holds_plan:
            return self.plan.next_step(observation.is_steady)
        return self.plan.follow(observation)

    def take_step(self) -> None:
        """Take the next step of a plan that is held.

        Raises
        ------
        ProcedureError
            If it cannot be taken yet.
        LinkError
            If the link is closed.
        FileError
            If the session cannot be written; the step is done anyway.
        """
        if self._observation is None:
            raise ProcedureError("wait for the camera's first frame")
        step = self.plan.advance(self._observation)
        if step.name in (StepName.RAISE, StepName.WAIT):
            raise ProcedureError(step.text)

    def finish(self) -> None:
        """Record the link statistics and finish the session; FileError if it cannot be written."""
        self.trials.hide_target()
        self.trials.comparing.end()
        self.session.write_waiting()
        self.session.record("link", **asdict(self._link.statistics()))
        self.session.finish()

    def delete(self, kind: Kind, number: int) -> None:
        """Delete an alignment or a trial; it can be restored.

        Raises
        ------
        ProcedureError
            While alignments cannot be changed.
        ValueError
            If there is none of this number.
        FileError
            If a trial's deletion cannot be written; that of an alignment is kept until it can.
        """
        if kind == "trial":
            self.session.delete(kind, number)
        else:
            with suppress(FileError):
                self.calibration.delete_alignment(number)

    def restore(self, kind: Kind, number: int) -> None:
        """Restore a deleted alignment or trial; raises as `delete`."""
        if kind == "trial":
            self.session.restore(kind, number)
        else:
            with suppress(FileError):
                self.calibration.restore_alignment(number)

    def require_headset(self) -> None:
        """Raise LinkError if the virtual headset has ended."""
        if self._simulation is not None:
            self._simulation.require_running()

    def restart_headset(self) -> None:
        """Start the virtual headset again; a network headset reconnects automatically."""
        if self._simulation is not None:
            self._simulation.restart()

    def close(self) -> None:
        """Write pending data and close everything; safe to call twice."""
        self._stack.close()

    def _start_headset(self, scene_port: int) -> VirtualHeadset:
        return start_headset(
            self.settings,
            self.session.path / "rig.yaml",
            self._worn_rig_path,
            (self._link.address[1], scene_port),
            self._pairings.all[-1].key,
        )

    def _open_camera(self) -> Camera:
        return open_camera(self.settings, self._simulation, self.worn_rig)

    def _show(self, hand: PlacedHand) -> None:
        """Show the live hand in the headset, and render the wearer's views if requested."""
        if self.calibration.state is State.APPLIED:
            # The wearer judges the calibration by this outline on their own hand.
            outline_W_m = transform(hand.T_W_D, hand.cloud.outline_m)
            self._link.send_live_hand(outline_W_m, False, is_outline=True)
        if self.watch_views and not self.trials.comparing.shown:
            self._views.render_next(hand, self.trials.target_E_m, self.trials.is_offline)

    def _link_problem(self, link: LinkStatistics) -> str:
        try:
            self.require_headset()
        except LinkError as error:
            return str(error)
        is_awaited = self._simulation is None and not link.connected
        return link_problem(link, self.address if is_awaited else None)

    def _contradiction(self, observation: Observation | None) -> str:
        found = self.calibration.evidence.contradictions
        if observation is not None and observation.contradiction is not None:
            found = (observation.contradiction, *found)
        return found[0].text if found else ""

    def _store_waiting(self) -> None:
        """Write what could not be written before, now and then."""
        now_s = time.monotonic()
        if self._not_stored and now_s < self._next_store_s:
            return
        self._next_store_s = now_s + _STORE_PERIOD_S
        try:
            self.session.write_waiting()
            self._not_stored = ""
        except FileError as error:
            self._not_stored = (
                f"{error}. Make room on the disk, make the folder writable, or put it back: until "
                "then the data are kept in memory."
            )
