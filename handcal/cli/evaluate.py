"""``handcal evaluate detector, users``: the hand detector and the user test."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from handcal.cli.output import console, save, show_progress, table
from handcal.cli.terminal import arg, command
from handcal.io.files import make_folder, require_suffix


@command(
    arg("--images", type=Path, metavar="FOLDER", required=True, help="folder of photographs"),
    arg(
        "--annotations",
        type=Path,
        metavar="FILE",
        required=True,
        help="JSON with the hands in the photographs",
    ),
    arg("--sheet", type=Path, metavar="FILE", help="PNG with the worst failures"),
    arg("--model", type=Path, metavar="FILE", help="ONNX model (default: the shipped one)"),
    json=True,
)
def detector(arguments: argparse.Namespace) -> None:
    """Measure the hand detector's precision on annotated photographs."""
    from handcal.hand.detect import HandDetector
    from handcal.hand.shipped import load_detector
    from handcal.lab.evaluate.annotations import read_annotations
    from handcal.lab.evaluate.contact_sheet import write_contact_sheet
    from handcal.lab.evaluate.detector import EVALUATED, detect_all, evaluation

    if arguments.sheet is not None:  # before the long work, whose result would be lost
        require_suffix(arguments.sheet, ".png")
        make_folder(arguments.sheet.parent)
    model = arguments.model
    finder = load_detector(EVALUATED) if model is None else HandDetector(model, EVALUATED)
    photos = read_annotations(arguments.images, arguments.annotations)
    with show_progress() as progress:
        results = detect_all(photos, finder, progress)
    result = evaluation(photos, results)
    shown_table = table("hands", "AP at IoU 0.5")
    for key, name in (
        ("ap50", "all"),
        ("ap50_large", "large, by the data set's rule"),
        ("ap50_rel15", "15 % of the image's side or more"),
        ("ap50_rel25", "25 % of the image's side or more"),
    ):
        shown_table.add_row(name, "–" if result[key] is None else f"{result[key]:.4g}")
    console.print(shown_table)
    console.print(f"{result['hands']} hands in {result['images']} photographs")
    save(arguments.json, result)
    if arguments.sheet is not None:
        write_contact_sheet(arguments.sheet, photos, results)


@command(
    arg("folder", type=Path, nargs="+", help="session folder, or a folder of sessions"),
    arg(
        "--output",
        type=Path,
        metavar="FOLDER",
        default=Path("results/users"),
        help="folder for the report",
    ),
    json=True,
)
def users(arguments: argparse.Namespace) -> None:
    """Evaluate the user test: the errors that wearers saw after calibration."""
    from handcal.lab.evaluate.run import run_user_test
    from handcal.lab.settings import UserTestSettings
    from handcal.report.cells import interval_ends, mean_sd

    settings = UserTestSettings(tuple(map(str, arguments.folder)), str(arguments.output))
    with show_progress() as progress:
        found = run_user_test(settings, progress)
    result = found.result
    save(arguments.json, asdict(result))
    shown_table = table("wearer", "calibrations", "trials", "mean ± SD, arcmin", "95 % interval")
    for name, errors in (*result.by_wearer.items(), ("all", result.total)):
        shown_table.add_row(
            escape(name),
            str(errors.calibrations),
            str(errors.trials),
            mean_sd(errors.arcmin),
            interval_ends(errors.interval_arcmin),
        )
    console.print(shown_table)
    for path, why in result.left_out.items():
        console.print(f"Left out: {path}: {why}", markup=False)
    console.print(found.report.lead)
    for file in found.files:
        console.print(str(file), markup=False)
