"""``handcal openxr``: the calibrated eyes in every OpenXR program of this user."""

from __future__ import annotations

import argparse
import os
from dataclasses import asdict
from pathlib import Path

from handcal.cli.output import console, save, until_interrupted
from handcal.cli.terminal import arg, command, file_option, flag


@command(example="handcal openxr install")
def install(_: argparse.Namespace) -> None:
    """Have every OpenXR program of this user render with the calibration in force."""
    from handcal.export.openxr import OFF, install_layer

    manifest = install_layer()
    console.print(
        f"Installed ({manifest}): every OpenXR program that you start from now on loads handcal's "
        "layer, which gives it the calibrated eyes and the runtime its own views.\n"
        f"{OFF}=1 in a program's environment keeps the layer out of it; handcal openxr remove ends "
        "it for all.\nCalibrate now; then put the calibration in force: handcal openxr use SESSION"
    )


@command(example="handcal openxr remove")
def remove(_: argparse.Namespace) -> None:
    """Remove the layer and end the calibration in force."""
    from handcal.export.openxr import remove_layer

    console.print("Removed." if remove_layer() else "The layer was not installed.")


@command(
    arg("session", type=Path, help="session folder"),
    flag("--keep", "until it is replaced or the rig changes, not for 12 hours of one wearer"),
    example="handcal openxr use sessions/NAME",
)
def use(arguments: argparse.Namespace) -> None:
    """Put a session's final calibration in force for OpenXR programs."""
    from handcal.export.openxr import layer_status, use_calibration
    from handcal.session.session import Session

    use_calibration(Session.open(arguments.session), keep=arguments.keep)
    for line in layer_status().lines[:2]:
        console.print(line)


@command(example="handcal openxr status", json=True)
def status(arguments: argparse.Namespace) -> None:
    """Show whether the layer is installed, whose calibration is in force, and what it last did."""
    from handcal.export.openxr import layer_status

    found = layer_status()
    save(arguments.json, asdict(found))
    for line in found.lines:
        console.print(line, markup=False)


@command(
    arg(
        "address",
        nargs="?",
        default="127.0.0.1",
        metavar="HOST[:PORT]",
        help="the computer that runs handcal (default: this one, port 47800)",
    ),
    file_option(
        "--key-file",
        "pairing key of another computer (default: HANDCAL_PAIRING_KEY, else paired with this one)",
    ),
    example="handcal openxr client",
)
def client(arguments: argparse.Namespace) -> None:
    """Be the headset of a calibration, on any OpenXR headset of this computer."""
    from handcal.link.pairing import KEY_VARIABLE, Pairings, pairing_file, read_pairing_key
    from handcal.openxr_client.client import paired_identity, run_openxr_client
    from handcal.station.settings import DEFAULT_PORT

    host, colon, port = arguments.address.rpartition(":")
    if not colon or not port.isdecimal() or (":" in host and not host.endswith("]")):
        host, port = arguments.address, str(DEFAULT_PORT)
    if arguments.key_file or os.environ.get(KEY_VARIABLE):
        device_id, key = "", read_pairing_key(arguments.key_file)
    else:
        device_id, key = paired_identity(Pairings.read(pairing_file()))
    console.print(
        "Enter or space, a controller's trigger or a pinch of the other hand confirms; in the "
        "window, arrows, + and - move the drawing, and Esc ends.",
        markup=False,
    )
    with until_interrupted() as is_stopped:
        run_openxr_client((host.strip("[]"), int(port)), key, device_id, is_stopped)
