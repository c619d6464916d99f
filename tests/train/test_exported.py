from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")
import torch

from handcal.core.errors import FileError
from handcal.core.types import UInt8
from handcal.io.resources import resource_path
from handcal.train.model import HandNet, load_exported


@pytest.fixture(scope="module")
def again(float_model: Path) -> HandNet:
    again = HandNet()
    load_exported(again, float_model)
    return again.eval()


def test_what_was_exported_computes_the_same_again(
    net: HandNet, again: HandNet, noise: UInt8
) -> None:
    images = torch.from_numpy(noise).permute(0, 3, 1, 2).float()
    with torch.inference_mode():
        expected, other, found = net(images), net(images.flip(1)), again(images)
    assert found.numpy() == pytest.approx(expected.numpy(), abs=1e-2)
    assert (expected - other).abs().mean() > 0.1  # with red and blue exchanged


def test_levels_go_on_sharing_their_convolutions(again: HandNet) -> None:
    first, other, _ = (dict(tower.named_parameters()) for tower in again.towers)
    assert other["0.0.weight"] is first["0.0.weight"]


@pytest.mark.parametrize("content", [b"", b"no model", b"\x08\x07"])
def test_a_file_of_something_else_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"other\.onnx holds another network"):
        load_exported(HandNet(), path)


def test_the_model_of_integers_is_refused() -> None:
    with pytest.raises(FileError, match="holds another network"):
        load_exported(HandNet(), resource_path("hand_detector_int8.onnx"))
