import pytest

from handcal.core.errors import FileError
from handcal.io.resources import resource_path


def test_a_shipped_file_is_found() -> None:
    assert resource_path("example_rig.yaml").read_text().startswith("%YAML")


def test_a_missing_one_says_what_to_do() -> None:
    with pytest.raises(FileError, match=r"nothing\.txt is missing; install handcal again"):
        resource_path("nothing.txt")
