"""The page Begin: every example, model and cell of the folder to be opened, a new cell, commands, the documentation.

See ``assets/begin.js``; what it asks is in `detent.workbench.beginning`.
"""

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from detent.controllers import catalogue
from detent.workbench.pages import Page, Window

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live

SITE = Path(__file__).parents[4] / "docs" / "_build" / "html"  # where a checkout builds the documentation
DOCS = (
    ("tutorials/workbench.html", "The workbench in ten minutes"),
    ("how-to/cells.html", "Cells: what a file may say"),
    ("how-to/connect-a-host.html", "Connect a host program"),
    ("how-to/host-tools.html", "Tools for real units"),
    ("reference/command-line.html", "The command line"),
)


def build(bench: "Bench", window: Window) -> None:
    """The frame of the page; the script fills it in."""
    ui.html(markup(SITE.is_dir()), sanitize=False)


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """The documentation, where it is built."""
    from fastapi.staticfiles import StaticFiles

    if SITE.is_dir():
        site.mount("/docs", StaticFiles(directory=SITE, html=True))


def markup(built: bool) -> str:
    """The page; `built`: the documentation is there to be linked to."""
    models = "".join(f"<option>{escape(name)}</option>" for name in catalogue.MODELS)
    links = "".join(f'<li><a href="/docs/{file}" target="_blank">{escape(title)}</a></li>' for file, title in DOCS)
    controllers = "".join(
        f'<li><a href="/docs/controllers/{name}.html" target="_blank">{title}</a></li>'
        for name, title in (
            ("gsc200", "GS-C200"), ("supersigma", "SUPERSIGMA"), ("dcb274", "DCB-274"), ("genstepper", "GenStepper")
        )
    )  # fmt: skip
    docs = f"<ul>{links}{controllers}</ul>" if built else "<p class='quiet'>In a terminal: <kbd>detent docs</kbd></p>"
    return f"""<div class="begin" data-part="begin">
<section class="panel" aria-label="Open"><div class="panel-head"><h2 class="grow">Open</h2>
<input class="field" data-role="find" type="search" aria-label="Find a cell" placeholder="Find"></div>
<div data-role="places" class="places"></div></section>
<div class="side"><section class="panel new" aria-label="A new cell"><div class="panel-head">
<h2 class="grow">A new cell</h2></div>
<div class="row wrap"><input class="field grow" data-role="unit-name" aria-label="Name of the unit" placeholder="name">
<select class="field" data-role="unit-model" aria-label="Model of the unit"></select>
<button class="key small" data-role="add-unit">Add a unit</button>
<button class="key small" data-role="add-switch">Add a switch</button></div>
<p class="quiet hint" data-role="hint" aria-live="polite">Add two units; then click an output, and the input that it
leads to.</p>
<div data-role="board"></div>
<pre class="mono text" data-role="text" tabindex="0" aria-label="The cell file"></pre>
<div class="row wrap"><input class="field mono grow" data-role="file" aria-label="File of the new cell"
 placeholder="cell.toml" spellcheck="false"><button class="key small" data-role="save">Save</button>
<button class="key small primary" data-role="save-open">Save and open</button></div></section>
<section class="panel commands" aria-label="Commands"><div class="panel-head"><h2 class="grow">Commands</h2>
<select class="field" data-role="model" aria-label="Commands of">{models}</select></div>
<div class="row"><input class="field grow" data-role="search" type="search" aria-label="Search the commands"
 placeholder="letter, word, section of the manual"></div>
<div class="scroll-x" tabindex="0" role="group" aria-label="Commands found">
<table data-role="commands"></table></div></section>
<section class="panel docs" aria-label="Documentation"><div class="panel-head"><h2>Documentation</h2></div>
{docs}</section></div></div>"""


PAGE = Page("Begin", "/begin", "begin", build, ("begin.js",), ("begin.css",), offer)
