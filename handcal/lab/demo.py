"""A complete calibration of a simulated wearer, operated by a script.

The wearer and the headset run in a separate process, and reach the engine only through rendered
frames and real datagrams. The true eye positions are drawn again from the seed afterwards, to
measure the error of the result.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from handcal.calibration.evidence import Contradiction
from handcal.calibration.former import SLIP_M
from handcal.calibration.plan import PlanSettings, with_eyes
from handcal.calibration.procedure import Calibration
from handcal.calibration.states import Observation
from handcal.core.display import reprojection_arcmin
from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, DepthEdges, Eye, EyeDistance, EyePlan, Float64, PlanName, Rig
from handcal.register.prior import eye_position_m
from handcal.register.solve import solve_alignment
from handcal.rig.rig_file import read_rig, write_rig
from handcal.sim.hand import Side
from handcal.sim.sensor import EDGE_SIGMA_PX, PHASE_BORDER_PX, SensorName, border_px, fatten_of
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings
from handcal.station.faults import Fault
from handcal.station.follow import Patience, deliver, follow_plan
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station

# A slow computer gets more time.
_PATIENCE = Patience(60.0, frames=300)
_RULER_SIGMA_M = 0.001
_RULER, _SLIP, _CHECK = 1, 2, 3  # their random numbers are not the wearer's
_LASTING_S = 4.0
"""Passing evidence, such as a late camera on a busy computer, counts if it lasts this long."""


@dataclass(frozen=True, slots=True)
class DemoSettings:
    """Settings of the demonstration."""

    seed: int = 1
    """Seed of the wearer, the hand, the room and all noise."""
    plan: PlanName = "paper"
    alignments: int = 1
    """Number of alignments of the paper's plan; of each eye, if `eyes` is ``"each"``. The
    recommended plan makes its own choice."""
    eyes: EyePlan = "both"
    """Only one for a wearer who sees with one eye."""
    verify: bool = True
    """True if each eye is verified at the end of the recommended plan."""
    former: str = ""
    """Path of a stored session whose φ to start from; empty: the offline calibration."""
    slipped: bool = False
    """True if the headset has slipped since the session `former`, by a movement drawn from the
    seed."""
    side: Side | None = None
    """The hand that is raised; None: drawn from the seed."""
    loss: float = 0.0
    reorder: float = 0.0
    """Share of the link's datagrams lost, and reordered, in each direction."""
    worn_rig: str = ""
    """Path of the rig that the wearer really looks through; empty: the rig of the calibration."""
    fault: Fault = ""
    """Fault of the camera or the headset; empty: none."""
    sensor: SensorName = "d415"
    """The kind of simulated camera."""
    fatten_px: float | None = None
    """As in `StationSettings`."""
    is_fat_known: bool = False
    """True if the rig knows the camera's edges, as from a depth check."""
    eye_distance: Literal["none", "ruler", "headset"] = "none"
    """Measurement of the wearer's eye distance, with 1 mm of error: typed, or by the headset."""


def run_demo(
    settings: DemoSettings, rig_path: Path, output: Path, progress: Progress
) -> dict[str, Any]:
    """Calibrate one simulated wearer, and compare the result with the truth.

    Parameters
    ----------
    settings : DemoSettings
    rig_path : Path
    output : Path
        Folder in which the session is created.
    progress : Progress
        Called with the current step and the share of the whole that is done.

    Returns
    -------
    dict
        JSON-able: see docs/commands.md.

    Raises
    ------
    HandcalError
        If the headset does not answer, the wearer does not finish a step, or the disk is full.
    """
    worn_rig = read_rig(Path(settings.worn_rig or rig_path))
    measured = (
        None if settings.eye_distance == "none" else measure_eye_distance(settings.seed, worn_rig)
    )
    station_settings = StationSettings(
        rig=str(rig_path),
        worn_rig=settings.worn_rig,
        seed=settings.seed,
        loss=settings.loss,
        reorder=settings.reorder,
        fault=settings.fault,
        sensor=settings.sensor,
        fatten_px=settings.fatten_px,
        eye_distance_m=(
            measured.value_m if measured and settings.eye_distance == "headset" else None
        ),
        sessions=str(output),
        side=settings.side,
        slip_m=_slip_m(settings),
        plan=with_eyes(_plan(settings), settings.eyes),
    )
    former = Path(settings.former) if settings.former else None
    with ExitStack() as stack:
        if settings.is_fat_known:
            folder = Path(stack.enter_context(TemporaryDirectory()))
            write_rig(folder / "rig.yaml", _checked(read_rig(rig_path), settings))
            station_settings = replace(station_settings, rig=str(folder / "rig.yaml"))
        station = stack.enter_context(Station(station_settings, "Simulated wearer", former=former))
        if settings.eye_distance == "ruler":
            station.calibration.set_eye_distance(measured)
        begun_m = dict(station.calibration.applied_shift_m)
        watch = _Watch(station.calibration)
        station.watch(watch.see)
        try:
            follow_plan(station, _PATIENCE, progress)
            seconds = watch.seconds
            delivered = deliver(station)
        except ContradictedError as error:
            return _contradicted(station, settings, error.contradiction)
        station.finish()
    calibration, rig, statistics = station.calibration, station.rig, delivered.link
    return {
        "seed": settings.seed,
        "session": str(station.session.path),
        "alignments": len(calibration.alignments),
        "plan": settings.plan,
        "seconds": seconds,
        **_judge(calibration, station, settings, begun_m),
        "guard": {
            "rejected": delivered.record.refused,
            "accepted_deg": max(
                (
                    float(np.degrees(np.linalg.norm(alignment.rotation_rad)))
                    for alignment in calibration.alignments.values()
                ),
                default=None,
            ),
        },
        "link": {
            "sent": statistics.sent,
            "lost": statistics.lost,
            "acked": statistics.acked,
            "given_up": dict(statistics.given_up),
            "projection_acked": calibration.projection_acked,
        },
        "timing_ms": _timing(calibration, rig, watch.seen),
    }


class ContradictedError(HandcalError):
    """Evidence that ends the calibration."""

    def __init__(self, contradiction: Contradiction) -> None:
        super().__init__(contradiction.text)
        self.contradiction = contradiction


def _contradicted(
    station: Station, settings: DemoSettings, contradiction: Contradiction
) -> dict[str, Any]:
    """Return the report of a calibration that ended without an alignment."""
    station.session.save_facts(evidence=(contradiction.name,), contradictions=(contradiction.text,))
    return {
        "seed": settings.seed,
        "session": str(station.session.path),
        "alignments": 0,
        "eyes": {
            eye: {
                "verdict": "contradicted",
                "reason": contradiction.text,
                "evidence": [contradiction.name],
            }
            for eye in EYES
        },
    }


def _checked(rig: Rig, settings: DemoSettings) -> Rig:
    """Return the rig with its camera's edges, as a depth check finds them."""
    found_px = border_px(fatten_of(settings.sensor, settings.fatten_px))
    if settings.sensor == "ahat":
        found_px = PHASE_BORDER_PX
    error_px = np.random.default_rng([settings.seed, _CHECK]).normal(0.0, EDGE_SIGMA_PX)
    edges = DepthEdges(found_px + error_px, EDGE_SIGMA_PX, "measured", views=10, made="simulated")
    return replace(rig, depth_edges=edges)


def _slip_m(settings: DemoSettings) -> tuple[float, float, float]:
    """Return how the headset has slipped, E axes."""
    if not settings.slipped:
        return 0.0, 0.0, 0.0
    x_m, y_m, z_m = np.random.default_rng([settings.seed, _SLIP]).normal(0.0, SLIP_M)
    return float(x_m), float(y_m), float(z_m)


def _true_eye_distance_m(seed: int, worn_rig: Rig) -> float:
    left_m, right_m = (
        eye_position_m(worn_rig.eyes[eye], shift_m)
        for eye, shift_m in draw_eyes(np.random.default_rng(seed), WearerSettings()).items()
    )
    return float(np.linalg.norm(right_m - left_m))


def measure_eye_distance(seed: int, worn_rig: Rig) -> EyeDistance:
    """Return the wearer's eye distance as measured with an error drawn from the seed.

    Raises HandcalError if the worn rig's is not a person's.
    """
    error = np.random.default_rng([seed, _RULER]).normal()
    true_m = _true_eye_distance_m(seed, worn_rig)
    try:
        return EyeDistance(true_m + error * _RULER_SIGMA_M)
    except ValueError as problem:
        raise HandcalError(f"no person can wear this rig: {problem}") from problem


def _plan(settings: DemoSettings) -> PlanSettings:
    """Return the plan; that of the paper has no verification unless it starts from a session."""
    return PlanSettings(
        settings.plan,
        is_automatic=True,
        verify=settings.verify and (settings.plan == "recommended" or bool(settings.former)),
        alignments=settings.alignments,
    )


@dataclass(slots=True)
class _Watch:
    """Watches a station step by step."""

    calibration: Calibration
    seen: list[Observation] = field(default_factory=list)
    began_s: float | None = None
    fine_s: float = field(default_factory=time.monotonic)
    """Time of the newest frame without evidence against it."""

    @property
    def seconds(self) -> float:
        """Time since the first sight of the hand."""
        return 0.0 if self.began_s is None else time.monotonic() - self.began_s

    def see(self, snapshot: Snapshot) -> None:
        """Take a snapshot; ContradictedError if evidence lets no alignment be taken."""
        observation, now_s = snapshot.observation, time.monotonic()
        if observation is None:
            return
        self.seen.append(observation)
        if self.began_s is None and observation.hand is not None:
            self.began_s = now_s
        passing = observation.contradiction
        if passing is None:
            self.fine_s = now_s
        found = [*self.calibration.evidence.contradictions]
        if passing is not None and now_s - self.fine_s > _LASTING_S:
            found.append(passing)
        if found and not self.calibration.alignments:
            raise ContradictedError(found[0])


def _judge(
    calibration: Calibration,
    station: Station,
    settings: DemoSettings,
    begun_m: Mapping[Eye, Float64],
) -> dict[str, Any]:
    """Compare the result with the wearer's true eyes."""
    assert calibration.results is not None
    results, rig, worn_rig = calibration.results, station.rig, station.worn_rig
    # Drawn as by the virtual headset.
    wearer = WearerSettings(slip_m=_slip_m(settings))
    eyes_m = draw_eyes(np.random.default_rng(settings.seed), wearer)
    measured = results.measured_eye_distance
    # Relative to the rig's C0, which differs from the true one.
    truth_m = {
        eye: shift_m + rig.eyes[eye].t_C0_V_m - worn_rig.eyes[eye].t_C0_V_m
        for eye, shift_m in eyes_m.items()
    }
    nothing_m = {eye: np.zeros(3) for eye in EYES}
    solved_m = nothing_m | {eye: shift.shift_m for eye, shift in results.eyes.items()}
    drawn_m = dict(calibration.applied_shift_m)
    states_m = {"before": nothing_m, "begun": begun_m, "after": solved_m, "drawn": drawn_m}

    def errors_arcmin(eyes: Sequence[Eye]) -> dict[str, float]:
        return {
            name: reprojection_arcmin(rig, one_m, eyes_m, worn_rig, eyes)
            for name, one_m in states_m.items()
        }

    return {
        "eyes": {
            eye: {
                "shift_mm": (1e3 * shift.shift_m).tolist(),
                "true_shift_mm": (1e3 * truth_m[eye]).tolist(),
                "sigma_mm": (1e3 * np.sqrt(np.diag(shift.covariance_m2))).tolist(),
                "error_mm": float(1e3 * np.linalg.norm(shift.shift_m - truth_m[eye])),
                "verdict": results.verdicts[eye].name,
                "reason": results.verdicts[eye].reason,
                "evidence": [
                    *(one.name for one in calibration.evidence.contradictions),
                    *calibration.results.evidence,
                ],
                "verified": _verified(calibration, eye),
                "depth": asdict(results.benefits[eye].depth),
                "by_distance": [asdict(one) for one in results.benefits[eye].by_distance],
                "reprojection_arcmin": errors_arcmin((eye,)),
            }
            for eye, shift in results.eyes.items()
        },
        "eye_distance": {
            "true_m": _true_eye_distance_m(settings.seed, worn_rig),
            "used": None if measured is None else asdict(measured),
        },
        "reprojection_arcmin": errors_arcmin(EYES),
    }


def _verified(calibration: Calibration, eye: Eye) -> dict[str, Any] | None:
    """Return the wearer's verification of an eye, None if there is none."""
    found = calibration.verifications.get(eye)
    if found is None or calibration.results is None:
        return None
    checked = calibration.results.verified.get(eye)
    if checked is None:  # nothing was moved
        return None
    return {
        "nudge_arcmin": list(found.nudge_arcmin),
        "nudge_size": found.nudge_size,
        "before_arcmin": checked.before_arcmin,
        "after_arcmin": checked.now_arcmin,
        "moved_arcmin": checked.moved_arcmin,
        "moved_size": checked.moved_size,
        "changed_arcmin": checked.changed_arcmin,
    }


def _timing(
    calibration: Calibration, rig: Rig, observations: list[Observation]
) -> dict[str, float | None]:
    """Return the median milliseconds of each stage.

    Segmentation and guard as they ran, beside the virtual headset and the rendering.
    """
    solve_ms = []
    for alignment in calibration.alignments.values():
        started_s = time.perf_counter()
        solve_alignment(replace(alignment, eyes=EYES), rig)
        solve_ms.append(1e3 * (time.perf_counter() - started_s))
    segment_ms = [seen.segment_ms for seen in observations if seen.hand is not None]
    guard_ms = [seen.guard_ms for seen in observations if seen.guard_ms is not None]
    return {
        "segment": float(np.median(np.array(segment_ms, dtype=float))),
        "guard": float(np.median(np.array(guard_ms, dtype=float))) if guard_ms else None,
        "solve_both_eyes": float(np.median(solve_ms)) if solve_ms else None,
    }
