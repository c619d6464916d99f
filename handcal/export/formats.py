"""The formats of an export, without their writers: quick to import."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

Format: TypeAlias = Literal[
    "report", "html", "csv", "yaml", "json", "ply", "zip", "unity", "openxr", "northstar", "slicer"
]


@dataclass(frozen=True, slots=True)
class FormatInfo:
    """Title of a format, and the patterns of its file names in the export's folder."""

    title: str
    patterns: tuple[str, ...]


FORMATS: Mapping[Format, FormatInfo] = MappingProxyType(
    {
        "report": FormatInfo("Report (PDF)", ("report.pdf",)),
        "html": FormatInfo("Report (HTML)", ("report.html", "figures/*.png", "figures/*.csv")),
        "csv": FormatInfo(
            "Parameters and trials (CSV)", ("parameters.csv", "trials.csv", "comparisons.csv")
        ),
        "yaml": FormatInfo("Calibration (OpenCV YAML)", ("calibration.yaml",)),
        "json": FormatInfo(
            "Matrices for OpenCV, OpenGL, Unity, OpenXR (JSON)", ("calibration.json",)
        ),
        "ply": FormatInfo(
            "Clouds (PLY)", ("clouds/alignment-*-cursor.ply", "clouds/alignment-*-hand.ply")
        ),
        "zip": FormatInfo("Whole session (ZIP)", ("session.zip",)),
    }
)
"""The formats of an export if none are named."""

TOOL_FORMATS: Mapping[Format, FormatInfo] = MappingProxyType(
    {
        "unity": FormatInfo("Unity", ("unity.json",)),
        "openxr": FormatInfo("OpenXR", ("openxr.json",)),
        "northstar": FormatInfo("North Star (Monado)", ("northstar.json", "northstar_mesh.json")),
        "slicer": FormatInfo(
            "3D Slicer",
            (
                "slicer/*EyeToHead.tfm",
                "slicer/alignment-*-hand.vtk",
                "slicer/alignment-*-cursor.vtk",
            ),
        ),
    }
)
"""The formats for one other tool each, written only if they are named."""
