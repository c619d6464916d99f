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


def test_the_site_can_be_searched_without_a_server(site: Path) -> None:
    """The worker and the index are loaded as scripts, as a browser gives neither from a file."""
    html = (site / "guide.html").read_text("utf-8")
    assert html.index('src="iframe-worker.js"') < html.index('src="assets/javascripts/bundle')
    assert (site / "iframe-worker.js").exists()
    assert (site / "search/search_index.js").read_text("utf-8").startswith("var __index")


def test_the_page_for_missing_pages_has_links_that_lead_somewhere(site: Path) -> None:
    links = re.findall(r'(?:href|src)="([^"#]+)', (site / "404.html").read_text("utf-8"))
    here = [link for link in links if not link.startswith("https:")]
    assert "./guide.html" in here
    assert not [link for link in here if link[0] == "/" or not (site / link).exists()]


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
