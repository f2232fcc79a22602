"""The page Cell: every unit as a front panel, the panel switches, motors and axes, and the wires between them."""

import json
from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING

from nicegui import ui

from detent.realtime.verbs import FAULTS, VERBS
from detent.workbench.icons import icon
from detent.workbench.messages import LinePicture, MotorPicture, Picture, PinPicture, SwitchPicture, UnitPicture
from detent.workbench.pages import Page, Window
from detent.workbench.units.beside import emulated

if TYPE_CHECKING:
    from detent.workbench.client import Bench

TURN = 200  # steps of a turn of the dial where no motor is fitted that would say

LONGEST_ADDRESS = 28  # characters that fit a panel

MANY = 5  # units of a cell whose panels are compact until somebody says otherwise

DRIVES = ("output", "open collector", "winding")


def build(bench: "Bench", window: Window) -> None:
    """The cell as it is now; it is built anew when there is another picture of it."""

    @ui.refreshable
    def drawing() -> None:
        ui.html(markup(bench.picture, bench.control_url), sanitize=False)

    seen = bench.picture

    def look() -> None:
        nonlocal seen
        if bench.picture is not seen:
            seen = bench.picture
            drawing.refresh()

    drawing()
    window.each_state(look)


def markup(picture: Picture, control: str | None = None) -> str:
    """The whole cell as HTML bound to the live table; `control` is where programs do the same as hands."""
    jacks = {end for wire in picture.wires for end in (wire.source, *wire.targets)}
    panel = [switch for switch in picture.switches.values() if switch.axis is None]
    loose = [motor for motor in picture.motors.values() if motor.unit is None]
    cards = "".join(_unit(picture, unit, jacks) for unit in picture.units.values())
    cards += "".join(_loose_motor(picture, motor, jacks) for motor in loose)
    wires = json.dumps([[wire.source, list(wire.targets)] for wire in picture.wires])
    count = len(picture.units) + len(loose)
    compact = f"""<div class="cell-tools"><button class="key small" data-part="compact" data-units="{count}"
 data-many="{MANY}" aria-pressed="false" data-help="Small panels without pins, straps and wires, or all of it">Compact
</button></div>"""
    return (
        f"{compact}"
        f'<div class="cell{" with-panel" if panel else ""}" data-part="wires" data-wires="{escape(wires)}">'
        f'<svg class="wires" aria-hidden="true"></svg>{_panel(panel) if panel else ""}'
        f'<div class="units" style="--count:{max(1, count)}">{cards}</div></div>'
        f"{_breaking(picture, control)}"
    )


def _breaking(picture: Picture, control: str | None) -> str:
    """What can break, and what is broken: the faults of the control API."""
    places = {
        "line": [line.name for line in picture.lines.values()],
        "unit": list(picture.units),
        "switch or UNIT.PIN": [
            *picture.switches,
            *(f"{unit.name}.{pin.name}" for unit in picture.units.values() for pin in unit.pins if pin.kind == "input"),
        ],
    }
    kinds = [[kind.name, kind.help, kind.takes, places[kind.where]] for kind in FAULTS.values()]
    helps = {parameter.name: parameter.help for parameter in VERBS["fault"].parameters}
    options = "".join(f'<option value="{escape(kind.name)}">{escape(kind.help)}</option>' for kind in FAULTS.values())
    command = f"detent control {control}"
    programs = f"""<p class="programs quiet">Programs look at this cell and meddle with it, too: <button type="button"
 class="endpoint num" data-part="copy" data-copy="{escape(command)}" data-help="Without a word more it shows how
everything stands; help lists what else it does. Click to copy">{escape(command)}</button></p>"""
    shown = "" if control else " unreal"  # a machine is not broken for a trial: the engine refuses it
    return f"""<section class="panel breaking{shown}" aria-label="Break it" data-part="breaking"
 data-kinds="{escape(json.dumps(kinds))}" data-helps="{escape(json.dumps(helps))}">
<div class="panel-head unreal"><h2>Break it</h2><span class="quiet grow">What a real cell does some day: every fault can
be mended, and taken back on the time line.</span></div>
<form class="row unreal"><select class="field" name="kind" aria-label="What breaks">{options}</select>
<select class="field" name="where" aria-label="Where"></select><span class="row more"></span>
<label class="quiet">for <input class="field num" name="for" placeholder="until mended" aria-label="For how long"
 data-help="A time like 200 ms, or seconds; empty: until it is mended"></label>
<button class="key primary">Break</button></form>
<ul class="standing unreal" aria-label="Faults that stand"></ul>{programs if control else ""}</section>"""


def _panel(switches: Iterable[SwitchPicture]) -> str:
    """The switches that a hand sets."""
    rows = "".join(
        f"""<button class="toggle" role="switch" aria-checked="false" data-do="set_switch"
 data-args="{_args(s.name, f"!s.{s.name}.level")}"
 data-pressed="s.{escape(s.name)}.level" data-jack="{escape(s.name)}" data-side="right"
 data-help="Switch {escape(s.name)}: drives {escape(", ".join(s.drives))}">
<span class="name">{escape(s.name)}</span><i class="lever" aria-hidden="true"></i>
<b class="num" data-live="s.{escape(s.name)}.level" data-form="level"></b><i class="jack"></i></button>"""
        for s in switches
    )
    return f"""<section class="panel panel-switches" aria-label="Switches">
<div class="panel-head"><h2>Switches</h2></div>{rows}</section>"""


def _unit(picture: Picture, unit: UnitPicture, jacks: set[str]) -> str:
    """The front panel of a unit."""
    name, key = escape(unit.name), escape(f"u.{unit.name}")
    line = picture.lines.get(unit.line) if unit.line is not None else None
    axes = "".join(_axis(picture, unit, axis, jacks) for axis in unit.axes)
    power = f"""<button class="power" role="switch" aria-checked="false" data-do="power" data-pressed="{key}.powered"
 data-args="{_args(unit.name, f"!u.{unit.name}.powered")}" aria-label="Power of {name}"
 data-help="Power of {name}">{icon("power")}</button>"""
    if not unit.axes:
        power = ""  # a part that moves nothing tells nothing of its supply
    return f"""<section class="unit panel" data-unit="{name}" data-level="{key}.powered" aria-label="Unit {name}">
<div class="panel-head">{power}<h2>{name}</h2>
<span class="quiet model" data-help="{escape(unit.title)}">{escape(unit.model)}</span>
<span class="state" data-live="{key}.state" data-level="{key}.state"></span></div>
{axes}{_doing(unit)}{_pins(unit, jacks)}{_straps(unit)}{_foot(unit, line)}</section>"""


def _doing(unit: UnitPicture) -> str:
    """The instruction that the unit is at, and what it turned down last."""
    name, key = escape(unit.name), escape(f"u.{unit.name}")
    if not unit.axes:
        return ""
    row = f"""<div class="doing"><span class="quiet num" data-live="{key}.address"></span>
<span class="num grow now" data-live="{key}.running"></span>
<button class="key small" data-do="step_instruction" data-args="{_args(unit.name)}"
 aria-label="One instruction of {name}" data-help="Run one instruction of {name}, then pause">{icon("step")}</button>
<button class="key small" data-do="start" data-args="{_args(unit.name)}" aria-label="Start the program of {name}"
 data-help="Start the program in memory">{icon("start")}</button></div>"""
    fault = f"""<div class="fault" data-level="{key}.error"><i class="led"></i>
<span class="grow" data-live="{key}.error"></span></div>"""
    return (row if unit.language else "") + fault


def _axis(picture: Picture, unit: UnitPicture, axis: str, jacks: set[str]) -> str:
    """An axis: its readout, its dial and its slide with the switches on it."""
    place = escape(f"u.{unit.name}.x.{axis}")
    motor = next((m for m in picture.motors.values() if m.unit == unit.name and m.axis == axis), None)
    named = f"{unit.name}.{axis}" if axis else unit.name
    owners = (named,) if motor is None else (named, motor.name)
    switches = [s for s in picture.switches.values() if s.axis in owners]
    dial = _dial(f"u.{unit.name}.x.{axis}.shaft", TURN, None)
    if motor is not None:
        dial = _dial(f"m.{motor.name}.place", motor.steps, motor)
    label = f'<span class="axis-name">{escape(axis)}</span>' if axis else ""
    readout = f"""<div class="readout">{label}<span class="first"><output data-live="{place}.position" data-form="steps"
 aria-label="Position of {escape(named)}" data-help="Position by the counter of the controller, in steps"></output>
<small>steps</small></span><span class="second">
<b data-live="{place}.rate" data-form="rate" data-help="Rate now"></b><small>steps/s</small>
<b data-live="{place}.pulses" data-form="count" data-help="Step pulses given since the cell began"></b>
<small>pulses</small></span>{_rotor(motor)}</div>"""
    pins = _motor_pins(picture, motor, jacks) if motor is not None else ""
    slide = _slide(unit.name, axis, motor, switches)
    return f'<div class="axis">{dial}{readout}</div>{slide}{pins}{_manual(picture, unit, axis, motor)}'


def _dial(key: str, turn: float, motor: MotorPicture | None) -> str:
    """A dial whose pointer turns once in `turn` steps."""
    what = f"Rotor of {motor.name} ({motor.motor})" if motor is not None else "The shaft as the pulses command it"
    ticks = "".join(
        f'<line x1="0" y1="-44" x2="0" y2="{-38 if n % 5 else -35}" transform="rotate({n * 18})"/>' for n in range(20)
    )
    command = '<g class="command"><line x1="0" y1="-20" x2="0" y2="-40"/></g>' if motor is not None else ""
    bound = f' data-command="m.{escape(motor.name)}.command"' if motor is not None else ""
    return f"""<svg class="dial" viewBox="-50 -50 100 100" data-part="dial" data-key="{escape(key)}"
 data-turn="{turn:g}"{bound} data-help="{escape(what)}: one turn is {turn:g} steps" role="img"
 aria-label="{escape(what)}"><circle class="face" r="47"/><g class="ticks">{ticks}</g>{command}
<g class="pointer"><path d="M-3.5 9L-1.5-34h3L3.5 9z"/><circle r="6"/></g></svg>"""


def _rotor(motor: MotorPicture | None) -> str:
    """Where the rotor is, beside what it was commanded."""
    if motor is None:
        return ""
    key = escape(f"m.{motor.name}")
    return f"""<span class="rotor" data-level="{key}.lost"><small>rotor</small>
<b data-live="{key}.place" data-form="fixed"></b><b data-live="{key}.speed" data-form="rate"></b><small>steps/s</small>
<small class="lost">lost <span data-live="{key}.lost"></span></small></span>"""


def _slide(unit: str, axis: str, motor: MotorPicture | None, switches: Iterable[SwitchPicture]) -> str:
    """The axis as a slide. Its script draws the scale and lets the switches be dragged."""
    facts = {
        "key": f"m.{motor.name}.place" if motor is not None else f"u.{unit}.x.{axis}.shaft",
        "lead": motor.lead if motor is not None and motor.lead is not None else 1,
        "whole": motor is None,
        "switches": [s.name for s in switches],
    }
    contacts = "".join(
        f"""<div class="contact" data-jack="{escape(s.name)}" data-side="left" data-level="s.{escape(s.name)}.level"
 data-help="Switch {escape(s.name)} on the axis: drives {escape(", ".join(s.drives))}">
<i class="jack"></i><i class="led"></i><span class="name">{escape(s.name)}</span>
<span class="quiet num places" data-places="{escape(s.name)}"></span></div>"""
        for s in switches
    )
    return f'<div class="slide" data-part="slide" data-facts="{escape(json.dumps(facts))}"></div>{contacts}'


def _manual(picture: Picture, unit: UnitPicture, axis: str, motor: MotorPicture | None) -> str:
    """What a hand does with an axis: the host of its line says it in the unit's own commands, which are shown."""
    name = f"{unit.name} {axis}".strip()
    host = next((one for one in emulated(picture) if one.name == name), None)
    if host is None:
        return ""
    lead = motor.lead if motor is not None else None
    facts = {**host._asdict(), "lead": lead}
    title = escape(name)
    measure = (
        f"""<select class="field" data-role="measure" aria-label="Unit of length of {title}"><option>mm</option>
<option>°</option><option value="">steps</option></select>"""
        if lead is not None
        else '<span class="quiet">steps</span>'
    )

    def keys(kind: str, minus: str, plus: str, what: str) -> tuple[str, str]:
        made = [
            f'<button type="button" class="key small{" hold" * (kind == "hold")}" data-{kind}="{sign}" '
            f'aria-label="{what} {word} of {title}">{text}</button>'
            for sign, word, text in ((-1, "minus", minus), (1, "plus", plus))
        ]
        return made[0], made[1]

    jog, hold, home = (
        keys("jog", "&minus;", "+", "Jog"),
        keys("hold", "&#9664;", "&#9654;", "Hold"),
        keys("home", "&#8676; home", "home &#8677;", "Home"),
    )
    return f"""<details class="manual" data-part="manual" data-facts="{escape(json.dumps(facts))}">
<summary>Manual control</summary><div class="row wrap">{jog[0]}<input class="field num" data-role="by" type="number"
 step="any" value="100" aria-label="Distance or position of {title}">{measure}{jog[1]}
<button type="button" class="key small" data-role="go" aria-label="Go to, {title}">Go to</button>
<button type="button" class="key small" data-role="zero" aria-label="Set zero, {title}"
 data-help="Where the axis stands is 0 from then on">Set zero</button>
<button type="button" class="key small stop" data-role="stop" aria-label="STOP {title}"
 data-help="By its ramp; again: at once. Esc twice stops everything.">STOP</button></div>
<div class="row wrap">{hold[0]}<input class="field num" data-role="rate" type="number" min="0" step="any" value="200"
 aria-label="Rate of {title} while a key is held"><span class="quiet">/s, held</span>{hold[1]}{home[0]}{home[1]}</div>
<div class="sent mono" data-role="sent" aria-live="polite"></div></details>"""


def _motor_pins(picture: Picture, motor: MotorPicture, jacks: set[str]) -> str:
    """The pins of a motor to which wires lead. Their levels are those of the other end."""
    return "".join(
        f"""<div class="contact" data-jack="{escape(end)}" data-side="left"
 data-level="{escape(_other_end(picture, end))}"><i class="jack"></i>
<span class="name">{escape(motor.name)}</span><span class="num">{escape(end.partition(".")[2])}</span></div>"""
        for end in sorted(jack for jack in jacks if jack.startswith(f"{motor.name}."))
    )


def _other_end(picture: Picture, end: str) -> str:
    """The key of the level at the other end of the wire to a motor's pin."""
    wire = next(wire for wire in picture.wires if end in (wire.source, *wire.targets))
    far = wire.targets[0] if end == wire.source else wire.source
    unit, dot, pin = far.partition(".")
    return f"u.{unit}.pin.{pin}" if dot else f"s.{unit}.level"


def _pins(unit: UnitPicture, jacks: set[str]) -> str:
    """Inputs on the left, outputs on the right, each with its jack at the edge."""
    inputs = [pin for pin in unit.pins if pin.kind == "input"]
    outputs = [pin for pin in unit.pins if pin.kind in DRIVES and (pin.kind != "winding" or pin.wired)]
    if not inputs and not outputs:
        return ""
    left = "".join(_pin(unit, pin, "left", f"{unit.name}.{pin.name}" in jacks) for pin in inputs)
    right = "".join(_pin(unit, pin, "right", f"{unit.name}.{pin.name}" in jacks) for pin in outputs)
    registers = f'<dl class="registers" data-part="registers" data-key="u.{escape(unit.name)}.reg"></dl>'
    return f"""<div class="pins"><div class="side">{left}</div><div class="side">{right}</div>
{registers if unit.axes else ""}</div>"""


def _pin(unit: UnitPicture, pin: PinPicture, side: str, wired: bool) -> str:
    """A pin: its jack, its lamp, its level, its name. An input can be clicked."""
    end, key = escape(f"{unit.name}.{pin.name}"), escape(f"u.{unit.name}.pin.{pin.name}")
    number = f"pin {pin.number}, " if pin.number is not None else ""
    told = escape(f"{pin.name} ({number}{pin.kind}): {pin.help}")
    inner = f"""<i class="jack"></i><i class="led"></i><b class="num" data-live="{key}" data-form="level"></b>
<span class="name">{escape(pin.name)}</span>"""
    shared = (
        f"""class="pin {side}{" wired" if wired else ""}" data-level="{key}" data-side="{side}" data-jack="{end}\""""
    )
    if pin.kind != "input":
        return f'<div {shared} data-help="{told}" tabindex="0">{inner}</div>'
    return f"""<button {shared} data-part="input-pin" data-unit="{escape(unit.name)}" data-pin="{escape(pin.name)}"
 data-help="{told}. Click: hold a wire of the other level to it; click again: take it away.">{inner}</button>"""


def _straps(unit: UnitPicture) -> str:
    """The straps as a block of small switches."""
    keys = "".join(
        f"""<button class="strap" role="switch" aria-checked="false" data-do="set_strap"
 data-pressed="u.{escape(f"{unit.name}.pin.{pin.name}")}"
 data-args="{_args(unit.name, pin.name, f"!u.{unit.name}.pin.{pin.name}")}"
 aria-label="Strap {escape(pin.name)} of {escape(unit.name)}"
 data-help="{escape(f"{pin.name}: {pin.help}. Read at the next power-on.")}">
<i aria-hidden="true"></i><span>{escape(pin.name)}</span></button>"""
        for pin in unit.pins
        if pin.name in unit.straps
    )
    return f'<div class="straps" role="group" aria-label="Straps of {escape(unit.name)}">{keys}</div>' if keys else ""


def _foot(unit: UnitPicture, line: LinePicture | None) -> str:
    """A command line to the unit, and where a host finds it."""
    if line is None:
        return ""
    name = escape(unit.name)
    if line.host is not None:
        return f"""<div class="foot"><span class="quiet where"><span data-live="l.{escape(line.name)}.format">
{escape(line.format)}</span>
<span>line {escape(line.name)}, on which {escape(line.host)} is the host</span></span></div>"""
    ends = "".join(
        f"""<button type="button" class="endpoint num" data-part="copy" data-copy="{escape(one.address)}"
 data-help="Where a host program connects to line {escape(line.name)}: click to copy"
>{escape(short(one.address))}</button>"""
        for one in line.endpoints
    )
    return f"""<form class="foot" data-part="command" data-unit="{name}">
<input class="field mono grow" aria-label="Command to {name}" placeholder="Command to {name}" spellcheck="false"
 autocomplete="off" autocapitalize="off">
<button class="key" aria-label="Send to {name}">{icon("send")}</button>
<span class="quiet where"><span data-live="l.{escape(line.name)}.format">{escape(line.format)}</span>
{ends}</span></form>"""


def short(address: str) -> str:
    """An address as it fits a panel: of a long path its end."""
    return address if len(address) <= LONGEST_ADDRESS else "…/" + address.rpartition("/")[2]


def _loose_motor(picture: Picture, motor: MotorPicture, jacks: set[str]) -> str:
    """A motor whose steps a wire brings."""
    name = escape(motor.name)
    switches = [s for s in picture.switches.values() if s.axis == motor.name]
    return f"""<section class="unit panel" aria-label="Motor {name}" data-value="true">
<div class="panel-head"><h2>{name}</h2><span class="quiet model">{escape(motor.motor)}</span></div>
<div class="axis">{_dial(f"m.{motor.name}.place", motor.steps, motor)}<div class="readout">
<span class="first"><output data-live="m.{name}.command" data-form="steps"></output>
<small>steps</small></span>{_rotor(motor)}</div></div>
{_slide("", "", motor, switches)}{_motor_pins(picture, motor, jacks)}</section>"""


def _args(*values: object) -> str:
    return escape(json.dumps(values))


PAGE = Page(
    "Cell", "/", "cell", build, scripts=("wires.js", "cell.js", "manual.js", "breaking.js"), styles=("cell.css",)
)
