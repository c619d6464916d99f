"""``handcal solve, export, inspect, session``: stored sessions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, save, show_progress, table, triple
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    folder_option,
    number,
    output_file,
    value,
)
from handcal.core.types import METHODS
from handcal.export.formats import FORMATS, TOOL_FORMATS
from handcal.session.record import SessionRecord

if TYPE_CHECKING:
    from handcal.register.prior import LearnedWearers

_METRES = number(float, 1e-3, 1e6)


@command(
    arg("session", type=Path, help="session folder"),
    arg("--method", choices=METHODS, help="solver (default: the session's own)"),
    value(
        "--eye-distance-mm",
        number(float, 45.0, 85.0),
        "MM",
        "the wearer's eye distance (default: the session's own)",
    ),
    value(
        "--eye-distance-sigma-mm",
        number(float, 0.01, 20.0),
        "MM",
        "its standard deviation",
        default=1.0,
    ),
    example="handcal solve sessions/NAME --method paper --json -",
    json=True,
)
def solve(arguments: argparse.Namespace) -> None:
    """Solve a stored session again; the session itself is not changed."""
    import numpy as np

    from handcal.calibration import solve_again
    from handcal.core.types import EyeDistance
    from handcal.register.results import results_json
    from handcal.register.verdict_words import VERDICT_WORDS
    from handcal.session.session import Session

    eye_distance = None
    if arguments.eye_distance_mm is not None:
        eye_distance = EyeDistance(
            arguments.eye_distance_mm / 1e3, arguments.eye_distance_sigma_mm / 1e3
        )
    record = Session.open(arguments.session)
    _say_what_is_left_out(record)
    results = solve_again.solve(record, method=arguments.method, eye_distance=eye_distance)
    for left in sorted(record.alignments.keys() - results.alignments.keys()):
        console.print(f"Left out: alignment {left}; handcal session check says why.")
    save(arguments.json, results_json(results))
    shown_table = table("eye", "φ, mm", "± σ, mm", "RMS, mm", "inliers", "verdict")
    for eye, shift in results.eyes.items():
        shown_table.add_row(
            eye,
            triple(1e3 * shift.shift_m),
            triple(1e3 * np.sqrt(np.diag(shift.covariance_m2))),
            f"{1e3 * shift.rms_m:.2f}",
            f"{100 * shift.inlier_ratio:.0f} %",
            VERDICT_WORDS[results.verdicts[eye].name],
        )
    console.print(shown_table)
    for eye, verdict in results.verdicts.items():
        console.print(f"{eye}: {VERDICT_WORDS[verdict.name]}: {verdict.reason}")
    if results.eye_distance_m is not None:
        console.print(f"Eye distance: {1e3 * results.eye_distance_m:.1f} mm")
    if measured := results.measured_eye_distance:
        console.print(f"Eye distance measured: {measured} ({measured.source})")


@command(
    arg("session", type=Path, nargs="+", help="session folder; several are also put together"),
    folder_option(
        "--output",
        "folder for the files; of several, each has its own in it (default: results/export/NAME, "
        "of several results/export/together)",
    ),
    arg(
        "--format",
        action="append",
        choices=(*FORMATS, *TOOL_FORMATS),
        help="format to write; may be repeated (default: all but unity, openxr, northstar and "
        "slicer)",
    ),
    value("--near-m", _METRES, "M", "near clipping plane for OpenGL, metres", default=0.1),
    value("--far-m", _METRES, "M", "far clipping plane for OpenGL, metres", default=100.0),
    file_option(
        "--into", "North Star configuration to write northstar into; its trackers stay in it"
    ),
    example="handcal export sessions/NAME --format report --format csv --output report",
)
def export(arguments: argparse.Namespace) -> None:
    """Export sessions: report, tables, calibration, clouds, and the session as one file."""
    from handcal.export.export import ExportSettings, export_session, export_sessions
    from handcal.export.north_star import replace_configuration
    from handcal.session.session import Session

    try:
        settings = ExportSettings(
            tuple(arguments.format or FORMATS),
            arguments.near_m,
            arguments.far_m,
            arguments.into,
        )
    except ValueError as error:
        fail(str(error), 2)
    if arguments.into and "northstar" not in settings.formats:
        fail("--into is for --format northstar", 2)
    if len(arguments.session) > 1:
        if arguments.into:
            fail("--into takes one session", 2)
        folder = arguments.output or Path("results/export/together")
        with show_progress() as progress:
            made = export_sessions(arguments.session, folder, settings, progress)
        for file in made.files:
            console.print(str(file))
        console.print(made.sentence)
        if made.missing:
            fail(f"not exported: {', '.join(made.missing)}", 1)
        return
    record = Session.open(arguments.session[0])
    _say_what_is_left_out(record)
    folder = arguments.output or Path("results/export") / record.path.absolute().name
    with show_progress() as progress:
        files = export_session(record, folder, settings, progress)
    for file in files:
        console.print(str(file))
    if arguments.into:
        kept = replace_configuration(arguments.into, folder / "northstar.json")
        console.print(f"{arguments.into}, as it was in {kept}")


@command(
    arg("session", type=Path, help="session folder"),
    example="handcal session check sessions/NAME",
    json=True,
)
def check(arguments: argparse.Namespace) -> None:
    """Check all of a session, and solve it; exit code 1 if any is bad, 2 if it is none."""
    from handcal.calibration.solve_again import check_solvable

    found = check_solvable(arguments.session)
    save(arguments.json, asdict(found))
    for damage in found.damaged:
        # The message that it is not a session names its folder itself.
        console.print(damage.text if found.state == "none" else str(damage), markup=False)
    if found.state == "sound":
        console.print("The session is sound.")
    elif found.state == "damaged":
        console.print("All else can be read; handcal session repair copies it.")
    sys.exit({"sound": 0, "damaged": 1, "none": 2}[found.state])


@command(
    arg("session", type=Path, help="session folder; it is not changed"),
    folder_option("--output", "new folder for the copy", required=True),
    file_option("--rig", "rig file, if the session's own is damaged"),
    example="handcal session repair sessions/NAME --output sessions/repaired",
)
def repair(arguments: argparse.Namespace) -> None:
    """Copy the sound parts of a damaged session into a new one."""
    from handcal.rig.rig_file import read_rig
    from handcal.session.repair import repair_session

    rig = read_rig(arguments.rig) if arguments.rig else None
    made = repair_session(arguments.session, arguments.output, rig)
    console.print(f"{made.path}: {len(made.alignments)} alignments, {len(made.trials)} trials")


def _say_what_is_left_out(record: SessionRecord) -> None:
    if record.torn_bytes:
        console.print("The journal's last line is incomplete, as after a crash, and was ignored.")
    if record.left_out:
        console.print(f"Left out: {record.left_out}.")


@command(
    arg("session", type=Path, help="session folder"),
    value(
        "--alignment", number(int, 1, 1000), "N", "the alignment shown first (default: the last)"
    ),
    output_file("--picture", "write a .png file instead of opening a window; needs no display"),
    example="handcal inspect sessions/NAME --picture view.png",
)
def inspect(arguments: argparse.Namespace) -> None:
    """Show a session's clouds, residuals, eyes and displays in a 3D window."""
    from handcal.export.outcome import load_outcome
    from handcal.export.window_3d import inspect_session
    from handcal.session.session import Session

    outcome = load_outcome(Session.open(arguments.session))
    inspect_session(outcome, arguments.alignment, arguments.picture)
    if arguments.picture:
        console.print(str(arguments.picture))


@command(
    arg("folder", type=Path, help="folder of sessions"),
    file_option("--rig", "rig file (default: the shipped example)"),
    example="handcal prior sessions --rig rig.yaml",
    json=True,
)
def prior(arguments: argparse.Namespace) -> None:
    """Show what finished sessions with one rig tell of eyes, and of what wearers see wrongly."""
    from dataclasses import asdict

    import numpy as np

    from handcal.calibration.lab_prior import run_learn_prior
    from handcal.core.errors import FileError
    from handcal.core.types import EYES
    from handcal.io.resources import resource_path
    from handcal.register.prior import (
        MIN_SESSIONS,
        PriorSettings,
        eye_prior,
        eye_slice,
        learn_wearers,
    )
    from handcal.register.sitting import SittingSettings, sitting_prior
    from handcal.rig.rig_file import read_rig

    if not arguments.folder.is_dir():
        raise FileError(
            f"{arguments.folder} is not a folder",
            "choose the one that holds sessions",
        )
    if (arguments.folder / "journal.jsonl").exists():
        raise FileError(
            f"{arguments.folder} is one session",
            "choose the folder above, which holds all sessions",
        )
    settings = PriorSettings()
    with show_progress() as progress:
        rig = read_rig(arguments.rig or resource_path("example_rig.yaml"))
        found = run_learn_prior(arguments.folder, rig, settings, progress.part(0.0, 0.5))
        sitting = sitting_prior(rig, SittingSettings())
        wearers = learn_wearers(found.repeated, sitting, progress.part(0.5, 1.0))
    learned = asdict(found.learned) if found.learned else None
    left_out = dict(found.left_out)
    save(
        arguments.json,
        {
            "used": found.used,
            "left_out": left_out,
            "learned": learned,
            "warning": found.learned.warning if found.learned else "",
            "wearers": asdict(wearers) if wearers else None,
        },
    )
    console.print(f"Sessions used: {found.used}")
    for reason, count in found.left_out.items():
        console.print(f"Left out: {count} {reason}")
    if found.learned is None:
        console.print(f"At least {MIN_SESSIONS} are needed; until then the default is used:")
    used = eye_prior(PriorSettings(learned=found.learned))
    sigma_mm = 1e3 * np.sqrt(np.diag(used.covariance_m2))
    shown = table("eye", "φ, mm", "± σ, mm")
    for eye in EYES:
        part = eye_slice(eye)
        shown.add_row(eye, triple(1e3 * used.mean_m[part]), triple(sigma_mm[part]))
    console.print(shown)
    if found.learned is not None and found.learned.warning:
        console.print(
            f"Not used before it is confirmed: {found.learned.warning}. If the headset does sit "
            "so, choose 'even if far' in the preferences."
        )
    _print_wearers(found.repeated, wearers)


def _print_wearers(repeated: Sequence[Sequence[object]], wearers: LearnedWearers | None) -> None:
    """Print what wearers see wrongly in a whole sitting, beside the default."""
    from math import radians

    from handcal.register.prior import MIN_PEOPLE, MIN_SITTINGS
    from handcal.register.sitting import SittingSettings

    sittings = sum(map(len, repeated))
    console.print(f"Repeated sittings: {sittings} of {len(repeated)} people")
    usual = SittingSettings()
    if wearers is None:
        console.print(
            f"What wearers always see wrongly takes {MIN_SITTINGS} sittings of {MIN_PEOPLE} people "
            "to learn; until then the default is used."
        )
        return
    arcmin = radians(1.0 / 60.0)
    rows = (
        ("direction, right", "′", arcmin, usual.direction_sigma_arcmin),
        ("direction, down", "′", arcmin, usual.direction_sigma_arcmin),
        ("size", " %", 0.01, 100.0 * usual.size_sigma),
    )
    shown = table("always seen wrongly", "σ", "95 % interval", "default")
    for (name, unit, one, default), sigma, low, high in zip(
        rows, wearers.sigma, wearers.sigma_low, wearers.sigma_high, strict=True
    ):
        interval = f"{low / one:.2f} to {high / one:.2f}{unit}"
        shown.add_row(name, f"{sigma / one:.2f}{unit}", interval, f"{default:g}{unit}")
    console.print(shown)
