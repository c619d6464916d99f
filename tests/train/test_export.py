from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")
import onnxruntime
import torch

from handcal.core.types import Float32, UInt8
from handcal.hand.detect import points
from handcal.hand.shipped import FLOAT_MODEL
from handcal.io.resources import resource_path
from handcal.lab.evaluate.annotations import Photo
from handcal.train.export import export_integer
from handcal.train.model import HandNet


def seen(image: UInt8) -> torch.Tensor:
    return torch.from_numpy(image).permute(0, 3, 1, 2).float()


def run(model: Path, image: UInt8) -> Float32:
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    [raw] = session.run(["raw"], {"image": image})
    return np.asarray(raw, np.float32)


def test_the_exported_network_computes_the_same(
    net: HandNet, float_model: Path, noise: UInt8
) -> None:
    image = noise[:1]
    with torch.inference_mode():
        expected, other = (net(seen(view))[0].numpy() for view in (image, image[..., ::-1].copy()))
    raw = run(float_model, image)
    assert raw.shape == (5, len(points(96, 64)[0]))
    assert raw == pytest.approx(expected, abs=1e-3)
    assert np.abs(raw - other).mean() > 0.1  # with red and blue exchanged


def test_integers_come_close_in_a_third_of_the_bytes(tmp_path: Path, noise: UInt8) -> None:
    float_model = resource_path(FLOAT_MODEL)  # random weights would make much of little errors
    cv2.imwrite(str(tmp_path / "a.png"), noise[0])
    photo = Photo(
        tmp_path / "a.png", 64, 96, np.zeros((0, 4)), np.zeros((0, 4, 2)), np.zeros(0, bool)
    )
    integer_model = tmp_path / "integer.onnx"
    export_integer(float_model, integer_model, [photo])
    assert integer_model.stat().st_size < 0.35 * float_model.stat().st_size
    floats = run(float_model, noise[:1])
    assert np.abs(run(integer_model, noise[:1]) - floats).mean() < 0.2 * floats.std()
