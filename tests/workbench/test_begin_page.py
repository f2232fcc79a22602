"""The frame of the page Begin: what it links to is there."""

import re
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="nicegui is not installed")

from detent.workbench.pages.begin import markup


def test_the_documentation_that_it_links_to_has_these_pages() -> None:
    linked = re.findall(r'href="/docs/([^"]+)\.html"', markup(built=True))
    assert "controllers/gsc200" in linked
    assert [page for page in linked if not Path("docs", f"{page}.md").is_file()] == []
    assert "detent docs" in markup(built=False)
