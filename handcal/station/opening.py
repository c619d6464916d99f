"""The parts that a station opens: session with prior and plan, camera, and virtual headset."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from handcal.calibration.former import Former
from handcal.calibration.lab_prior import run_learn_prior
from handcal.calibration.plan import PlanSettings
from handcal.calibration.solve_again import stored_solve_settings
from handcal.camera.camera import Camera
from handcal.camera.live import open_hololens2, open_live
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import open_recording
from handcal.core.errors import CameraError, FileError
from handcal.core.types import EYES, PlanName, Rig
from handcal.io.settings import settings_json
from handcal.register.fuse import FuseSettings
from handcal.register.prior import fit_wearers
from handcal.register.sitting import sitting_prior
from handcal.rig.rig_file import read_rig
from handcal.session.in_force import end_at_begin
from handcal.session.journal import JOURNAL, JOURNAL_END
from handcal.session.record import replay
from handcal.session.session import Session
from handcal.session.state import SessionEvent
from handcal.sim.camera import (
    CAMERA_FAULTS,
    SyntheticCamera,
    SyntheticSettings,
    sensor_settings,
)
from handcal.sim.simulation import Simulation, VirtualHeadset
from handcal.station.settings import StationSettings

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
    ports: tuple[int, int],
    pairing_key: str,
) -> VirtualHeadset:
    """Start the virtual headset's process.

    Parameters
    ----------
    settings : StationSettings
    rig_path, worn_rig_path : Path
        The rig used by the headset, and the rig of the headset actually worn.
    ports : tuple of int
        Ports of the PC's end of the link and of the simulated camera, on this machine.
    pairing_key : str
    """
    port, scene_port = ports
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
