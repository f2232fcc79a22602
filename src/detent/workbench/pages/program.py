"""The Program page: an editor for the language of a unit, its memory, and a debugger; see ``assets/program.js``."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

from detent.workbench.editing import Editing
from detent.workbench.icons import icon
from detent.workbench.pages import STOP_KEY, Page, Window

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live
    from detent.workbench.messages import PinPicture, UnitPicture

SHOWN_PINS = 24  # in the watch, of each kind: a part with more is looked at on the Cell page


def build(bench: "Bench", window: Window) -> None:
    """The frame of the page, and for each controller what the watch shows of it; anew where they are others."""
    from nicegui import ui

    @ui.refreshable
    def page() -> None:
        units = [unit for unit in bench.picture.units.values() if unit.axes]
        ui.html(_page(units), sanitize=False).classes("program-page")

    page()
    window.each_picture(lambda picture: (picture.target, picture.units), page.refresh)


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """The calls of the editor; and the editor itself, so that NiceGUI tells every page where it is."""
    import nicegui.elements.codemirror  # noqa: F401

    Editing(bench, live)


class _Key(NamedTuple):
    """A button of the page: what the script knows it by, what stands on it, what it is for."""

    name: str
    text: str
    help: str
    more: str = ""  # attributes
    icons: tuple[str, ...] = ()
    unreal: bool = False  # where a machine is driven it is refused, and so not offered


_FILES = (
    _Key("open", "Open…", "Open a file of the chosen folder"),
    _Key("save", "Save…", "Save in the chosen folder (Ctrl-S)"),
    _Key("revert", "Revert", "Throw the draft away"),
)
_MEMORY = (
    _Key("run", "Load and start", "Load, and start (Ctrl-Enter)"),
    _Key("load", "Load", "Put the program into the unit's memory"),
    _Key("keep", "Save to EEPROM", "Keep program memory without supply, by the unit's own command"),
    _Key("compare", "Compare", "Read program memory back and compare it with the text"),
    _Key("compare-kept", "Compare EEPROM", "Compare what is kept without supply with the text"),
    _Key("fetch", "Read back", "Read program memory back as source"),
)
_SCRIPT = (
    _Key("send", "Send all", "Send the lines one after the other (Ctrl-Enter)"),
    _Key("send-line", "Send line", "Send the line of the cursor"),
    _Key("stop", "Stop", "Send no more lines", " disabled"),
)
_DEBUGGER = (
    _Key("go", "Go", "Pause or go (F8)", ' data-pressed="held"', ("go", "pause")),
    _Key("step", "Step", "To the next instruction (F10)", icons=("step",), unreal=True),
    _Key("back", "Back", "To the instruction before (Shift-F10)", icons=("back",)),
    _Key("cursor", "To cursor", "Run to the line of the cursor (F4)", unreal=True),
    _Key("break", "Break", "Breakpoint here, or none (F9)", unreal=True),
    _Key("errors", "On errors", "Stop whenever a unit refuses something", ' data-pressed="breakerrors"', unreal=True),
)


def _keys(keys: "Sequence[_Key]", kind: str) -> str:
    """Buttons; the first of those that do something to the unit stands out."""
    made = ""
    for key in keys:
        classes = f"key{kind}" + (" primary" if key.name in ("run", "send") else " go" if key.name == "go" else "")
        classes += " unreal" * key.unreal
        icons = "".join(
            f'<i class="{when}">{icon(name)}</i>'
            for name, when in zip(key.icons, ("when-held", "when-going"), strict=False)
        )
        made += (
            f'<button type="button" class="{classes}" data-key="{key.name}" data-help="{escape(key.help)}"{key.more}>'
            f"{icons}<span>{escape(key.text)}</span></button>"
        )
    return made


def _page(units: "Sequence[UnitPicture]") -> str:
    tabs = "".join(
        f'<button type="button" role="tab" class="key small" data-unit="{escape(unit.name)}" aria-selected="false" '
        f'data-help="{escape(unit.title)}">{escape(unit.name)}</button>'
        for unit in units
    )
    return f"""<section class="program" data-part="program" aria-label="Program">
<div class="program-main panel">
  <div class="panel-head program-head">
    <div class="row program-units" role="tablist" aria-label="Unit">{tabs}</div>
    <span class="program-file mono"></span>
    <div class="row program-files">{_keys(_FILES, " small")}</div>
  </div>
  <div class="program-editor"></div>
  <ul class="program-errors" aria-label="Errors" aria-live="polite"></ul>
  <div class="program-foot">
    <span class="program-meter" role="meter" aria-label="memory in use"><i></i></span>
    <output class="program-used"></output>
    <span class="program-loaded quiet"></span>
  </div>
</div>
<aside class="program-side">
  <div class="panel program-box" data-for="language">
    <h2>Memory</h2>
    <div class="program-keys">{_keys(_MEMORY, "")}</div>
    <p class="program-told" role="status"></p>
  </div>
  <div class="panel program-box" data-for="script">
    <h2>Script</h2>
    <p class="program-why quiet"></p>
    <div class="program-keys debug">{_keys(_SCRIPT, "")}</div>
    <p class="program-told" role="status"></p>
  </div>
  <div class="panel program-box" data-for="language">
    <h2>Debugger</h2>
    <div class="program-keys debug">{_keys(_DEBUGGER, "")}</div>
    <p class="program-stands"><b class="program-line mono"></b>
      <span class="program-stop quiet" data-live="why"></span></p>
  </div>
  {"".join(map(_watch, units))}
  <details class="panel program-box program-commands"><summary>Commands</summary>
    <input class="field" type="search" aria-label="Search the commands" placeholder="letter, word, section">
    <div class="scroll-x" tabindex="0" role="group" aria-label="Commands found"><table></table></div></details>
</aside>
<dialog class="panel program-dialog" aria-labelledby="program-dialog-title"><form method="dialog">
  <h2 id="program-dialog-title"></h2>
  <input class="field mono" name="name" autocomplete="off" spellcheck="false" aria-label="file name">
  <ul class="program-list"></ul>
  <p class="program-asks" role="alert"></p>
  <div class="row">{STOP_KEY}<span class="grow"></span><button type="button" class="key" value="cancel">Cancel</button>
    <button type="submit" class="key primary" value="ok"></button></div>
</form></dialog>
</section>"""


def _watch(unit: "UnitPicture") -> str:
    """Position, speed, registers, inputs and outputs of a unit."""
    key = f"u.{escape(unit.name)}"
    axes = "".join(
        f"""<dt>{escape(axis) or "position"}</dt><dd class="readout"><span data-live="{key}.x.{escape(axis)}.position"
        data-form="steps"></span></dd><dt>speed</dt><dd class="readout"><span data-live="{key}.x.{escape(axis)}.rate"
        data-form="rate"></span><small>steps/s</small></dd>"""
        for axis in unit.axes
    )
    inputs = _pins(unit, [pin for pin in unit.pins if pin.kind == "input"])
    outputs = _pins(unit, [pin for pin in unit.pins if pin.kind in ("output", "open collector")])
    return f"""<div class="panel program-box program-watch" data-watch="{escape(unit.name)}" hidden>
  <h2>Watch <span class="quiet" data-live="{key}.state"></span></h2>
  <dl class="program-axes">{axes}</dl>
  <dl class="program-registers mono" data-registers="{escape(unit.name)}"></dl>
  <h3>Inputs</h3><div class="program-pins">{inputs}</div>
  <h3>Outputs</h3><div class="program-pins">{outputs}</div>
</div>"""


def _pins(unit: "UnitPicture", pins: "Sequence[PinPicture]") -> str:
    return "".join(
        f'<span class="program-pin" data-help="{escape(pin.help)}"><i class="led" '
        f'data-level="u.{escape(unit.name)}.pin.{escape(pin.name)}"></i>{escape(pin.name)}</span>'
        for pin in pins[:SHOWN_PINS]
    )


PAGE = Page("Program", "/program", "program", build, ("program.js",), ("program.css",), offer)
