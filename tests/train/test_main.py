from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

from handcal.train.__main__ import main


def run(patch: pytest.MonkeyPatch, *words: str | Path) -> int | str | None:
    """Return the exit code of the command line."""
    patch.setattr("sys.argv", ["train", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_missing_data_is_reported_in_one_line_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, folder = tmp_path / "nothing", tmp_path / "work"
    assert run(monkeypatch, "--data", data, "--model", "x.onnx", "--folder", folder) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"handcal: cannot read {data}")
    assert said.count("\n") == 1
    assert not folder.exists()
