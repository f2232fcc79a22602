"""The pages become a site without a warning, that loads nothing from elsewhere and can be searched from its files."""

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]


LESS = ("-D", "extensions=myst_parser,sphinx.ext.autodoc", "-D", "toc_object_entries=0")
"""Without the pages of the sources, and without the list of a page's functions at its side: two thirds of the work."""

SPHINX = "import gc, sys; gc.disable(); from sphinx.cmd.build import main; sys.exit(main(sys.argv[1:]))"
"""Looking for garbage is a sixth of its work, and it is over soon."""


@pytest.fixture(scope="module", params=[LESS, pytest.param((), marks=pytest.mark.slow)], ids=["text", "whole"])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All pages that are written by hand or from docstrings; `whole` is what `make docs` builds."""
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-c", SPHINX, "-q", "-W", "--keep-going", "-b", "html", *request.param,
             "-d", folder / "trees", "docs"]  # fmt: skip
    done = subprocess.run(
        [*map(str, build), str(folder / "html")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


def test_every_page_is_there(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        if "_build" not in page.parts:
            assert (site / page.relative_to(ROOT / "docs")).with_suffix(".html").is_file(), page


def test_what_is_typed_can_be_copied_as_it_stands(site: Path) -> None:
    """Two hyphens of an option are no dash, and quotes are those of the keyboard."""
    for page in (ROOT / "docs").rglob("*.md"):
        if "_build" not in page.parts and "decisions" not in page.parts:
            source, made = page.read_text(), (site / page.relative_to(ROOT / "docs")).with_suffix(".html").read_text()
            body = made[made.index("<article") : made.index("</article>")]
            assert [sign for sign in "\u2013\u201c\u201d\u2018\u2019" if sign in body and sign not in source] == [], (
                page
            )


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    loads = re.compile(r"<(?:script|img|iframe|source)[^>]* src=\"(?:https?:)?//|<link[^>]* href=\"(?:https?:)?//")
    for page in site.rglob("*.html"):
        assert not loads.search(page.read_text()), page
    for style in site.rglob("*.css"):
        assert not re.search(r"(?:@import\s*|url\(\s*)[\"']?(?:https?:)?//", style.read_text()), style


class Links(HTMLParser):
    """Where a page leads, and what in it can be led to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := found.get(name))}
        self.targets += [value for name in ("href", "src") if (value := found.get(name))]


def test_every_link_leads_to_a_place_that_is_there(site: Path) -> None:
    pages = {page: Links(page.read_text()) for page in site.rglob("*.html")}
    wrong = []
    for page, links in pages.items():
        if "_modules" in page.parts:
            continue  # the sources, whose way back is Sphinx's own
        for target in links.targets:
            place, _, anchor = unquote(target).partition("#")
            if "://" in target or place.startswith(("data:", "mailto:")):
                continue
            other = (page.parent / place.partition("?")[0]).resolve() if place else page
            known = pages.get(other)
            if not other.exists() or (known is not None and anchor not in known.anchors):
                wrong.append(f"{page.relative_to(site)}: {target}")
    assert wrong == []


@pytest.mark.skipif(shutil.which("chromium") is None, reason="chromium is not installed")
def test_it_can_be_searched_from_its_files(site: Path) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page()
        page.goto(f"{(site / 'search.html').as_uri()}?q=pull-out")
        glossary = page.locator("#search-results li a", has_text="Glossary").first
        glossary.wait_for(timeout=120_000)  # what is found is listed one after the other
        assert "glossary" in str(glossary.get_attribute("href"))
        browser.close()
