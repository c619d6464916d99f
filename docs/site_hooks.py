"""Hooks of the documentation site: files outside docs/ become part of it.

The same relative links then work in the site and in a plain view of the files: a page in docs/
links to ``../resources/example_rig.yaml``, and CONTRIBUTING.md at the root to ``docs/guide.md``.
"""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
ROOT_PAGES = ("CHANGELOG.md", "CONTRIBUTING.md", "THIRD-PARTY.md")
LOGO = "resources/icons/handcal.svg"
_OUTSIDE = re.compile(r"\]\(\.\./([^)#\s]+)")
_CODE = re.compile(r"<code>[^<]*</code>")
_FROM_ROOT = re.compile(r'"/([\w"])')
_AT_ROOT = re.compile(r"\]\((?!docs/|https?:|#)([^)#\s]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages at the root, and every file outside docs/ that a page links to."""
    wanted = {*ROOT_PAGES, LOGO}
    for page in files.documentation_pages():
        wanted |= set(_OUTSIDE.findall(page.content_string))
    for root_page in ROOT_PAGES:
        wanted |= set(_AT_ROOT.findall((ROOT / root_page).read_text("utf-8")))
    for path in sorted(wanted):
        if (ROOT / path).is_file():
            files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Rewrite links that cross the border of docs/."""
    if page.file.src_uri in ROOT_PAGES:
        return markdown.replace("](docs/", "](")
    return _OUTSIDE.sub(r"](\1", markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Remove the backslashes before bars, which code in tables needs only in Markdown."""
    return _CODE.sub(lambda code: code[0].replace("\\|", "|"), html)


def on_post_template(html: str, template_name: str, config: MkDocsConfig) -> str:  # noqa: ARG001
    """Make the links of the page for missing pages relative: nobody knows where the site will be.

    All pages are in the root of the site, and so are those that may be missing.
    """
    return _FROM_ROOT.sub(r'"./\1', html) if template_name == "404.html" else html
