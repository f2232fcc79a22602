"""The page Terminal: what is said on each serial line, and what every byte of it was; lines and scripts to send."""

import json
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Annotated

from nicegui import ui
from pydantic import Field

from detent.controllers.gsc200 import commands as gsc200
from detent.ticks import SECOND
from detent.workbench.answers import LineRow, LineTalk
from detent.workbench.icons import icon
from detent.workbench.line_scripts import LineScripts
from detent.workbench.live import Live
from detent.workbench.messages import LinePicture, Picture
from detent.workbench.pages import Page, Window
from detent.workbench.stops import BOARDS
from detent.workbench.talk import Row
from detent.workbench.words import words

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench

MOST_ROWS = 400  # that a window is given at once


def build(bench: "Bench", window: Window) -> None:
    """The lines of the cell as it is now; built anew when there is another picture of it."""

    @ui.refreshable
    def page() -> None:
        ui.html(markup(bench.picture), sanitize=False)

    page()
    window.each_picture(lambda picture: picture.lines, page.refresh)


def offer(site: "FastAPI", bench: "Bench", live: Live) -> None:
    """The calls of this page: rows of a line, scripts."""
    scripts = LineScripts(bench, live)

    async def terminal(line: str, since: int = 0) -> LineTalk:
        talk = bench.terminal(line, since)
        rows = talk.rows[-MOST_ROWS:]
        first = rows[0].number if rows else talk.first
        return {"first": first, "next": talk.next, "cut": talk.cut, "rows": [_row(row) for row in rows]}

    async def run_script(line: str, unit: str, text: str, comment: str = ";") -> None:
        scripts.start(line, unit, text, comment)

    async def repeat_command(line: str, unit: str, text: str, every: Annotated[float, Field(ge=0, le=1e6)]) -> None:
        scripts.repeat(line, unit, text, round(every * SECOND))

    async def stop_script(line: str) -> None:
        scripts.stop(line)

    for call in (terminal, run_script, repeat_command, stop_script):
        live.offer(call.__name__, call, moves=BOARDS if call in (run_script, repeat_command) else "")


def _row(row: Row) -> LineRow:
    """A row as a window draws it."""
    return {
        "number": row.number,
        "begin": row.begin,
        "sender": row.sender,
        "note": row.note,
        "wrong": row.wrong,
        "whole": row.whole,
        "parts": [(part.kind, part.text, part.meaning, part.data.hex(" ")) for part in row.parts],
    }


def markup(picture: Picture) -> str:
    """The page, bound to the live table."""
    lines = list(picture.lines.values())
    if not lines:
        return '<p class="quiet nothing">No unit of this cell has a serial line.</p>'
    facts = {
        line.name: {
            "units": list(line.units),
            "host": line.host,
            "words": _words(line, picture),
            "added": _added(line, picture),
        }
        for line in lines
    }
    tabs = "".join(
        f'<button role="tab" data-line="{escape(line.name)}"><b>{escape(line.name)}</b>'
        f'<span class="quiet" data-live="l.{escape(line.name)}.format">{escape(line.format)}</span></button>'
        for line in lines
    )
    return f"""<div class="terminal" data-part="terminal" data-lines="{escape(json.dumps(facts))}">
<section class="panel talk" aria-label="Line">
  <div class="panel-head"><div class="lines scroll-x" role="tablist" aria-label="Lines">{tabs}</div>
    <span class="tools"><button class="key small" data-role="hex" aria-pressed="false"
      data-help="Show every byte as a hexadecimal number too">hex</button></span></div>
  <div class="ends quiet">{_ends(lines)}</div>
  <div class="rows" data-role="rows" role="log" aria-label="What was said" tabindex="0"></div>
  <button class="key small to-end" data-role="to-end">Latest</button>
  <div class="waits" data-role="waits" role="group" aria-label="Commands that wait until time goes on" hidden></div>
  <form class="say" data-role="say">
    <select class="field" data-role="to" aria-label="To"></select>
    <input class="field mono grow" data-role="text" aria-label="Line to send" spellcheck="false" autocomplete="off"
      autocapitalize="off" list="said" placeholder="Command">
    <datalist id="said"></datalist>
    <label class="every quiet" data-help="Send it again and again: how many seconds of the cell are between">every
      <input class="field num" data-role="every" type="number" min="0.001" step="any"
        aria-label="Again every so many seconds">
      s</label>
    <button class="key primary" aria-label="Send">{icon("send")}<span>Send</span></button>
    <button type="button" class="key" data-role="repeats" hidden>Stop repeating</button>
  </form>
  <div class="hint quiet" data-role="hint" aria-live="polite"></div>
</section>
<section class="panel script" aria-label="Script">
  <div class="panel-head"><h2 class="grow">Script</h2>
    <button class="key small primary" data-role="run">{icon("start")}Run</button>
    <button class="key small" data-role="stop" disabled>Stop</button></div>
  <div class="sheet"><div class="numbers num" data-role="numbers" aria-hidden="true"></div>
  <textarea class="mono" data-role="script" spellcheck="false" autocapitalize="off" aria-label="Script"
    placeholder="; one command a line&#10;@ 500 ms  ; a pause&#10;@ answer  ; wait for one&#10;@ again"></textarea>
  </div>
  <div class="told quiet" data-role="told" aria-live="polite"></div>
  <div class="files row"><input class="field grow" data-role="file" list="scripts" aria-label="File"
    placeholder="file.txt" spellcheck="false" autocomplete="off"><datalist id="scripts"></datalist>
    <button class="key small" data-role="open">Open</button>
    <button class="key small" data-role="save">Save</button></div>
</section></div>"""


def _ends(lines: Sequence[LinePicture]) -> str:
    """Where hosts connect, a row for each line."""
    return "".join(
        f'<div data-ends="{escape(line.name)}" hidden>{escape(", ".join(line.units))} · {escape(line.kind)} · '
        + " ".join(
            f"""<button class="endpoint num" data-part="copy" data-copy="{escape(one.address)}"
 data-help="Where a host program connects: click to copy">{escape(one.kind)} {escape(one.address)}</button>"""
            for one in line.endpoints
        )
        + "</div>"
        for line in lines
    )


def _added(line: LinePicture, picture: Picture) -> str:
    """What is added to a command that is typed."""
    models = {picture.units[unit].model for unit in line.units}
    if models & set(gsc200.MODELS):
        return "Address, checksum and the end of the frame are added."
    if "supersigma" in models:
        return "The command is sent as its bytes on the bus."
    return "The end of the line is added."


def _words(line: LinePicture, picture: Picture) -> dict[str, list[list[str]]]:
    """For each controller on a line what is typed of its commands, the longest first, and what they do."""
    return {
        unit: [
            [word.spelling, *(f"{row.command} {row.argument}: {row.what}" for row in word.rows)]
            for word in words(picture.units[unit].model)
        ]
        for unit in line.units
        if picture.units[unit].axes
    }


PAGE = Page("Terminal", "/terminal", "terminal", build, ("terminal.js", "cell.js"), ("terminal.css",), offer)
