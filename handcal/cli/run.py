"""``handcal run``: a calibration without a window."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.cameras import GATE, REALSENSE_OPTIONS, gate_of, realsense_of
from handcal.cli.output import console, save, show_progress, table, triple, until_interrupted
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    number,
    patience,
    seed,
    value,
)
from handcal.core.errors import HandcalError, LinkError
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.bridge.bridges import BridgeSettings
    from handcal.link.pairing import Pairings

LISTEN = (
    arg("--host", default="0.0.0.0", metavar="ADDRESS", help="address to listen on"),  # noqa: S104
    value("--port", number(int, 1, 65535), "N", "UDP port", default=47800),
)
KEYS = file_option(
    "--keys",
    "file of the paired headsets (default: the key in the environment variable "
    "HANDCAL_PAIRING_KEY, else the file of the desktop program)",
)
SENSOR_OPTIONS = (
    arg(
        "--sensor",
        choices=("d415", "ahat", "exact"),
        default="d415",
        help="the simulated depth camera: a stereo camera with its faults at edges, a "
        "time-of-flight camera, or a stereo camera whose edges are right",
    ),
    value(
        "--fatten-px",
        number(float, 0.0, 20.0),
        "P",
        "by how much the edges of near surfaces grow in the depth image, in its pixels",
    ),
)
ALIGNMENT_OPTIONS = (
    value(
        "--alignments",
        number(int, 1, 20),
        "K",
        "number of alignments; with --eyes each, of each eye",
        default=1,
    ),
    arg(
        "--eyes",
        choices=("both", "each", "left", "right"),
        default="both",
        help="align both eyes at once, each eye alone, or the only usable eye",
    ),
)
CONTRADICTED = 3
"""Exit code of a calibration with evidence against its result."""
_SHARE = number(float, 0.0, 1.0)


@command(
    arg(
        "--headset",
        choices=("network", "virtual"),
        required=True,
        help="a paired headset that connects; or the virtual one, with a simulated wearer",
    ),
    arg(
        "--camera",
        metavar="SOURCE",
        required=True,
        help="realsense; hololens2:HOST, the headset's own, by hl2ss; oak or orbbec, also with "
        ":SERIAL; simulator, with the virtual headset; or the path of a recording, which is played "
        "in a loop",
    ),
    file_option("--rig", "rig file of this headset", required=True),
    arg(
        "--plan",
        choices=("paper", "recommended"),
        default="paper",
        help="paper: as many alignments as --alignments says, with the hand where it is held; "
        "recommended: the most informative alignments, then a verification of each eye",
    ),
    *ALIGNMENT_OPTIONS,
    arg("--wearer", default="", metavar="NAME", help="name or code of the wearer"),
    folder_option("--output", "folder in which the session is created", default=Path("sessions")),
    *LISTEN,
    KEYS,
    patience("for the wearer and the headset to do one step"),
    seed("the simulated wearer"),
    value("--loss", _SHARE, "P", "virtual headset: share of datagrams lost", default=0.0),
    value("--reorder", _SHARE, "P", "virtual headset: share of datagrams reordered", default=0.0),
    arg(
        "--slicer",
        nargs="?",
        const="127.0.0.1:18944",
        metavar="HOST:PORT",
        help="serve OpenIGTLink for 3D Slicer (default address: 127.0.0.1:18944)",
    ),
    flag("--lsl", "send the events to the Lab Streaming Layer"),
    GATE,
    *REALSENSE_OPTIONS,
    example="handcal run --headset network --camera realsense --rig rig.yaml --wearer P7 --plan "
    "recommended",
    json=True,
)
def run(arguments: argparse.Namespace) -> None:
    """Calibrate one wearer without a window, for scripts and for testing headset apps."""
    from handcal.bridge.bridges import open_bridges
    from handcal.register.verdict_words import VERDICT_WORDS
    from handcal.station.run import RunSettings, run_calibration
    from handcal.station.settings import StationSettings, with_gate, with_source

    station = StationSettings(
        realsense=realsense_of(arguments),
        headset=arguments.headset,
        host=arguments.host,
        port=arguments.port,
        rig=str(arguments.rig),
        seed=arguments.seed,
        loss=arguments.loss,
        reorder=arguments.reorder,
        sessions=str(make_folder(arguments.output)),
    )
    station = with_source(station, arguments.camera)
    if arguments.gate is not None:
        station = with_gate(station, gate_of(arguments))
    settings = RunSettings(
        station,
        arguments.wearer,
        arguments.plan,
        arguments.alignments,
        arguments.eyes,
        arguments.patience_s,
    )
    pairings = paired_headsets(arguments.keys) if arguments.headset == "network" else None
    with (
        until_interrupted() as is_stopped,
        open_bridges(bridges_of(arguments), _tell) as watchers,
        show_progress(is_stopped) as progress,
    ):
        result = run_calibration(settings, progress, pairings, watchers)
    save(arguments.json, result)
    shown_table = table("eye", "φ solved, mm", "± σ, mm", "verdict", "headset applied it")
    for eye, found in result["eyes"].items():
        shift, sigma = triple(found["shift_mm"]), triple(found["sigma_mm"])
        is_applied = "yes" if found["projection_acked"] else "no"
        shown_table.add_row(eye, shift, sigma, VERDICT_WORDS[found["verdict"]], is_applied)
    console.print(shown_table)
    for eye, found in result["eyes"].items():
        console.print(f"{eye}: {VERDICT_WORDS[found['verdict']]}: {found['reason']}", markup=False)
    if lost := result["link"]["given_up"]:
        listed = ", ".join(f"{name.replace('_', ' ')} {count}×" for name, count in lost.items())
        console.print(f"The headset never acknowledged: {listed}")
    console.print(f"Session: {result['session']}")
    if any(found["verdict"] == "contradicted" for found in result["eyes"].values()):
        sys.exit(CONTRADICTED)


def bridges_of(arguments: argparse.Namespace) -> BridgeSettings:
    """Return the settings of the bridges that the arguments name."""
    from handcal.bridge.bridges import BridgeSettings

    if arguments.slicer is None:
        return BridgeSettings(lsl=arguments.lsl)
    host, _, port = arguments.slicer.rpartition(":")
    if not (host and port.isdecimal() and 0 < int(port) < 65536):
        fail(f"--slicer: an address is HOST:PORT, not {arguments.slicer}", 2)
    return BridgeSettings(host, int(port), arguments.lsl)


def _tell(line: str) -> None:
    console.print(line)


def paired_headsets(path: Path | None) -> Pairings:
    """Return the headsets that may connect: of a file, or one with the key in the environment.

    Raises HandcalError if there is none.
    """
    from handcal.link.pairing import KEY_VARIABLE, Pairing, Pairings, pairing_file

    key = os.environ.get(KEY_VARIABLE, "")
    if path is not None or not key:
        pairings = Pairings.read(path or pairing_file())
        if not pairings.all:
            raise HandcalError("no headset is paired", "pair one with handcal pair")
        return pairings
    try:
        return Pairings((Pairing(key),))
    except ValueError as error:
        raise LinkError(f"{error}", f"see {KEY_VARIABLE}") from error
