"""``handcal demo, headset``: a simulated wearer."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from handcal.cli.output import console, save, show_progress, table, triple, until_interrupted
from handcal.cli.run import ALIGNMENT_OPTIONS, CONTRADICTED, SENSOR_OPTIONS
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    number,
    seed,
    settings_of,
    value,
)
from handcal.core.types import Eye, VerdictName
from handcal.io.files import make_folder
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.station.faults import Fault

if TYPE_CHECKING:
    from handcal.lab.demo import DemoSettings

FAULTS = [fault for fault in get_args(Fault) if fault]
_MEANINGS: Mapping[VerdictName, str] = {
    "accept": "the headset draws with this result, which is within the target and very probably "
    "better than none.",
    "repeat": "the headset draws with this result, which is not yet sure or precise enough to be "
    "accepted.",
    "keep": "the headset does not draw with this result but with the offline calibration, which "
    "is expected to err little here, or no more than this result.",
    "implausible": "the headset does not draw with this result, which cannot be right, but with "
    "the offline calibration.",
    "contradicted": "no result can be trusted, and the headset does not draw with one; the "
    "evidence is named above.",
}
_MAX_CODE = 1000
_SHARE = number(float, 0.0, 1.0)
_PORT = number(int, 1, 65535)
_RIG = file_option("--rig", "rig file (default: the shipped example)")
_HAND = arg(
    "--hand",
    dest="side",
    choices=("left", "right"),
    help="the raised hand (default: drawn from the seed)",
)
_LINK = (
    value("--loss", _SHARE, "P", "share of datagrams lost", default=0.0),
    value("--reorder", _SHARE, "P", "share of datagrams reordered", default=0.0),
)


@command(
    folder_option(
        "--output", "folder in which the session is created", default=Path("results/demo")
    ),
    seed("the wearer, hand, room and noise"),
    *ALIGNMENT_OPTIONS,
    arg(
        "--plan",
        choices=("paper", "recommended"),
        default="paper",
        help="the paper's alignments, or the recommended plan: cursors placed by the program, then "
        "a verification of each eye",
    ),
    arg(
        "--no-verify",
        dest="verify",
        action="store_false",
        help="end the recommended plan without verifying the eyes",
    ),
    arg(
        "--from",
        dest="former",
        type=Path,
        metavar="SESSION",
        help="start from a stored session of the same seed: verify it, and align again if needed",
    ),
    flag("--slipped", "with --from: the headset has slipped since that session"),
    _HAND,
    *_LINK,
    _RIG,
    file_option("--worn-rig", "true rig of the simulated headset (default: the same as --rig)"),
    *SENSOR_OPTIONS,
    flag(
        "--known-fat",
        "the rig knows how fat the camera's edges are, as from a depth check",
        dest="is_fat_known",
    ),
    arg(
        "--fault",
        choices=FAULTS,
        help="a fault that must not be accepted; depth-bias needs a rig with a depth check",
    ),
    arg(
        "--eye-distance",
        choices=("none", "ruler", "headset"),
        default="none",
        help="the wearer's eye distance, measured with 1 mm of error: by a ruler and typed, or by "
        "the headset",
    ),
    example="handcal demo --plan recommended --seed 7",
    json=True,
)
def demo(arguments: argparse.Namespace) -> None:
    """Calibrate a simulated wearer from start to end, and compare with the truth."""
    from handcal.core.types import EyeDistance
    from handcal.lab.demo import DemoSettings, run_demo

    if arguments.slipped and arguments.former is None:
        fail("--slipped needs --from SESSION", 2)
    settings = settings_of(DemoSettings, arguments)
    with until_interrupted() as is_stopped, show_progress(is_stopped) as progress:
        rig = _rig_path(arguments.rig)
        result = run_demo(settings, rig, make_folder(arguments.output), progress)
    save(arguments.json, result)
    if "reprojection_arcmin" not in result:
        _say_contradictions(result, settings)
    shown_table = table("eye", "φ solved, mm", "± σ, mm", "true φ, mm", "error, mm", "verdict")
    for eye, found in result["eyes"].items():
        triples = [triple(found[key]) for key in ("shift_mm", "sigma_mm", "true_shift_mm")]
        shown_table.add_row(
            eye, *triples, f"{found['error_mm']:.1f}", VERDICT_WORDS[found["verdict"]]
        )
    console.print(shown_table)
    for eye, found in result["eyes"].items():
        console.print(f"{eye}: {VERDICT_WORDS[found['verdict']]}: {found['reason']}")
    if used := result["eye_distance"]["used"]:
        console.print(f"Eye distance measured: {EyeDistance(**used)} ({used['source']})")
    for eye, found in result["eyes"].items():
        if checked := found["verified"]:
            console.print(
                f"{eye}: verified: {checked['before_arcmin']:.1f}′ measured before, "
                f"{checked['after_arcmin']:.1f}′ expected after"
            )
    error, guard = result["reprojection_arcmin"], result["guard"]
    accepted_deg = guard["accepted_deg"]
    rotation = "" if accepted_deg is None else f"; largest rotation accepted: {accepted_deg:.1f}°"
    console.print(
        f"Reprojection error: {error['before']:.1f}′ before, {error['after']:.1f}′ after; "
        f"the wearer's time: {result['seconds']:.1f} s\n"
        f"Confirmations refused: {guard['rejected']}{rotation}"
    )
    _say_meaning(result, settings)
    if any(found["verdict"] == "contradicted" for found in result["eyes"].values()):
        sys.exit(CONTRADICTED)


def _say_contradictions(result: dict[str, Any], settings: DemoSettings) -> None:
    """Say why there is no result, and end."""
    for reason in dict.fromkeys(found["reason"] for found in result["eyes"].values()):
        console.print(f"contradicted: {reason}")
    _say_meaning(result, settings)
    sys.exit(CONTRADICTED)


def _say_meaning(result: dict[str, Any], settings: DemoSettings) -> None:
    """Say what each verdict means and what to try next, and the session's folder."""
    verdicts = {eye: found["verdict"] for eye, found in result["eyes"].items()}
    for line in meanings(verdicts, settings, result["session"]):
        console.print(line)
    console.print(f"Session: {result['session']}")


def meanings(
    verdicts: Mapping[Eye, VerdictName], settings: DemoSettings, session: str
) -> list[str]:
    """Return what the verdicts of a demonstration mean and what to try next, one line for each.

    Parameters
    ----------
    verdicts : mapping of eye to verdict
        Of the eyes with a result.
    settings : DemoSettings
    session : str
        Path of the session's folder.
    """
    eyes_by_verdict: dict[VerdictName, list[Eye]] = {}
    for eye, verdict in verdicts.items():
        eyes_by_verdict.setdefault(verdict, []).append(eye)
    return [
        f"{'Both eyes' if len(eyes) > 1 else f'The {eyes[0]} eye'}, {VERDICT_WORDS[verdict]}: "
        f"{_MEANINGS[verdict]} {_next_step(verdict, settings, session)}"
        for verdict, eyes in eyes_by_verdict.items()
    ]


def _next_step(verdict: VerdictName, settings: DemoSettings, session: str) -> str:
    match verdict:
        case "accept":
            return f"Export it for your app: handcal export {session}"
        case "keep":
            return f"Try another wearer: handcal demo --seed {settings.seed + 1}"
        case "contradicted" if settings.fault:
            return f"Leave out --fault {settings.fault}: handcal demo --seed {settings.seed}"
        case "contradicted":
            return f"Do what it asks for, and try again: handcal demo --seed {settings.seed}"
        case "repeat" if settings.plan == "paper":
            return (
                "Try the plan that goes on until the result is accepted or says what is missing: "
                f"handcal demo --seed {settings.seed} --plan recommended"
            )
        case "repeat" if settings.eye_distance == "none":
            return (
                "Use it as it is, or measure the distance of the eyes, too: handcal demo "
                f"--seed {settings.seed} --plan recommended --eye-distance ruler"
            )
        case "repeat":
            return (
                "Use it as it is, do what the reason above says, or try another wearer: "
                f"handcal demo --seed {settings.seed + 1} --plan recommended"
            )
        case _:
            return f"Check that the rig is the headset's: handcal demo --seed {settings.seed}"


@command(
    value("--port", _PORT, "N", "port on which the PC listens"),
    flag("--pair", "pair first: type the text below the QR code, or with --port the 8 digits"),
    value(
        "--scene-port",
        _PORT,
        "N",
        "port of a simulated camera on this computer (default: no camera sees the wearer)",
    ),
    arg("--host", default="127.0.0.1", help="address of the PC"),
    file_option(
        "--key-file", "pairing key (default: the environment variable HANDCAL_PAIRING_KEY)"
    ),
    _RIG,
    file_option("--worn-rig", "true rig of the headset (default: the same as --rig)"),
    seed("the wearer"),
    *_LINK,
    value("--duplicate", _SHARE, "P", "share of datagrams duplicated", default=0.0),
    value("--delay-ms", number(float, 0.0, 10_000.0), "MS", "delay of every datagram", default=0.0),
    value(
        "--clock-offset-ms",
        number(float, -1e9, 1e9),
        "MS",
        "headset's clock minus the PC's",
        default=12345.0,
    ),
    value(
        "--duration-s",
        number(float, 0.0, 1e6),
        "S",
        "stop after this time (default: run until terminated)",
    ),
    flag("--lose-start", "fault: the first projections never arrive", dest="loses_start"),
    flag("--step-clock", "fault: after four seconds its clock is set by 0.3 s", dest="steps_clock"),
    flag(
        "--stale", "fault: keep drawing with the projections of the wearer before", dest="is_stale"
    ),
    value(
        "--eye-distance-mm",
        number(float, 45.0, 85.0),
        "MM",
        "the wearer's eye distance, as the headset reports it (default: not measured)",
    ),
    arg(
        "--slip-mm",
        type=number(float, -20.0, 20.0),
        nargs=3,
        metavar=("X", "Y", "Z"),
        default=(0.0, 0.0, 0.0),
        help="movement of the headset on the head, from the seed's position",
    ),
    _HAND,
    flag("--as-device", "no simulated wearer: print what is shown, confirm on Enter"),
    example="handcal headset --pair --host 192.168.1.20 --port 47800",
)
def headset(arguments: argparse.Namespace) -> None:
    """Run a virtual headset with a simulated wearer, connected by the real protocol."""
    from handcal.link.exchange import pair_by_code, pair_by_digits
    from handcal.link.impair import Impairment
    from handcal.link.invitation import read_invitation
    from handcal.link.pairing import new_device_id, read_pairing_key
    from handcal.sim.headset import HeadsetSettings, run_headset, until_terminated
    from handcal.sim.wearer_settings import WearerSettings

    host, port, device_id = arguments.host, arguments.port, ""
    if arguments.pair:
        console.print("Code: ", end="")
        code = sys.stdin.readline(_MAX_CODE).strip()
        device_id = new_device_id()
        if port is None:
            invited = read_invitation(code)
            host, port, key = invited.host, invited.port, pair_by_code(invited, device_id).encode()
        else:
            try:
                key = pair_by_digits((host, port), device_id, code).encode()
            except ValueError as error:
                fail(str(error), 2)
    elif port is not None:
        key = read_pairing_key(arguments.key_file)
    else:
        fail("give --port and a pairing key, or --pair", 2)
    x_mm, y_mm, z_mm = arguments.slip_mm
    settings = settings_of(
        HeadsetSettings,
        arguments,
        rig_path=str(_rig_path(arguments.rig)),
        worn_rig_path=str(arguments.worn_rig or ""),
        host=host,
        port=port,
        device_id=device_id,
        impairment=settings_of(Impairment, arguments, delay_s=arguments.delay_ms / 1e3),
        clock_offset_s=arguments.clock_offset_ms / 1e3,
        eye_distance_m=arguments.eye_distance_mm and arguments.eye_distance_mm / 1e3,
        wearer=WearerSettings(slip_m=(x_mm / 1e3, y_mm / 1e3, z_mm / 1e3)),
        has_wearer=not arguments.as_device,
    )
    run_headset(settings, key, until_terminated())


def _rig_path(rig: Path | None) -> Path:
    from handcal.io.resources import resource_path

    return rig or resource_path("example_rig.yaml")
