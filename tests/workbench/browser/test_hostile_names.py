"""Names, texts and answers are shown as what they are: none of them becomes a part of the page."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.workbench.browser.windows import Served, Windows

TAG = "<img src=x onerror=hit()>"  # in texts
UNIT, SWITCH = "<marquee>", "<blink>"  # a name may have no = in it
CELL = f"""
title = '{TAG}'
[units.'{UNIT}']
model = "gs-c200s"
program = "bad.gsc"
straps = {{ CHS = 0 }}
[switches.'{SWITCH}']
drives = "{UNIT}.EOT"
axis = "{UNIT}"
from = 900
"""
PROGRAM = f"again: W1 ; {TAG}\nj again\n"
PAGES = ("/", "/program", "/terminal", "/scope", "/motion", "/unit", "/begin")


@pytest.fixture
def hostile(chromium: Any, serve: Callable[..., Served], tmp_path_factory: pytest.TempPathFactory) -> Served:
    place = tmp_path_factory.getbasetemp() / "hostile"
    place.mkdir(exist_ok=True)
    (place / "cell.toml").write_text(CELL)
    (place / "bad.gsc").write_text(PROGRAM)
    found = serve(str(place / "cell.toml"))
    (found.folder / f"{TAG.replace('/', '')}.gsc").write_text(PROGRAM)
    (found.folder / "cell.toml").write_text(CELL.replace('program = "bad.gsc"\n', ""))
    return found


def test_no_name_title_comment_or_answer_becomes_a_part_of_a_page(windows: Windows, hostile: Served) -> None:
    window = windows.new(hostile)
    window.own = True
    window.page.add_init_script("window.hits = 0; window.hit = () => { window.hits += 1 }")
    for path in PAGES:
        window.open(path)
        window.call("type", UNIT, f"Q{TAG}")
        window.call("keep_draft", UNIT, PROGRAM + TAG, "")
        window.page.wait_for_function("document.body.innerText.length > 50")
        window.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert window.page.evaluate("window.hits") == 0, path
        assert window.page.evaluate("document.querySelectorAll('img[src=x], marquee, blink').length") == 0, path
