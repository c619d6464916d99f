"""``handcal demo, headset``: a simulated wearer."""

from __future__ import annotations

import argparse
from pathlib import Path

from handcal.cli.output import console, progress, save, table, triple
from handcal.io.files import make_folder


def demo(arguments: argparse.Namespace) -> None:
    """Calibrate a simulated wearer from start to end, and judge the result by the truth."""
    from handcal.cli.demo import DemoSettings, run_demo

    settings = DemoSettings(
        seed=arguments.seed,
        alignments=arguments.alignments,
        eyes=arguments.eyes,
        loss=arguments.loss,
        reorder=arguments.reorder,
        worn_rig=str(arguments.worn_rig or ""),
    )
    with progress() as report:
        result = run_demo(settings, _rig_path(arguments.rig), make_folder(arguments.output), report)
    save(arguments.json, result)
    shown_table = table("eye", "φ solved, mm", "± σ, mm", "true φ, mm", "off by", "verdict")
    for eye, found in result["eyes"].items():
        triples = [triple(found[key]) for key in ("shift_mm", "sigma_mm", "true_shift_mm")]
        shown_table.add_row(eye, *triples, f"{found['error_mm']:.1f}", found["verdict"])
    console.print(shown_table)
    for eye, found in result["eyes"].items():
        console.print(f"{eye}: {found['verdict']}: {found['reason']}")
    error, guard = result["reprojection_arcmin"], result["guard"]
    console.print(
        f"Reprojection error: {error['before']:.1f}′ before, {error['after']:.1f}′ after\n"
        f"Confirmations refused for a turned hand: {guard['rejected']}; "
        f"accepted at up to {guard['accepted_deg']:.1f}°\n"
        f"Session: {result['session']}"
    )


def headset(arguments: argparse.Namespace) -> None:
    """Wear the virtual headset: a process that speaks the real datagrams, with a wearer in it."""
    from handcal.link.impair import Impairment
    from handcal.link.pairing import read_pairing_key
    from handcal.sim.headset import HeadsetSettings, run_headset, until_terminated

    settings = HeadsetSettings(
        rig_path=str(_rig_path(arguments.rig)),
        worn_rig_path=str(arguments.worn_rig or ""),
        host=arguments.host,
        port=arguments.port,
        scene_port=arguments.scene_port,
        seed=arguments.seed,
        impairment=Impairment(
            loss=arguments.loss,
            duplicate=arguments.duplicate,
            reorder=arguments.reorder,
            delay_s=arguments.delay_ms / 1e3,
            seed=arguments.seed,
        ),
        clock_offset_s=arguments.clock_offset_ms / 1e3,
        duration_s=arguments.duration_s,
    )
    run_headset(settings, read_pairing_key(arguments.key_file), until_terminated())


def _rig_path(rig: Path | None) -> Path:
    from handcal.io.resources import resource_path

    return rig or resource_path("example_rig.yaml")
