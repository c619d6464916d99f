from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")
import onnxruntime
import torch

from handcal.detector import FLOAT_MODEL
from handcal.errors import FileError
from handcal.evaluate.annotations import Photo
from handcal.hand.detect import points
from handcal.resources import resource_path
from handcal.train.export import export_float, export_integer
from handcal.train.loop import read_average
from handcal.train.model import HandNet
from handcal.types import Float32, UInt8

RNG = np.random.default_rng(0)
IMAGE: UInt8 = RNG.integers(0, 256, (1, 96, 64, 3), np.uint8)


@pytest.fixture(scope="module")
def net() -> HandNet:
    """Return a network that what it sees makes a difference to, unlike an untrained one."""
    torch.manual_seed(0)
    net = HandNet()
    for module in net.modules():
        if isinstance(module, torch.nn.Conv2d):
            torch.nn.init.kaiming_normal_(module.weight)
        if isinstance(module, torch.nn.BatchNorm2d):
            module.momentum = None  # the moments of the one image
    net.train()(seen(IMAGE))
    net.bake()
    return net.eval()


def seen(image: UInt8) -> torch.Tensor:
    return torch.from_numpy(image).permute(0, 3, 1, 2).float()


@pytest.fixture(scope="module")
def float_model(net: HandNet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("models") / "float.onnx"
    export_float(net, path)
    return path


def run(model: Path) -> Float32:
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    [raw] = session.run(["raw"], {"image": IMAGE})
    return np.asarray(raw, np.float32)


def test_the_exported_network_computes_the_same(net: HandNet, float_model: Path) -> None:
    with torch.inference_mode():
        expected, other = (
            net(seen(image))[0].numpy() for image in (IMAGE, IMAGE[..., ::-1].copy())
        )
    raw = run(float_model)
    assert raw.shape == (5, len(points(96, 64)[0]))
    assert raw == pytest.approx(expected, abs=1e-2)
    assert np.abs(raw - other).mean() > 0.1  # with red and blue exchanged


def test_integers_come_close_in_a_third_of_the_bytes(tmp_path: Path) -> None:
    float_model = resource_path(FLOAT_MODEL)  # random weights would make much of little errors
    cv2.imwrite(str(tmp_path / "a.png"), IMAGE[0])
    photo = Photo(
        tmp_path / "a.png", 64, 96, np.zeros((0, 4)), np.zeros((0, 4, 2)), np.zeros(0, bool)
    )
    integer_model = tmp_path / "integer.onnx"
    export_integer(float_model, integer_model, [photo])
    assert integer_model.stat().st_size < 0.35 * float_model.stat().st_size
    floats = run(float_model)
    assert np.abs(run(integer_model) - floats).mean() < 0.2 * floats.std()


def test_without_training_there_is_nothing_to_export(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="train first"):
        read_average(tmp_path)
