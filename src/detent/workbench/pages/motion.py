"""The Motion page: the settings of a move as sliders over its picture, what a motor makes of it, and the search.

See ``assets/motion.js`` and ``motion_tuning.js``; the computations are in `detent.workbench.motion`, the search in
`detent.workbench.tuning`.
"""

from html import escape
from typing import TYPE_CHECKING

from detent.motors.variants import QUANTITIES
from detent.workbench.moves import Moves
from detent.workbench.pages import STOP_KEY, Page, Window
from detent.workbench.tuning import Tuning

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live
    from detent.workbench.messages import UnitPicture


def build(bench: "Bench", window: Window) -> None:
    """The frame of the page, which the script fills in; anew where the axes are others."""
    from nicegui import ui

    @ui.refreshable
    def page() -> None:
        tabs = "".join(_tab(unit, axis) for unit in bench.picture.units.values() for axis in unit.axes)
        ui.html(_page(tabs), sanitize=False).classes("motion-page")

    page()
    window.each_picture(lambda picture: (picture.target, picture.units), page.refresh)


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """The calls of the page."""
    Tuning(Moves(bench, live), live)


_FACTS = {
    "duration": "takes", "peak": "peak", "mean": "mean", "accelerates": "accelerates", "up": "speeding up",
    "down": "slowing down",
}  # fmt: skip
_FIELDS = {
    "supply": "supply, V",
    "current": "current, A",
    "inertia": "load, kg cm²",
    "friction": "friction, Nm",
    "damping": "damping ratio",
}
_MOVED = {
    "gear": ("gear, turns for one", "1"),
    "mass": ("mass, kg", "0"),
    "slope": ("slope, degrees", "0"),
    "force": ("force against plus, N", "0"),
    "drag": ("drag, N", "0"),
}
_QUESTION = "Which moves shall be fast, in steps: 200,1000x3 is 200 once and 1000 three times as often"


def _tab(unit: "UnitPicture", axis: str) -> str:
    name = f"{unit.name}.{axis}" if axis else unit.name
    return (
        f'<button type="button" role="tab" class="key small" data-unit="{escape(unit.name)}" '
        f'data-axis="{escape(axis)}" aria-selected="false" data-help="{escape(unit.title)}">{escape(name)}</button>'
    )


def _key(name: str, text: str, words: str, kind: str = "") -> str:
    return f'<button type="button" class="key {kind}" data-key="{name}" data-help="{escape(words)}">{text}</button>'


def _number(name: str, words: str, value: str = "", *, minus: bool = False) -> str:
    least = "" if minus else ' min="0"'
    return (
        f'<label><span>{words}</span><input class="field mono" type="number" name="{name}" step="any"{least} '
        f'value="{value}"></label>'
    )


def _page(tabs: str) -> str:
    facts = "".join(
        f'<div><dt>{words}</dt><dd class="mono" data-fact="{name}"></dd></div>' for name, words in _FACTS.items()
    )
    charts = "".join(
        f'<div class="motion-chart {name}"><canvas role="img" aria-label="{words}"></canvas></div>'
        for name, words in (("speed", "Speed over time"), ("acceleration", "Acceleration over time"),
                            ("place", "Position over time"))
    )  # fmt: skip
    keep = _key("keep", "Keep as A", "Keep this move as A, and compare what you change with it", "small")
    swap = _key("swap", "Swap", "Take up A again; this move becomes A", "small")
    drop = _key("drop", "Forget A", "Compare no more", "small")
    exports = _key("csv", "CSV", "The curves as a table", "small") + _key(
        "png", "PNG", "The page as a picture", "small"
    )
    return f"""<section class="motion" data-part="motion" aria-label="Motion">
<div class="motion-main">
  <div class="panel motion-move">
    <div class="panel-head"><div class="row motion-units" role="tablist" aria-label="Axis">{tabs}</div>
      <span class="grow"></span><span class="quiet motion-law"></span></div>
    <p class="motion-judged"><a href="#motion-motor" class="motion-of"></a>
      <b class="motion-verdict" role="status"></b></p>
    <dl class="motion-facts">{facts}</dl>
    <div class="motion-both" tabindex="0" role="region" aria-label="A and this move" hidden>
      <table class="mono"></table></div>
    {charts}
    <div class="motion-keys-row row">{keep}{swap}{drop}<span class="grow"></span>{exports}</div>
  </div>
  <div class="panel motion-torque">
    <div class="panel-head"><h2>Torque</h2></div>
    <div class="motion-chart torque"><canvas role="img" aria-label="Torque over speed"></canvas></div>
    <p class="motion-words quiet"></p>
  </div>
  {_tuning()}
</div>
<aside class="motion-side">
  {_settings()}
  {_motor()}
</aside>
<dialog class="motion-dialog panel" aria-label="Send to the unit"><h2></h2><p class="quiet"></p>
  <ol class="mono"></ol>
  <div class="row"><button type="button" class="key" value="cancel">Cancel</button>{STOP_KEY}<span class="grow"></span>
  <button type="button" class="key primary" value="send">Send</button></div></dialog>
</section>"""


def _settings() -> str:
    now = _key("now", "As in the unit", "Take what is in force in the unit, as far as it tells", "small")
    send = _key("send", "Send settings", "Send the settings to the unit")
    move = _key("move", "Send and move", "Send the settings, and make the move", "primary")
    return f"""<div class="panel motion-box"><h2>Settings</h2><div class="motion-sliders"></div>
    <div class="row motion-measure">{now}<span class="grow"></span>
      <label><span class="quiet">shown in</span> <select class="field" data-role="measure" aria-label="Shown in">
        <option value="">steps</option><option value="mm">mm</option><option value="°">degrees</option></select>
      </label>
      <label data-role="lead-label" hidden><input class="field mono" type="number" data-role="lead" min="0" step="any"
        aria-label="Steps for one"> <small>steps for 1 <span data-role="lead-unit">mm</span></small></label></div>
  </div>
  <div class="panel motion-box"><h2>Commands</h2><pre class="motion-lines mono"></pre>
    <div class="motion-keys">{send}{move}</div>
    <p class="motion-told quiet" role="status"></p>
  </div>"""


def _motor() -> str:
    fields = "".join(_number(name, words) for name, words in _FIELDS.items())
    moved = "".join(_number(name, words, value, minus=name in ("slope", "force"))
                    for name, (words, value) in _MOVED.items())  # fmt: skip
    return f"""<div class="panel motion-box" id="motion-motor"><h2>Motor</h2><form class="motion-form">
    <label><span>motor</span><select class="field" name="motor"></select></label>
    <label><span>stepping</span><select class="field" name="stepping"></select></label>{fields}
    <label><span>drive</span><select class="field" name="drive"></select></label>
    <label data-role="wiring" hidden><span>wiring</span><select class="field" name="wiring"></select></label>
    <label class="motion-check" data-role="fit" hidden><input type="checkbox" name="fit"> fitted to its curve</label>
    <details class="motion-more"><summary>Own motor, mechanics</summary><div class="motion-form">
      <label class="wide"><span>own motor: its TOML, and the CSV of its torque curve</span>
        <input type="file" name="files" multiple accept=".toml,.csv,text/csv"></label>
      <label><span>moved by</span><select class="field" name="by"><option value="">a shaft alone</option>
        <option value="screw">screw</option><option value="belt">belt</option><option value="rack">rack</option>
      </select></label>
      <label><span data-role="size">lead or radius, mm</span><input class="field mono" type="number" name="size"
        step="any" min="0" value="5"></label>{moved}</div></details></form>
  </div>"""


def _tuning() -> str:
    search = (
        '<button type="submit" class="key primary" data-key="search" '
        'data-help="Find the fastest settings that lose no step; the map of the losses after it">Search</button>'
    )
    stop = _key("stop-search", "Stop", "End the search with the best so far")
    take = _key("take", "Take over", "Put these settings into the sliders", "small")
    send = _key("send-found", "Send to the unit", "Show what is sent to the unit, then send it", "small primary")
    copy = _key("copy", "Copy", "The commands, and the options that no command sets", "small")
    ranges = ", ".join(QUANTITIES)
    return f"""<div class="panel motion-tuning" data-state="idle">
    <div class="panel-head"><h2>Tuning</h2><span class="grow"></span>
      <span class="quiet motion-search-told"></span></div>
    <form class="motion-search">
      <label class="wide"><span>moves, steps</span><input class="field mono" name="moves" maxlength="200"
        data-help="{_QUESTION}"></label>
      <label><span>variants</span><input class="field mono" type="number" name="variants" min="16" max="100000"
        value="2048"></label>
      <label><span>machines differ in</span><input class="field mono" name="vary" maxlength="200"
        placeholder="inertia=0.2, friction=0.3-2"
        data-help="A part either way, or two factors; else as usual. {ranges}">
      </label>
      <label class="motion-check"><input type="checkbox" name="corners" checked> all corners make it</label>
      <label class="motion-check"><input type="checkbox" name="map" checked> map</label>
      <div class="row wide">{search}{stop}</div>
    </form>
    <div class="motion-progress" hidden><progress max="1" value="0" aria-label="Search"></progress>
      <span class="quiet" role="status"></span></div>
    <p class="motion-problem" role="alert"></p>
    <div class="motion-found" hidden>
      <div class="row"><pre class="motion-found-lines mono" aria-label="Settings found"></pre><span class="grow"></span>
        {take}{send}{copy}</div>
      <div class="motion-times" tabindex="0" role="region" aria-label="Times"><table class="mono"></table></div>
      <p class="motion-known quiet"></p>
    </div>
    <div class="motion-map" hidden>
      <div class="motion-map-field" role="application" tabindex="0" aria-describedby="motion-map-help"
        aria-label="Map of losses: arrow keys move, Enter takes these settings"><canvas></canvas></div>
      <p class="motion-map-told mono" role="status"></p>
      <p class="quiet" id="motion-map-help">How many variants lose a step, from none to all; lines are places of equal
        time; the star is what was found. Click a place, or move with the arrow keys and press Enter, to take it
        over.</p>
    </div>
  </div>"""


PAGE = Page(
    "Motion", "/motion", "motion", build, ("motion.js",), ("motion.css",), offer
)  # motion.js brings the other scripts
