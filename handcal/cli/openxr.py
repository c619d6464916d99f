"""``handcal openxr``: the calibrated eyes in every OpenXR program of this user."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from handcal.cli.output import console, save
from handcal.cli.terminal import arg, command, flag


@command()
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


@command()
def remove(_: argparse.Namespace) -> None:
    """Remove the layer and end the calibration in force."""
    from handcal.export.openxr import remove_layer

    console.print("Removed." if remove_layer() else "The layer was not installed.")


@command(
    arg("session", type=Path, help="session folder"),
    flag("--keep", "until it is replaced or the rig changes, not for 12 hours of one wearer"),
)
def use(arguments: argparse.Namespace) -> None:
    """Put a session's final calibration in force for OpenXR programs."""
    from handcal.export.openxr import layer_status, use_calibration
    from handcal.session.session import Session

    use_calibration(Session.open(arguments.session), keep=arguments.keep)
    for line in layer_status().lines[:2]:
        console.print(line)


@command(json=True)
def status(arguments: argparse.Namespace) -> None:
    """Show whether the layer is installed, whose calibration is in force, and what it last did."""
    from handcal.export.openxr import layer_status

    found = layer_status()
    save(arguments.json, asdict(found))
    for line in found.lines:
        console.print(line)
