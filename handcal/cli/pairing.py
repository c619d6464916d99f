"""``handcal pair, devices``: headsets that may connect to this computer."""

from __future__ import annotations

import argparse

from handcal.cli.output import console, show_progress, table, until_interrupted
from handcal.cli.run import LISTEN
from handcal.cli.terminal import arg, command, fail, file_option, number, value

_KEYS = file_option("--keys", "file of the paired headsets (default: that of the desktop program)")


@command(
    _KEYS,
    *LISTEN,
    value("--minutes", number(float, 0.01, 10.0), "M", "give up after this time", default=10.0),
    example="handcal pair",
)
def pair(arguments: argparse.Namespace) -> None:
    """Pair a headset: show a QR code and a short code, and wait for the headset."""
    from handcal.link.invitation import Invitation, qr_lines
    from handcal.link.inviting import run_pairing
    from handcal.link.pairing import Pairings, pairing_file

    def show(invitation: Invitation) -> None:
        for line in qr_lines(invitation.text):
            console.print(line, style="black on white")
        digits = invitation.digits
        console.print(
            f"Scan this code with the headset, or type {invitation.text}\n"
            f"or let the headset find this computer ({invitation.host}, port {invitation.port}) "
            f"and type {digits[:4]} {digits[4:]}"
        )

    pairings = Pairings.read(arguments.keys or pairing_file())
    with until_interrupted() as is_stopped, show_progress(is_stopped) as progress:
        bind = (arguments.host, arguments.port)
        paired = run_pairing(bind, pairings, show, progress, 60.0 * arguments.minutes)
    console.print(f"Paired: {paired.name or 'a headset'} ({paired.device_id})")


@command(
    _KEYS,
    arg("--rename", nargs=2, metavar=("DEVICE", "NAME"), help="give a headset another name"),
    arg("--revoke", metavar="DEVICE", help="forget a headset; its session ends"),
    example="handcal devices --rename 3f2a Blue",
)
def devices(arguments: argparse.Namespace) -> None:
    """List the paired headsets; rename or revoke one, by its identity."""
    from handcal.link.pairing import Pairings, pairing_file

    pairings = Pairings.read(arguments.keys or pairing_file())
    try:
        if arguments.rename:
            pairings.rename(*arguments.rename)
        if arguments.revoke:
            pairings.revoke(arguments.revoke)
    except ValueError as error:
        fail(str(error), 2)
    shown = [one for one in pairings.all if one.device_id]
    if not shown:
        console.print("No headset is paired; pair one with handcal pair")
        return
    listed = table("device", "name")
    for one in shown:
        listed.add_row(one.device_id, one.name)
    console.print(listed)
