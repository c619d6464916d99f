"""How a RealSense is run, as options of commands."""

from __future__ import annotations

import argparse
from dataclasses import fields
from typing import get_args

from handcal.camera.settings import Preset, Profile, RealSenseSettings
from handcal.cli.terminal import Parser, number


def add_realsense_options(command: Parser) -> None:
    """Add an option for every field of `RealSenseSettings`."""
    command.add_argument("--serial", default="", help="of the RealSense; the first if absent")
    command.add_argument("--profile", choices=get_args(Profile), default="auto", help="size")
    command.add_argument("--preset", choices=get_args(Preset), help="the SDK's visual preset")
    positive = number(float, 0.0, 1e6)
    command.add_argument("--exposure-us", type=positive, help="of the depth; automatic if absent")
    command.add_argument("--laser-power-mw", type=positive, help="of the projector")
    for name in ("spatial-filter", "temporal-filter", "hole-filling"):
        command.add_argument(f"--{name}", action="store_true", help="the SDK's, on the depth")


def realsense_of(arguments: argparse.Namespace) -> RealSenseSettings:
    """Return the settings that the options describe."""
    names = [field.name for field in fields(RealSenseSettings)]
    return RealSenseSettings(**{name: getattr(arguments, name) for name in names})
