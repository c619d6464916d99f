"""THIRD-PARTY.md names every package that handcal runs with, as its metadata do."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib

import pytest

from tests.helpers import ROOT


def read_table(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


DIRECT, IN_TURN = map(read_table, (ROOT / "THIRD-PARTY.md").read_text().split("\n## "))


def test_every_dependency_is_listed_with_its_versions() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = []
    for requirement in project["dependencies"]:
        match = re.match(r"([\w.-]+)\s*([^;]*)", requirement)
        assert match is not None
        wanted.append([match[1], match[2].strip()])
    assert [row[:2] for row in DIRECT] == wanted


def test_what_these_need_in_turn_is_listed_as_in_the_lock() -> None:
    lock = (ROOT / "installer/requirements-run.lock").read_text()
    versions: dict[str, list[str]] = {}
    needed_by: dict[str, str] = {}
    for block in re.split(r"^(?=\S)", lock, flags=re.MULTILINE):
        if match := re.match(r"([\w.-]+)==(\S+)", block):
            versions.setdefault(match[1], []).append(match[2])
            users = re.findall(r"^    #(?: via|  ) +(\S.*)$", block, re.MULTILINE)
            needed_by[match[1]] = ", ".join(users)
    direct = {row[0].lower().replace("_", "-") for row in DIRECT}
    assert [[row[0], row[1], row[3]] for row in IN_TURN] == [
        [name, ", ".join(found), re.sub(r"handcal \(.*?\)", "the set-up", needed_by[name])]
        for name, found in versions.items()
        if name not in direct
    ]


@pytest.mark.parametrize("row", DIRECT + IN_TURN, ids=lambda row: row[0])
def test_the_licence_is_that_of_the_metadata(row: list[str]) -> None:
    try:
        metadata = importlib.metadata.metadata(row[0])
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("not installed")
    classifiers = metadata.get_all("Classifier") or []
    named = {text.rsplit(" :: ", 1)[1] for text in classifiers if text.startswith("License :: ")}
    for field in ("License-Expression", "License"):
        named |= set(metadata.get_all(field) or [])
    versions, licences = row[1].split(", "), row[2].split("; ")
    # Two of the lock, for older and newer Pythons, may name their licences differently.
    by_version = dict(zip(versions, licences, strict=True)) if len(licences) > 1 else {}
    assert by_version.get(metadata["Version"], row[2]) in named
    assert row[3]
