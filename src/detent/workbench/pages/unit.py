"""The page Unit: a real unit at a port, or one of the cell as its host sees it: panel, hands, line, program, backup.

The markup is one unit's; ``assets/unit.js`` fills it with the one that is chosen.
"""

import json
from html import escape
from typing import TYPE_CHECKING

from nicegui import ui

from detent.realtime.connect import HOSTS
from detent.workbench.answers import UnitPlaces
from detent.workbench.beside import beside
from detent.workbench.icons import icon
from detent.workbench.pages import Page, Window
from detent.workbench.units.unit import RATES
from detent.workbench.words import words

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live


def build(bench: "Bench", window: Window) -> None:
    """The frame of the page; the script fills it in."""
    ui.html(markup(), sanitize=False)


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """Where units are found: the ports of this computer, and the endpoints of the cell."""
    from detent.realtime.addresses import PortError
    from detent.realtime.finding import listed
    from detent.workbench.units.beside import emulated

    async def unit_places() -> UnitPlaces:
        try:
            ports = await beside(listed)
        except PortError:  # none can be listed here; a port of another computer can be named
            ports = []
        return {
            "ports": [(port.device, port.what) for port in ports],
            "cell": emulated(bench.picture),
        }

    live.offer("unit_places", unit_places)


_FORM = """<form class="connect panel" data-role="connect">
<div class="panel-head"><h2>Connect to a unit</h2></div>
<div class="fields">
<label><span>Controller</span><select class="field" name="model">{models}</select></label>
<label><span>Port</span><input class="field mono" name="address" list="ports" required spellcheck="false"
 autocomplete="off" placeholder="/dev/ttyUSB0 or HOST:PORT"><datalist id="ports"></datalist></label>
<label class="wide"><span>Options</span><input class="field mono" name="options" spellcheck="false" autocomplete="off"
 placeholder="those of the model: none needed for a unit alone on its line"></label>
<p class="quiet wide" data-role="takes"></p>
<div class="wide row"><button class="key primary">Connect</button><span class="quiet">Then it is signed on to, as its
 manual has it, and asked questions that change nothing.</span></div>
</div>
<div class="places"><h3>Ports of this computer</h3><div data-role="ports" class="list"></div>
<h3>Units of the cell, as their host sees them</h3><div data-role="cell" class="list"></div></div></form>"""


def markup() -> str:
    """The page."""
    facts = {
        model: {
            "options": list(found.options),
            "words": [
                [word.spelling, *(f"{row.command} {row.argument}: {row.what}" for row in word.rows)]
                for word in words(model)
            ],
        }
        for model, found in HOSTS.items()
    }
    models = "".join(f"<option>{model}</option>" for model in HOSTS)
    rates = "".join(f'<option value="{rate:g}">{rate:g} a second</option>' for rate in RATES)
    return f"""<div class="unit-page" data-part="unit" data-facts="{escape(json.dumps(facts))}">
<div class="bar row"><div class="lines scroll-x" role="tablist" aria-label="Units" data-role="tabs"></div></div>
{_FORM.format(models=models)}
<div class="bench" data-role="bench" hidden>
<div class="warning" role="alert" data-role="trouble" hidden><span class="grow"></span>
 <button class="key small primary" data-role="again">Ask again</button></div>
<div class="side">{_front(rates)}{_manual()}</div><div class="side">{_line()}{_keeps()}</div></div></div>"""


def _front(rates: str) -> str:
    return f"""<section class="panel front" aria-label="Front panel"><div class="panel-head"><h2 data-role="name"></h2>
<span class="state" data-role="state"></span><span class="tools row"><button class="key small" data-role="leave"
 data-help="Let go of the port. The unit does what it does.">Leave</button></span></div>
<div class="readout"><span class="first"><output data-role="position" aria-label="Position"></output>
<small data-role="steps">steps</small></span><span class="second"><span data-role="place"></span>
<b data-role="rate"></b><small data-role="rate-unit"></small></span></div>
<div class="lamps" data-role="lamps"></div><dl class="told-facts" data-role="facts"></dl>
<div class="asking row quiet">
<button class="key small" data-role="pause" aria-pressed="false">{icon("pause")}Ask no more</button>
<select class="field" data-role="rates" aria-label="How often it is asked">{rates}</select>
<span class="grow" data-role="took"></span></div></section>"""


def _manual() -> str:
    jogs = "".join(
        f'<button class="key" data-jog="{sign}" aria-label="{text}, jog {word}">{text}</button>'
        for sign, word, text in ((-1, "minus", "&minus; step"), (1, "plus", "+ step"))
    )
    holds = "".join(
        f'<button class="key hold" data-hold="{sign}" aria-label="{text}: run {word}">{text}</button>'
        for sign, word, text in ((-1, "minus", "&minus; hold"), (1, "plus", "hold +"))
    )
    return f"""<section class="panel hand" aria-label="Manual control">
<div class="panel-head"><h2 class="grow">Manual control</h2>
<button class="key small stop" data-role="stop" data-help="By its ramp; again: at once. Esc twice stops everything.">
STOP</button></div><div class="fields">
<label><span>Jog by</span><input class="field mono" data-role="by" type="number" step="any" value="100"></label>
<div class="row pair">{jogs}</div>
<label><span>Run at <span data-role="speed-unit">steps/s</span></span><input class="field mono" data-role="speed"
 type="number" min="1" step="any" value="200"></label><div class="row pair">{holds}</div>
<label><span>Position</span><input class="field mono" data-role="target" type="number" step="any" value="0"></label>
<div class="row pair"><button class="key" data-role="go">Go to</button>
<button class="key" data-role="zero" data-help="Where the axis stands is 0 from then on">Set zero</button></div>
<label><span>Home</span><select class="field" data-role="direction" aria-label="Direction of homing">
<option value="-1">minus</option><option value="1">plus</option></select></label><div class="row pair">
<button class="key" data-role="home">Home</button></div>
<label><span>Unit of length</span><select class="field" data-role="measure"><option value="">steps</option>
<option>mm</option><option>°</option></select></label>
<label data-role="lead-label" hidden><span>Steps a <span data-role="lead-unit"></span></span><input class="field mono"
 data-role="lead" type="number" min="0" step="any" value="1"></label></div>
<p class="quiet note" data-role="why"></p><div class="sent mono" data-role="sent" aria-live="polite"></div></section>"""


def _line() -> str:
    return f"""<section class="panel talk" aria-label="Line"><div class="panel-head"><h2 class="grow">Line</h2>
<button class="key small" data-role="polls" aria-pressed="false" data-help="Show the questions of the panel, too">
questions</button><button class="key small" data-role="hex" aria-pressed="false"
 data-help="Show every byte as a hexadecimal number too">hex</button></div>
<div class="rows" data-role="rows" role="log" aria-label="What was said" tabindex="0"></div>
<form class="say" data-role="say"><input class="field mono grow" data-role="text" aria-label="Line to send"
 spellcheck="false" autocomplete="off" autocapitalize="off" placeholder="Command">
<select class="field" data-role="beside" aria-label="Send to another unit, too"></select>
<button class="key primary" aria-label="Send">{icon("send")}<span>Send</span></button></form>
<div class="hint quiet" data-role="hint" aria-live="polite"></div>
<div class="answers" data-role="answers" aria-live="polite"></div></section>"""


def _keeps() -> str:
    return """<section class="panel keeps" aria-label="Program and backup"><div class="panel-head">
<h2 class="grow">Program and backup</h2></div>
<div data-role="program"><textarea class="field mono" data-role="source" spellcheck="false" aria-label="Program source"
 rows="9" placeholder="Read the program of the unit, or write one: a command a line"></textarea>
<div class="row wrap"><button class="key small" data-role="read">Read</button>
<button class="key small" data-role="compare">Compare</button>
<button class="key small primary" data-role="store">Store</button>
<label class="row quiet"><input type="checkbox" data-role="save"> keep over a power-off, too</label></div></div>
<div class="row wrap"><input class="field mono grow" data-role="file" aria-label="File of the backup" list="backups"
 spellcheck="false" autocomplete="off" placeholder="backup.toml"><datalist id="backups"></datalist>
<button class="key small" data-role="backup">Back up</button>
<button class="key small" data-role="differs">Restore…</button>
<button class="key small primary" data-role="restore" hidden>Write it to the unit</button></div>
<pre class="told mono" data-role="told" aria-live="polite"></pre></section>"""


PAGE = Page("Unit", "/unit", "unit", build, ("unit.js",), ("terminal.css", "unit.css"), offer)
