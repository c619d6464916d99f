"""THIRD-PARTY.md names every package that handcal runs with, as its metadata do."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib

import pytest

from tests.helpers import ROOT

ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "THIRD-PARTY.md").read_text().splitlines()
    if line.startswith("|")
][2:]


def test_every_dependency_is_listed_with_its_versions() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = []
    for requirement in project["dependencies"]:
        match = re.match(r"([\w.-]+)\s*([^;]*)", requirement)
        assert match is not None
        wanted.append([match[1], match[2].strip()])
    assert [row[:2] for row in ROWS] == wanted


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_the_licence_is_that_of_the_metadata(row: list[str]) -> None:
    try:
        metadata = importlib.metadata.metadata(row[0])
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("not installed")
    classifiers = metadata.get_all("Classifier") or []
    named = {text.rsplit(" :: ", 1)[1] for text in classifiers if text.startswith("License :: ")}
    for field in ("License-Expression", "License"):
        named |= set(metadata.get_all(field) or [])
    assert row[2] in named
    assert row[3]
