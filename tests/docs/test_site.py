from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import handcal
from tests.helpers import ROOT

pytestmark = pytest.mark.process

_LINK = re.compile(r"\]\(([^)#\s]+)")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    result = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    output = result.stdout + result.stderr
    assert result.returncode == 0, output
    assert "WARNING" not in output
    assert "contains a link" not in output
    return folder


def test_every_page_is_in_the_site(site: Path) -> None:
    pages = {path.stem for path in (ROOT / "docs").glob("*.md")} | {"CHANGELOG", "CONTRIBUTING"}
    assert pages <= {path.stem for path in site.glob("*.html")}


def test_every_public_name_is_described(site: Path) -> None:
    text = (site / "api.html").read_text("utf-8")
    for name in handcal.__all__:
        if name != "__version__":
            assert re.search(rf'id="handcal\.{name}"', text), name


def test_the_site_asks_nothing_of_the_network(site: Path) -> None:
    loaded = re.compile(r"<(?:link[^>]+stylesheet|script|img)[^>]+(?:href|src)=\"?https?:")
    for page in site.glob("*.html"):
        assert not loaded.search(page.read_text("utf-8")), page.name


@pytest.mark.parametrize(
    "page",
    [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")],
    ids=lambda page: str(page.name),
)
def test_links_resolve_in_a_plain_view_of_the_files(page: Path) -> None:
    for link in _LINK.findall(page.read_text("utf-8")):
        if not link.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / link).exists(), link
