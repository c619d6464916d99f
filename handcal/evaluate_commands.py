"""``handcal evaluate …``: how well handcal does on given data.

Commands import what they need when they run.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from handcal.files import make_folder
from handcal.terminal import Commands, add_command, console, progress, save, table


def detector(arguments: argparse.Namespace) -> None:
    """Measure on annotated photographs how well hands are found."""
    from handcal.detector import load_detector
    from handcal.evaluate.annotations import read_annotations
    from handcal.evaluate.contact_sheet import write_contact_sheet
    from handcal.evaluate.detector import SCORE_MIN, detect_all, evaluation
    from handcal.hand.detect import DetectSettings, HandDetector

    settings = DetectSettings(score_min=SCORE_MIN)
    model = arguments.model
    finder = load_detector(settings) if model is None else HandDetector(model, settings)
    photos = read_annotations(arguments.images, arguments.annotations)
    with progress() as report:
        results = detect_all(photos, finder, lambda share: report("Looking for hands", share))
    result = evaluation(photos, results)
    save(arguments.json, result)
    if arguments.sheet is not None:
        make_folder(arguments.sheet.parent)
        write_contact_sheet(arguments.sheet, photos, results)
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


def add_evaluate_commands(commands: Commands) -> None:
    """Add ``handcal evaluate detector``."""
    one = add_command(commands, detector)
    one.add_argument("--images", type=Path, required=True, help="folder of photographs")
    one.add_argument("--annotations", type=Path, required=True, help="JSON: the hands in them")
    one.add_argument("--sheet", type=Path, metavar="FILE", help="picture of the worst failures")
    one.add_argument("--model", type=Path, metavar="FILE", help="ONNX; the shipped one if absent")
