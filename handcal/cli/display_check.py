"""``handcal rig display-check``: the check that a headset draws what it is sent."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from handcal.cli.output import console
from handcal.cli.run import KEYS, LISTEN, paired_headsets
from handcal.cli.terminal import (
    arg,
    command,
    eyes_of,
    eyes_option,
    file_option,
    number,
    output_file,
    patience,
    value,
)
from handcal.core.errors import HandcalError
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.core.types import Eye, Rig
    from handcal.link.server import HeadsetServer
    from handcal.rig.displays.display_check import Probe
    from handcal.station.checks.display_check import Answer, Observe, Show

_MODES = "obeys", "no-override", "one-for-both", "depth", "infinity", "image-plane"


@command(
    file_option("--rig", "rig file of this headset", required=True),
    output_file("--output", "rig file to write", required=True),
    arg(
        "--headset",
        choices=("network", "virtual"),
        default="network",
        help="a paired headset that connects; or a simulated one in front of a simulated camera",
    ),
    value(
        "--viewpoint",
        number(int, 0, 99),
        "N",
        "number of the viewpoint camera (default: ask who looks through the display)",
    ),
    eyes_option("the eyes to check"),
    arg(
        "--mode",
        choices=_MODES,
        default="obeys",
        help="what the simulated headset does with the projection; see docs/offline.md",
    ),
    patience("until a headset connects"),
    *LISTEN,
    KEYS,
    example="handcal rig display-check --rig rig.yaml --output checked.yaml",
)
def display_check(arguments: argparse.Namespace) -> None:
    """Check that a connected headset draws what it is sent, and store the check in a rig file."""
    from handcal.rig.findings import display_finding
    from handcal.rig.rig_file import read_rig, write_rig
    from handcal.station.checks.display_check import run_display_check

    rig = read_rig(arguments.rig)
    with ExitStack() as stack:
        if arguments.headset == "virtual":
            server, observe = stack.enter_context(_simulated(rig, arguments.mode))
        else:
            server = stack.enter_context(network_server(arguments))
            observe = stack.enter_context(_observer(arguments.viewpoint))
        is_asked = arguments.headset == "network" and arguments.viewpoint is None
        made = run_display_check(
            server, rig, observe, "wearer" if is_asked else "camera", eyes=eyes_of(arguments)
        )
    finding = display_finding(made)
    console.print(f"{'good' if finding.is_fine else 'bad'}: {finding.found}")
    make_folder(arguments.output.parent)
    write_rig(arguments.output, replace(rig, display_check=made))
    console.print(str(arguments.output))
    if not finding.is_fine:
        raise HandcalError("the headset does not draw what it is sent", "see above")


@contextmanager
def _simulated(rig: Rig, mode: str) -> Iterator[tuple[HeadsetServer, Observe]]:
    from handcal.core.types import HeadsetIdentity
    from handcal.link.client import HeadsetClient
    from handcal.link.pairing import new_device_id, new_pairing_key
    from handcal.link.server import HeadsetServer
    from handcal.sim.display import DISPLAY_MODES, SimulatedDisplay
    from handcal.station.checks.display_check import by_camera

    key = new_pairing_key().encode()
    identity = HeadsetIdentity(new_device_id(), "Simulated display", "simulator", mode)
    with (
        HeadsetServer(key) as server,
        HeadsetClient(server.address, key, identity) as client,
    ):
        server.wait_connected(10.0)
        camera = SimulatedDisplay(client, rig, next(one for one in DISPLAY_MODES if one == mode))
        yield server, by_camera(camera, camera.place, settle_s=0.0)


@contextmanager
def network_server(arguments: argparse.Namespace) -> Iterator[HeadsetServer]:
    """Yield the link once a paired headset has connected."""
    from handcal.link.server import HeadsetServer

    with HeadsetServer(paired_headsets(arguments.keys), (arguments.host, arguments.port)) as server:
        console.print("Waiting for the headset")
        server.wait_connected(arguments.patience_s)
        yield server


@contextmanager
def _observer(viewpoint: int | None) -> Iterator[Observe]:
    from handcal.camera.viewpoint import open_viewpoint
    from handcal.station.checks.display_check import by_camera, by_wearer

    if viewpoint is None:
        yield by_wearer(_ask)
        return

    def ready(eye: Eye) -> None:
        console.input(f"Put the camera before the {eye} eye's display, then press Enter ")

    with open_viewpoint(viewpoint) as camera:
        yield by_camera(camera, ready)


def _ask(eye: Eye, probe: Probe, show: Show) -> Answer:
    """Ask the person at the display how far the square has moved."""
    answers: dict[str, Answer] = {"1": "whole", "2": "part", "3": "none"}
    console.print(f"Look at the square through the {eye} display ({probe}).")
    while True:
        console.input("Press Enter, and watch how far it moves to the right ")
        show(probe)
        typed = console.input("1: its own width  2: less or more  3: not at all  Enter: again ")
        if typed.strip() in answers:
            return answers[typed.strip()]
        show("rest")
