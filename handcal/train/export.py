"""Export of the trained network as ONNX: with 32-bit floats, and quantised to 8-bit integers.

``python -m handcal.train.export --data DIR``
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from handcal.cli.terminal import Parser, errors_in_one_line
from handcal.hand.detect import DetectSettings, import_onnxruntime, letterbox
from handcal.hand.shipped import FLOAT_MODEL, INTEGER_MODEL
from handcal.lab.evaluate.annotations import Photo, read_annotations
from handcal.train.loop import read_average
from handcal.train.model import HandNet

import_onnxruntime()
from onnxruntime.quantization import (  # noqa: E402 (after its telemetry is off)
    CalibrationDataReader,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process  # noqa: E402

_OPSET = 17
_CALIBRATED = 200


@errors_in_one_line()
def main() -> None:
    """Export the averaged weights of the last checkpoint."""
    parser = Parser(prog="python -m handcal.train.export", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="oxford_hands: train and val")
    parser.add_argument("--folder", type=Path, default=Path(".training"), help="working files")
    parser.add_argument("--output", type=Path, default=Path("resources"))
    arguments = parser.parse_args()
    net = read_average(arguments.folder)
    train = arguments.data / "train"
    photos = read_annotations(train, train / "annotations.json")
    export_float(net, arguments.output / FLOAT_MODEL)
    export_integer(arguments.output / FLOAT_MODEL, arguments.output / INTEGER_MODEL, photos)


class _Camera(nn.Module):
    """The network fed with a camera's own images: (1, H, W, 3) uint8."""

    def __init__(self, net: HandNet) -> None:
        super().__init__()
        self._net = net

    def forward(self, image: Tensor) -> Tensor:
        raw: Tensor = self._net(image.float().permute(0, 3, 1, 2))
        return raw[0]


def export_float(net: HandNet, path: Path) -> None:
    """Write the network with input ``image`` (1, H, W, 3) uint8 and output ``raw`` (5, N)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the older exporter, which needs fewer packages
        torch.onnx.export(
            _Camera(net).eval().cpu(),
            (torch.zeros(1, 256, 320, 3, dtype=torch.uint8),),
            str(path),
            input_names=["image"],
            output_names=["raw"],
            dynamic_axes={"image": {1: "height", 2: "width"}, "raw": {1: "points"}},
            opset_version=_OPSET,
            dynamo=False,
        )


def export_integer(float_path: Path, path: Path, photos: Sequence[Photo]) -> None:
    """Quantise an exported network: static, QDQ, one scale per channel of the weights.

    Parameters
    ----------
    float_path, path : Path
    photos : sequence of Photo
        A few hundred, which determine the value ranges between the layers.
    """
    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(float_path), str(prepared), skip_symbolic_shape=True)
        nodes = [node.name for node in onnx.load(prepared).graph.node]
        quantize_static(
            str(prepared),
            str(path),
            _Calibration(photos[:: max(1, len(photos) // _CALIBRATED)]),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            reduce_range=True,
            op_types_to_quantize=["Conv", "Clip", "Add", "Resize"],
            # Logits and logarithms of distances have no common range, and with three channels
            # integers are not faster.
            nodes_to_exclude=[name for name in nodes if "predict" in name or "stem" in name],
        )


class _Calibration(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, photos: Sequence[Photo]) -> None:
        self._inputs = self._read(photos)

    def get_next(self) -> dict[str, Any] | None:
        return next(self._inputs, None)

    @staticmethod
    def _read(photos: Sequence[Photo]) -> Iterator[dict[str, Any]]:
        for photo in photos:
            canvas, _ = letterbox(photo.read(), DetectSettings().pixels)
            yield {"image": np.ascontiguousarray(canvas[None])}


if __name__ == "__main__":
    main()
