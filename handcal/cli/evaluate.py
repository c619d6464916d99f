"""``handcal evaluate detector, segmentation, users``: hand detector, segmentation, user test."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import get_args

from handcal.cli.output import console, save, show_progress, table
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    folder_option,
    number,
    output_file,
    settings_of,
    value,
)
from handcal.hand.settings import Roi
from handcal.io.files import make_folder, require_suffix


@command(
    arg(
        "folder",
        type=Path,
        nargs="?",
        help="folder of photographs with annotations.json; otherwise --images and --annotations",
    ),
    folder_option("--images", "folder of photographs"),
    file_option(
        "--annotations",
        "JSON with the hands in the photographs (default: annotations.json in the folder)",
    ),
    arg(
        "--brightness",
        type=number(float, 0.01, 10.0),
        default=1.0,
        help="factor on the pixels' values",
    ),
    value(
        "--hand-height",
        number(float, 0.05, 1.0),
        "SHARE",
        "show each photograph in a grey 640x480 image, with its first hand of this height",
    ),
    arg(
        "--glove",
        choices=("blue", "black"),
        help="recolour the hands of photographs on a white background",
    ),
    output_file("--sheet", "PNG with the worst failures"),
    file_option("--model", "ONNX model (default: the shipped one)"),
    example="handcal evaluate detector photographs --sheet errors.png",
    json=True,
)
def detector(arguments: argparse.Namespace) -> None:
    """Measure the hand detector's precision on annotated photographs."""
    from handcal.hand.detect import HandDetector
    from handcal.hand.shipped import load_detector
    from handcal.lab.evaluate.annotations import read_annotations
    from handcal.lab.evaluate.detector import (
        EVALUATED,
        Conditions,
        detect_all,
        evaluation,
        write_contact_sheet,
    )

    images = arguments.images or arguments.folder
    if images is None or (arguments.images and arguments.folder):
        fail("no photographs to measure; give one folder, or --images", 2)
    conditions = Conditions(arguments.brightness, arguments.hand_height, arguments.glove)
    if arguments.sheet is not None:  # before the long work, whose result would be lost
        require_suffix(arguments.sheet, ".png")
        make_folder(arguments.sheet.parent)
    model = arguments.model
    finder = load_detector(EVALUATED) if model is None else HandDetector(model, EVALUATED)
    photos = read_annotations(images, arguments.annotations or images / "annotations.json")
    with show_progress() as progress:
        results = detect_all(photos, finder, progress, conditions)
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
    shares = table("skin", "side", "hands", "found, score at least 0.3", "95 % interval")
    for share in result["found"]:
        shares.add_row(
            share["skin"] or "all",
            share["aspect"],
            str(share["hands"]),
            f"{100 * share['share']:.1f} %",
            f"{100 * share['low']:.1f} to {100 * share['high']:.1f} %",
        )
    console.print(shares)
    console.print(f"{result['hands']} hands in {result['images']} photographs")
    save(arguments.json, result)
    if arguments.sheet is not None:
        write_contact_sheet(arguments.sheet, photos, results)


@command(
    arg("folder", type=Path, help="folder of frames with true masks, and a meta.json"),
    arg(
        "--roi",
        choices=get_args(Roi),
        default="detector",
        help="hand to segment: where the detector sees one, or the nearest object by depth alone",
    ),
    output_file("--sheet", "PNG with all frames, masks and numbers"),
    folder_option("--output", "folder for a report (default: none)"),
    example="handcal evaluate segmentation frames --sheet masks.png",
    json=True,
)
def segmentation(arguments: argparse.Namespace) -> None:
    """Measure the segmentation of the hand on frames with true masks."""
    from handcal.lab.evaluate.segmentation import cell, frame_table, run_segmentation_test
    from handcal.lab.settings import SegmentationTestSettings

    with show_progress() as progress:
        settings = settings_of(SegmentationTestSettings, arguments)
        result = run_segmentation_test(settings, progress).figures
    save(arguments.json, result)
    frames = frame_table(result["rows"])
    shown_table = table(*(column.title for column in frames.columns))
    for cells in frames.rows:
        shown_table.add_row(*cells)
    console.print(shown_table)
    for row in result["rows"]:
        if row["refused"] is not None:
            console.print(f"{row['name']}: {row['refused']}")
    console.print(
        f"{result['frames']} frames, {result['refused']} refused. "
        f"IoU {cell(result['iou_mean'], 1, 3)}, at least {cell(result['iou_min'], 1, 3)}; "
        f"at least {cell(result['kept_min'], 100, 1)} % of the hand kept. Cut at the wrist: "
        f"SD {cell(result['wrist_sd_mm'], 1, 1)} mm, largest step "
        f"{cell(result['wrist_max_step_mm'], 1, 1)} mm. Area of cropped, scaled and sub-sampled "
        f"frames: at most {cell(result['area_change_max'], 100, 1)} % different; more than 10 % "
        f"in {result['area_changes_over_10_percent']} frames."
    )


@command(
    arg("folder", type=Path, nargs="+", help="session folder, or a folder of sessions"),
    folder_option("--output", "folder for the report", default=Path("results/users")),
    example="handcal evaluate users sessions --output report",
    json=True,
)
def users(arguments: argparse.Namespace) -> None:
    """Evaluate the user test: the errors that wearers saw after calibration."""
    from handcal.lab.evaluate.user_test import run_user_test
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
            name,
            str(errors.calibrations),
            str(errors.trials),
            mean_sd(errors.arcmin),
            interval_ends(errors.interval_arcmin),
        )
    console.print(shown_table)
    for path, why in result.left_out.items():
        console.print(f"Left out: {path}: {why}")
    console.print(found.report.lead)
    for file in found.files:
        console.print(str(file))
