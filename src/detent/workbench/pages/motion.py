"""The Motion page: the settings of a move as sliders over its picture, and what a motor makes of it.

See ``assets/motion.js``; the computations are in `detent.workbench.motion`.
"""

from html import escape
from typing import TYPE_CHECKING

from detent.workbench.moves import Moves
from detent.workbench.pages import Page, Window

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live
    from detent.workbench.messages import UnitPicture


def build(bench: "Bench", window: Window) -> None:
    """The frame of the page; the script fills it in."""
    from nicegui import ui

    tabs = "".join(_tab(unit, axis) for unit in bench.picture.units.values() for axis in unit.axes)
    ui.html(_page(tabs), sanitize=False).classes("motion-page")


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """The calls of the page."""
    Moves(bench, live)


_FACTS = {"duration": "takes", "peak": "peak", "mean": "mean", "up": "speeding up", "down": "slowing down"}
_FIELDS = {
    "supply": "supply, V",
    "current": "current, A",
    "inertia": "load, kg cm²",
    "friction": "friction, Nm",
    "damping": "damping ratio",
}


def _tab(unit: "UnitPicture", axis: str) -> str:
    name = f"{unit.name}.{axis}" if axis else unit.name
    return (
        f'<button type="button" role="tab" class="key small" data-unit="{escape(unit.name)}" '
        f'data-axis="{escape(axis)}" aria-selected="false" data-help="{escape(unit.title)}">{escape(name)}</button>'
    )


def _key(name: str, text: str, words: str, kind: str = "") -> str:
    return f'<button type="button" class="key {kind}" data-key="{name}" data-help="{escape(words)}">{text}</button>'


def _page(tabs: str) -> str:
    facts = "".join(
        f'<div><dt>{words}</dt><dd class="mono" data-fact="{name}"></dd></div>' for name, words in _FACTS.items()
    )
    fields = "".join(
        f'<label><span>{words}</span><input class="field mono" type="number" name="{name}" step="any" min="0"></label>'
        for name, words in _FIELDS.items()
    )
    now = _key("now", "As in the unit", "Take what is in force in the unit", "small")
    send = _key("send", "Send settings", "Send the settings to the unit")
    move = _key("move", "Send and move", "Send the settings, and make the move", "primary")
    return f"""<section class="motion" data-part="motion" aria-label="Motion">
<div class="motion-main">
  <div class="panel motion-move">
    <div class="panel-head"><div class="row motion-units" role="tablist" aria-label="Axis">{tabs}</div>
      <span class="grow"></span><span class="quiet motion-law"></span></div>
    <dl class="motion-facts">{facts}</dl>
    <div class="motion-chart speed"><canvas role="img" aria-label="Speed over time"></canvas></div>
    <div class="motion-chart place"><canvas role="img" aria-label="Position over time"></canvas></div>
  </div>
  <div class="panel motion-torque">
    <div class="panel-head"><h2>Torque</h2><span class="grow"></span><b class="motion-verdict" role="status"></b></div>
    <div class="motion-chart torque"><canvas role="img" aria-label="Torque over speed"></canvas></div>
    <p class="motion-words quiet"></p>
  </div>
</div>
<aside class="motion-side">
  <div class="panel motion-box"><h2>Settings</h2><div class="motion-sliders"></div><div class="row">{now}</div></div>
  <div class="panel motion-box"><h2>Commands</h2><pre class="motion-lines mono"></pre>
    <div class="motion-keys">{send}{move}</div>
    <p class="motion-told quiet" role="status"></p>
  </div>
  <div class="panel motion-box"><h2>Motor</h2><form class="motion-form">
    <label><span>motor</span><select class="field" name="motor"></select></label>
    <label><span>stepping</span><select class="field" name="stepping"></select></label>{fields}</form>
  </div>
</aside>
</section>"""


PAGE = Page("Motion", "/motion", "motion", build, ("motion.js",), ("motion.css",), offer)
