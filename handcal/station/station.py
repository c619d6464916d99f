"""A calibration station: camera, headset, procedure and session, opened and closed together.

One thread owns a station: it calls `step` repeatedly, and other methods in between.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from handcal.calibration.hands import PlacedHand
from handcal.calibration.lab_prior import run_learn_prior
from handcal.calibration.plan import Plan, PlanSettings, StepName
from handcal.calibration.procedure import Calibration
from handcal.calibration.sight import Observation
from handcal.calibration.solve_again import Former, end_former, read_former, stored_solve_settings
from handcal.calibration.states import ProcedureError, State
from handcal.calibration.verifying import skipped_eyes
from handcal.camera.camera import Camera
from handcal.camera.feed import CameraFeed
from handcal.camera.live import open_hololens2, open_live
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import open_recording
from handcal.core.errors import CameraError, FileError, LinkError
from handcal.core.geometry import transform
from handcal.core.types import EYES, Frame, HeadsetIdentity, PlanName, Rig
from handcal.io.closable import Closable
from handcal.io.settings import settings_json
from handcal.link.pairing import Pairing, Pairings, new_pairing_key
from handcal.link.server import LOOPBACK, HeadsetServer
from handcal.link.statistics import LinkStatistics
from handcal.link.transport import reachable_address
from handcal.register.fuse import FuseSettings
from handcal.register.prior import fit_wearers
from handcal.register.sitting import sitting_prior
from handcal.rig.rig_file import read_rig
from handcal.session.in_force import end_at_begin
from handcal.session.journal import JOURNAL, JOURNAL_END
from handcal.session.record import replay
from handcal.session.session import Session
from handcal.session.state import Kind, SessionEvent
from handcal.sim.camera import (
    CAMERA_FAULTS,
    SyntheticCamera,
    SyntheticSettings,
    sensor_settings,
)
from handcal.sim.simulation import Simulation, VirtualHeadset
from handcal.station.checks.headset import link_problem
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.user_test.trials import Trials
from handcal.station.wearer_view import EyeViews

_FIRST_FILES = {"alignments", "rig.yaml", "settings.json", JOURNAL, JOURNAL_END, "lock"}
_FIRST_EVENTS = {SessionEvent.CREATED, SessionEvent.FACTS_SAVED, SessionEvent.FINE_TUNED}


@contextmanager
def resume_or_create(
    settings: StationSettings, wearer: str, resume: Path | None, begun: Former
) -> Iterator[tuple[Session, StationSettings]]:
    """Resume a session, or create one, which is removed if its station cannot be opened.

    Also return the settings with the session's priors: a session keeps those that it began with,
    so that resuming does not change its results. A resumed one keeps the lab's target, too.

    Raises
    ------
    FileError
        If it cannot be read or created.
    """
    if resume is not None:
        with Session(resume) as session:
            _end_former(settings, session)
            stored = stored_solve_settings(session.contents)
            target_arcmin = stored.verdict.target_arcmin
            yield session, _with_fuse(settings, stored.fuse, target_arcmin)
        return
    solve = settings.calibration.solve
    if begun.prior is not None:
        fuse = replace(solve.fuse, prior=replace(solve.fuse.prior, learned=begun.prior))
    else:
        fuse = _lab_fuse(settings)
    settings = _with_fuse(settings, fuse, solve.verdict.target_arcmin)
    rig = read_rig(settings.rig_path)
    station = settings_json(settings)
    stored_settings = {"calibration": station.pop("calibration"), "station": station}
    with Session.create(settings.sessions_path, rig, stored_settings, wearer=wearer) as session:
        _end_former(settings, session)
        try:
            yield session, settings
        except BaseException:
            session.close()
            _discard_if_empty(session.path)
            raise


def _end_former(settings: StationSettings, session: Session) -> None:
    """End the calibration in force of another wearer; a simulated one wears nothing."""
    if settings.headset != "virtual":
        end_at_begin(session.path)


def _with_fuse(
    settings: StationSettings, fuse: FuseSettings, target_arcmin: float
) -> StationSettings:
    calibration = settings.calibration
    solve = replace(
        calibration.solve,
        fuse=fuse,
        verdict=replace(calibration.solve.verdict, target_arcmin=target_arcmin),
    )
    return replace(settings, calibration=replace(calibration, solve=solve))


def _discard_if_empty(path: Path) -> None:
    """Remove a session, unless it holds more than what a station stores as it is opened."""
    with suppress(FileError, OSError):
        events = {event.name for event in replay(path).journal.events}
        files = {file.name for file in path.iterdir()}
        if events <= _FIRST_EVENTS and files <= _FIRST_FILES:
            (path / "alignments").rmdir()  # first: it fails if there are any
            for name in files - {"alignments"}:
                (path / name).unlink()
            path.rmdir()


def plan_of_session(session: Session, plan: PlanSettings, *, is_resumed: bool) -> PlanSettings:
    """Return the plan that a resumed session has, or record that of a new one and return it.

    Parameters
    ----------
    session : Session
    plan : PlanSettings
        The plan of a new session; a resumed one keeps its name, its eyes and their order.
    is_resumed : bool

    Raises
    ------
    FileError
        If the session cannot be written.
    """
    if not is_resumed:
        if plan.name != "paper":
            session.save_facts(plan=plan.name)
        elif plan.in_turn:
            session.save_facts(plan=plan.eyes)
        if plan.usable_eyes != EYES:
            session.save_facts(usable_eyes=plan.usable_eyes)
        return plan
    facts = session.contents.facts
    name: PlanName = "recommended" if facts.plan == "recommended" else "paper"
    return replace(plan, name=name, usable_eyes=facts.usable_eyes, in_turn=facts.plan == "each")


def open_camera(settings: StationSettings, simulation: Simulation | None, worn_rig: Rig) -> Camera:
    """Open a station's camera.

    Parameters
    ----------
    settings : StationSettings
    simulation : Simulation or None
        What the simulated camera sees; None without the virtual headset.
    worn_rig : Rig
        Rig of the headset actually worn, with the simulated camera's intrinsics.

    Raises
    ------
    CameraError
        If it cannot be opened.
    FileError
        If the recording cannot be read.
    """
    if settings.source == "realsense":
        return RealSenseCamera(settings.realsense)
    if settings.source == "hololens2":
        return open_hololens2(settings.hololens2)
    if settings.source in ("oak", "orbbec"):
        return open_live(f"{settings.source}:{settings.serial}")
    if settings.source == "recording":
        return open_recording(Path(settings.recording), settings.playback)
    if simulation is None:
        raise CameraError("the simulated camera needs the virtual headset, with its wearer")
    return SyntheticCamera(
        simulation.world,
        simulation.scene,
        depth_intrinsics=worn_rig.depth_intrinsics,
        seed=settings.seed,
        settings=replace(
            CAMERA_FAULTS.get(settings.fault, SyntheticSettings()),
            sensor=sensor_settings(settings.sensor, settings.fatten_px),
        ),
    )


def start_headset(
    settings: StationSettings,
    rig_path: Path,
    worn_rig_path: Path,
    port: int,
    pairing_key: str,
    scene_port: int,
) -> VirtualHeadset:
    """Start the virtual headset's process.

    Parameters
    ----------
    settings : StationSettings
    rig_path, worn_rig_path : Path
        The rig used by the headset, and the rig of the headset actually worn.
    port, scene_port : int
        Of the PC's end of the link, and of the simulated camera, on this machine.
    pairing_key : str
    """
    return VirtualHeadset(
        rig_path,
        port,
        scene_port,
        pairing_key,
        seed=settings.seed,
        worn_rig_path=worn_rig_path,
        loss=settings.loss,
        reorder=settings.reorder,
        is_stale=settings.fault == "stale-headset",
        loses_start=settings.fault == "lost-start",
        steps_clock=settings.fault == "clock-step",
        eye_distance_m=settings.eye_distance_m,
        side=settings.side,
        slip_m=settings.slip_m,
    )


def _lab_fuse(settings: StationSettings) -> FuseSettings:
    """Return the priors for a new session, learned from the lab's earlier ones if wanted.

    One whose mean is far from the viewpoint is only shown, unless somebody has confirmed it.
    """
    fuse = settings.calibration.solve.fuse
    if not (settings.learn_prior or settings.learn_wearers):
        return fuse
    prior, sitting = fuse.prior, fuse.sitting
    rig = read_rig(settings.rig_path)
    found = run_learn_prior(settings.sessions_path, rig, prior)
    if settings.learn_prior and prior.learned is None and found.learned is not None:
        if settings.use_far_prior or not found.learned.warning:
            prior = replace(prior, learned=found.learned)
        else:
            prior = replace(prior, unconfirmed=found.learned)
    if settings.learn_wearers and sitting.learned is None:
        sitting = replace(sitting, learned=fit_wearers(found.repeated, sitting_prior(rig, sitting)))
    return replace(fuse, prior=prior, sitting=sitting)


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
        if is_virtual:
            pairings = new_pairing_key()
        if isinstance(pairings, str):
            pairings = Pairings((Pairing(pairings),))
        self._pairings = pairings
        self.watch_views = False
        self._watchers: list[Callable[[Snapshot], object]] = []
        self.holds_plan = False
        self._simulation: Simulation | None = None
        with ExitStack() as stack:
            self.session, settings = stack.enter_context(
                resume_or_create(settings, wearer, resume, begun)
            )
            self.settings = settings
            self.rig = self.worn_rig = self.session.contents.rig
            rig_path = self.session.path / "rig.yaml"
            worn_rig_path = Path(settings.worn_rig or rig_path)
            bind = LOOPBACK if is_virtual else (settings.host, settings.port)
            self._link = stack.enter_context(HeadsetServer(pairings, bind))
            if is_virtual:
                port, key = self._link.address[1], pairings.all[-1].key
                start = partial(start_headset, settings, rig_path, worn_rig_path, port, key)
                self._simulation = stack.enter_context(
                    Simulation(settings.seed, start, settings.side)
                )
                self.worn_rig = read_rig(worn_rig_path)
            # Not methods of the station: with it, its parts would be kept until Python collects
            # garbage, and beside a window's many objects ended stations piled up.
            camera = partial(open_camera, settings, self._simulation, self.worn_rig)
            self._feed = stack.enter_context(CameraFeed(camera))
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
        observation = self._advance(self._feed.read())
        self.trials.follow_procedure()
        self._store_waiting()
        if observation is not None and observation.hand is not None:
            self._show(observation.hand)
        snapshot = self._make_snapshot(observation)
        for watcher in self._watchers:
            watcher(snapshot)
        return snapshot

    def _advance(self, frame: Frame | None) -> Observation | None:
        """Take a frame through the procedure by the plan; return what it shows."""
        if frame is not None:
            self._frame, self.calibration.camera = frame, self._feed.status.identity
        try:
            with suppress(FileError):  # `_store_waiting` reports it
                self.plan.advance(frame, is_held=self.holds_plan)
        except LinkError as error:
            self._not_applied = str(error)
        # An automatic plan sends them again at once; the reason lasts until it has succeeded.
        if self.calibration.state not in (State.SOLVED, State.APPLYING):
            self._not_applied = ""
        if frame is None or (observation := self.plan.observation) is None:
            return None
        self._feed.expose_for(None if observation.cloud is None else observation.cloud.points_m)
        return observation

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
            next_step=self.plan.step,
            not_applied=self._not_applied,
            not_stored=self._not_stored,
            contradiction=self._contradiction(observation),
            # A view of what the headset draws would reveal which drawing is shown.
            views={} if self.trials.compared else dict(self._views.shown),
            comparing=self.trials.compared,
            has_compared_both=self.trials.has_compared_both,
            trial_eye=next(iter(self.trials.target_E_m), None),
        )

    def watch(self, watcher: Callable[[Snapshot], object]) -> None:
        """Call `watcher` with every new snapshot, in the station's thread; it must not wait."""
        self._watchers.append(watcher)

    def take_step(self) -> None:
        """Take the next step of a plan that is held.

        Raises
        ------
        ProcedureError
            If it cannot be taken yet.
        LinkError
            If the link is closed.
        """
        with suppress(FileError):  # the step is done anyway
            self.plan.advance(None, is_pressed=True)
        step = self.plan.step
        if step is None:
            raise ProcedureError("wait for the camera's first frame")
        if step.name in (StepName.RAISE, StepName.WAIT):
            raise ProcedureError(step.text)

    def finish(self) -> None:
        """Record the link statistics and finish the session; FileError if it cannot be written."""
        self.trials.hide_target()
        self.trials.end_comparison()
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

    def _show(self, hand: PlacedHand) -> None:
        """Show the live hand in the headset, and render the wearer's views if requested."""
        if self.calibration.state is State.APPLIED:
            # The wearer judges the calibration by this outline on their own hand.
            outline_W_m = transform(hand.T_W_D, hand.cloud.outline_m)
            self._link.send_live_hand(outline_W_m, False, is_outline=True)
        if self.watch_views and not self.trials.compared:
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
