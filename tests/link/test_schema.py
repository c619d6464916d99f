from pathlib import Path

import pytest

import handcal.link

FOLDER = Path(handcal.link.__file__).parent


def test_the_generated_code_is_that_of_the_schema(tmp_path: Path) -> None:
    protoc = pytest.importorskip("grpc_tools.protoc")
    arguments = [f"-I{FOLDER}", f"--python_out={tmp_path}", f"--pyi_out={tmp_path}"]
    assert protoc.main(["protoc", *arguments, str(FOLDER / "handcal.proto")]) == 0
    for name in ("handcal_pb2.py", "handcal_pb2.pyi"):
        assert (tmp_path / name).read_text() == (FOLDER / name).read_text(), f"regenerate {name}"
