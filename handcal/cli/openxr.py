"""``handcal openxr``: the calibrated eyes in every OpenXR program of this user."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, save
from handcal.cli.terminal import arg, command, flag

if TYPE_CHECKING:
    from handcal.export.openxr import InForce

_NOT_INSTALLED = "The layer is not installed; install it: handcal openxr install"


@command()
def install(_: argparse.Namespace) -> None:
    """Have every OpenXR program of this user render with the calibration in force."""
    from handcal.export.openxr import OFF, install_layer

    manifest = install_layer()
    console.print(
        f"Installed ({manifest}): every OpenXR program that you start from now on loads handcal's "
        "layer, which gives it the calibrated eyes and the runtime its own views.\n"
        f"{OFF}=1 in a program's environment keeps the layer out of it; handcal openxr remove ends "
        "it for all.\nCalibrate now; then put the calibration in force: handcal openxr use SESSION",
        markup=False,
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

    _say_in_force(use_calibration(Session.open(arguments.session), keep=arguments.keep))
    if not layer_status().is_installed:
        console.print(_NOT_INSTALLED)


@command(json=True)
def status(arguments: argparse.Namespace) -> None:
    """Show whether the layer is installed, whose calibration is in force, and what it last did."""
    from handcal.export.openxr import layer_status

    found = layer_status()
    save(arguments.json, asdict(found))
    if not found.is_installed:
        console.print(_NOT_INSTALLED)
    elif not found.is_current:
        console.print("Installed, of another handcal; run handcal openxr install again.")
    else:
        console.print("Installed: every OpenXR program of this user loads the layer.")
    if found.in_force is None:
        console.print("No calibration is in force; choose one: handcal openxr use SESSION")
    else:
        _say_in_force(found.in_force)
    if last := found.last_program:
        console.print(
            f"Last program: {last.application} on {last.system} ({last.runtime}), "
            f"{_duration(last.age_s)} ago: {last.state}{last.reason and f', {last.reason}'}",
            markup=False,
        )


def _say_in_force(one: InForce) -> None:
    if one.left_s is None:
        end = "kept until it is replaced or the rig changes"
    elif one.left_s > 0.0:
        end = f"for {_duration(one.left_s)} more, or until a session begins"
    else:
        end = "expired; calibrate again"
    console.print(
        f"In force: {one.wearer or 'unnamed wearer'}, {one.headset}, session {one.session}, "
        f"{_duration(one.age_s)} old, {end}.",
        markup=False,
    )


def _duration(time_s: float) -> str:
    minutes = round(time_s / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60.0:.1f} h"
