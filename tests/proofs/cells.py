"""Whole cells under everything that can be done to them: lines, wires, switches, motors, faults, hands, supplies.

No exception but the refusals in words, and an oscillation that says so; deadlines that are not over, and not too many
of them; as many pulses as the counters say; a copy that goes on as the cell does; its journal makes the same recording.
"""

import re
from collections.abc import Callable
from random import Random
from typing import Any, Final, NamedTuple

from tests.controllers.laws.bench import Raw, Say, Travel
from tests.controllers.laws.histories import gap
from tests.controllers.laws.models import MODELS
from tests.controllers.laws.test_cells import LINES as SHARED
from tests.proofs.streams import CONTROL
from tests.proofs.tally import Tally

from detent.assembler import ImageError
from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.circuit import Oscillation
from detent.cell.description import Problem, parse
from detent.cell.faults import Fault, OnLine, StuckPin, StuckSwitch, SupplyDip, WriteFailure
from detent.cell.parts import PARTS
from detent.controllers import catalogue
from detent.controllers.device import Controller
from detent.lines.faults import BOTH, HOST, UNITS, BitErrors, CableOut, Delay, LostCharacters
from detent.pins import HIGH, LOW, PinKind
from detent.ticks import MS, SECOND, Ns
from detent.uart import Char

BY_NAME: Final = {model.name: model for model in MODELS}
ALONE: Final = tuple(BY_NAME)
ASIDE: Final = ("step-detector", "phase-reversal")  # units without a line
ACTIONS: Final = 25
MOST_EVENTS: Final = 70_000  # in a second, for each unit: a loop of wires through a board may swing at its every tick
ENOUGH: Final = 100_000  # events of a case: it ends there
_ADDRESS: Final = re.compile(r" at 0x[0-9a-f]+")


class Plan(NamedTuple):
    """A cell as its file would be, and whether characters take time on its lines."""

    text: str
    timed: bool


class Moved(Travel):
    """An axis whose shaft somebody may have turned: only its pulses are counted."""

    def shaft(self, now: Ns) -> int:
        return 0 if self.motion is None else self.motion.shaft + self.motion.direction * self.given(now)

    def take(self, item: MotionStarted | MotionCut | MotionEnded) -> None:
        if isinstance(item, MotionStarted):
            self._rest = item.shaft + item.direction * (item.first - 1)  # wherever that is
            self._pulses, self.motion = self.count(item.at) - (item.first - 1), item
        else:
            super().take(item)


def plan(draw: Random) -> Plan:
    """A cell of one to four units that can be built."""
    while True:
        made = Plan(_text(draw), draw.random() < 0.5)
        try:
            build(parse(made.text, "fuzz.toml"), _no_file, record=False)
        except Problem:
            continue  # an output on an output, a wire that a strap is tied to
        return made


def _no_file(name: str) -> str:
    raise FileNotFoundError(name)


def _text(draw: Random) -> str:
    units: dict[str, str] = {}
    if draw.random() < 0.4:
        shared = SHARED[draw.choice(list(SHARED))]
        names = ("ux", "uy", "uz")[: draw.randint(2, 3)]
        text = shared.text(names)
        units = dict.fromkeys(names, shared.model)
    else:
        text = ""
        for number in range(draw.randint(1, 3)):
            units[f"u{number}"] = model = draw.choice(ALONE)
            straps = "straps = { CHS = 0 }\n" if model.startswith("gs") else ""
            text += f'[units.u{number}]\nmodel = "{model}"\n{straps}'
    for number in range(draw.choice((0, 0, 1, 2))):
        units[f"w{number}"] = model = draw.choice(ASIDE)
        text += f'[units.w{number}]\nmodel = "{model}"\n'
    sources = [f"{u}.{pin}" for u, m in units.items() for pin in _pins(m, PinKind.OUTPUT, PinKind.OPEN_COLLECTOR)]
    sinks = [f"{u}.{pin}" for u, m in units.items() for pin in _pins(m, PinKind.INPUT)]
    draw.shuffle(sinks)
    for _ in range(draw.randint(0, 4)):
        if sources and sinks:
            text += f'[[wires]]\nfrom = "{draw.choice(sources)}"\nto = "{sinks.pop()}"\n'
    for number in range(draw.randint(0, 3)):
        if sinks:
            text += f'[switches.s{number}]\ndrives = "{sinks.pop()}"\n' + _place(draw, units)
    moved = [u for u, m in units.items() if m == "gs-c200"]
    if moved and draw.random() < 0.15:
        load = "{ inertia = 4.0e-5, friction = 0.15 }"
        text += f'[motors.m]\nmotor = "qsh4218-41-10-035"\nunit = "{moved[0]}"\nsupply = 24\nload = {load}\n'
    return text


def _place(draw: Random, units: dict[str, str]) -> str:
    """On the axis of a unit, or moved by hand."""
    axes = [u for u, m in units.items() if m in BY_NAME and not m.startswith("bs")]
    axes += [f"{u}.{axis}" for u, m in units.items() if m.startswith("bs") for axis in "XY"]
    if not axes or draw.random() < 0.4:
        return ""
    at = draw.choice((-900, -40, -1, 3, 50, 1200))
    return f'axis = "{draw.choice(axes)}"\n' + draw.choice(
        (f"from = {at}\n", f"to = {at}\n", f"from = {at}\nto = {at + 4}\n")
    )


def _pins(model: str, *kinds: PinKind) -> list[str]:
    table = catalogue.MODELS[model].pins if model in catalogue.MODELS else PARTS[model].pins
    return [pin.name for pin in table if pin.kind in kinds]


def made(plan: Plan, journal: Any = ()) -> Cell:
    """The cell of a plan, with what was done to it if that is known."""
    return build(parse(plan.text, "fuzz.toml"), _no_file, line_timing=plan.timed, journal=journal)


def _in_words(error: Exception) -> bool:
    """Whether an action was refused, with a reason for people; else a unit broke."""
    found = error.args[0] if error.args else None
    known = (ValueError, KeyError, TypeError, RuntimeError, ImageError)
    return type(error) in known and isinstance(found, str) and " " in found


class Enough(Exception):
    """A cell has done so much that the case ends."""


class Hands:
    """Does things to a cell, drawn from `draw`; the same things to another that is in the same state."""

    def __init__(self, cell: Cell, draw: Random, tally: Tally) -> None:
        self.cell, self._draw, self._tally = cell, draw, tally
        self.events = 0

    def act(self) -> None:
        """One thing, and some time behind it."""
        action = self._action()
        try:
            action()
        except Oscillation:
            raise
        except (ValueError, KeyError, TypeError, RuntimeError) as refusal:
            if not _in_words(refusal):
                raise
            self._tally.refused += 1
        self.go_to(self.cell.now + min(gap(self._draw), SECOND))

    def go_to(self, until: Ns) -> None:
        """Event by event."""
        cell = self.cell
        while True:
            at = cell.next_event()
            assert at is None or at >= cell.now, f"the deadline {at} is over at {cell.now}"
            if at is None or at > until:
                break
            cell.run_to(at)
            self.events += 1
            most = 2_000 + 100 * ACTIONS + len(cell.wiring.names) * (MOST_EVENTS * cell.now // SECOND)
            assert self.events <= most, f"{self.events} events in {cell.now} ns"
            if self.events > ENOUGH:
                raise Enough
        cell.run_to(until)

    def _action(self) -> Callable[[], object]:
        cell, draw = self.cell, self._draw
        units = list(cell.wiring.names[: cell.wiring.units])
        unit = draw.choice(units)
        serial = cell.serial_units()
        if serial and draw.random() < 0.6:
            return self._say(draw.choice(serial))
        match draw.randrange(14):
            case 0 | 1 | 2:
                pin = draw.choice([pin.name for pin in cell.parts[cell.unit(unit)].pins])
                level = draw.choice((LOW, HIGH))
                return lambda: cell.set_pin(unit, pin, level)
            case 3:
                forced = list(cell.forced)
                if forced:
                    index, pin = draw.choice(forced)
                    return lambda: cell.release(cell.wiring.names[index], pin)
            case 4 | 5:
                switches = list(cell.wiring.names[cell.wiring.units :])
                if switches:
                    switch, level = draw.choice(switches), draw.choice((LOW, HIGH))
                    return lambda: cell.set_switch(switch, level)
            case 6:
                on = draw.random() < 0.6
                return lambda: cell.power(unit, on)
            case 7 | 8:
                fault, lasting = self._fault(unit), draw.choice((None, 3 * MS, 90 * MS))
                return lambda: cell.breaks(fault, lasting)
            case 9:
                standing = [*cell.faults.standing, 99]
                number = draw.choice(standing)
                return lambda: cell.mend(number)
            case 10:
                return lambda: cell.start(unit)
            case 11:
                return lambda: cell.halt(unit)
            case 12:
                by = draw.choice((-700, -1, 1, 5000))
                axis = draw.choice(("", "X", "Y"))
                return lambda: cell.displace(unit, axis, by)
        if cell.lines:
            line = draw.randrange(len(cell.lines))
            return lambda: cell.discard(line)
        return lambda: None

    def _say(self, unit: str) -> Callable[[], object]:
        cell, draw = self.cell, self._draw
        model = getattr(cell.parts[cell.unit(unit)], "model", "")
        if model not in BY_NAME:
            return lambda: None
        said = [action for action in BY_NAME[model].actions(draw) if isinstance(action, Say | Raw)]
        self._tally.frames += len(said)
        if draw.random() < 0.8:
            return lambda: [cell.type(unit, action.text) for action in said if isinstance(action, Say)]
        data = b"".join(action.data if isinstance(action, Raw) else action.text.encode() + b"\r" for action in said)
        chars = [Char(value, draw.random() < 0.95, draw.random() < 0.95) for value in data]
        chars += [Char(value) for value in draw.choices(CONTROL, k=draw.randint(0, 4))]
        line = cell.wiring.line_of[cell.unit(unit)]
        return lambda: cell.send(line, chars)

    def _fault(self, unit: str) -> Fault:
        cell, draw = self.cell, self._draw
        towards = draw.choice((UNITS, HOST, BOTH))
        line = draw.randrange(max(len(cell.lines), 1))
        bits = BitErrors(
            towards, draw.choice((0.1, 1.0)), 0, draw.choice(("", "parity", "framing", "6")), draw.randrange(9)
        )
        switches = list(cell.wiring.names[cell.wiring.units :])
        pins = [pin.name for pin in cell.parts[cell.unit(unit)].pins]
        return draw.choice((
            OnLine(line, bits), OnLine(line, LostCharacters(towards, 0.2)), OnLine(line, Delay(7 * MS, towards)),
            OnLine(line, CableOut(towards)), StuckPin(unit, draw.choice(pins), draw.choice((LOW, HIGH))),
            WriteFailure(unit, draw.choice((0, 1))), SupplyDip(unit),
            StuckSwitch(draw.choice(switches or ["none"]), draw.choice((LOW, HIGH))),
        ))  # fmt: skip


def check(number: int, tally: Tally, actions: int = ACTIONS) -> None:
    """Hold everything against the cell of that number. Raises AssertionError, or what the cell raises."""
    draw = Random(f"cell {number}")
    planned = plan(draw)
    cell = made(planned)
    hands = Hands(cell, draw, tally)
    cut = draw.randrange(actions) if number % 3 == 0 else actions
    twin: Cell | None = None
    oscillates = False
    try:
        for done in range(actions):
            if done == cut:
                twin, state = cell.copy(), draw.getstate()
            hands.act()
        hands.go_to(cell.now + SECOND)
    except Oscillation:
        oscillates = True
        tally.refused += 1
    except Enough:
        oscillates = True
    tally.events += hands.events
    if oscillates:
        return  # such a cell is no longer whole, and its owner is told; or all of it would take too long again
    told = recorded(cell)
    if twin is not None:
        other = Hands(twin, draw, Tally())
        draw.setstate(state)
        for _ in range(cut, actions):
            other.act()
        other.go_to(twin.now + SECOND)  # it does no more than the first, which was not too much
        assert recorded(twin) == told, "a copy goes on otherwise"
        tally.copies += 1
    again = made(planned, tuple(cell.journal))
    again.run_to(cell.now)
    assert recorded(again) == told, "the journal makes another recording"
    tally.replays += 1
    _count(cell, tally)


def _count(cell: Cell, tally: Tally) -> None:
    assert cell.recording is not None
    for name, controller in cell.controllers().items():
        travels = _travels(controller, cell, name)
        for axis, travel in travels.items():
            counted = controller.status(cell.now, axis).pulses
            assert counted == travel.count(cell.now), f"{name}: {counted} counted, {travel.count(cell.now)} given"
            tally.pulses += counted


def _travels(controller: Controller, cell: Cell, name: str) -> dict[str, Moved]:
    travels = {axis: Moved() for axis in controller.axes}
    assert cell.recording is not None
    for entry in cell.recording.of(name):
        if isinstance(entry, MotionStarted | MotionCut | MotionEnded):
            travels[entry.axis].take(entry)
    return travels


def recorded(cell: Cell) -> list[str]:
    """Everything that happened, as text that can be compared."""
    assert cell.recording is not None
    return [_ADDRESS.sub("", f"{unit} {entry!r}") for unit, entry in cell.recording]
