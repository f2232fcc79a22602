"""Programs that turn in loops and do nothing else (polls, waits, an endless jump) are not run through turn by turn.

A copy of the unit is let run ahead. Where it is as the unit is now, but for everything being later by so much, that
is a turn: whatever follows is the same again, until something comes from outside. So the unit is put where it is at
the end of the last turn before that, and the recording is told one turn. What leads to another part, moves or speaks
is no such loop; nor is one that takes more than `MOST` instants.
"""

from collections import deque
from types import MethodType

from detent.cell.circuit import Circuit
from detent.cell.copying import duplicate
from detent.cell.recording import Entry
from detent.cell.turns import Turn, Turns
from detent.controllers.device import Executing, Looping
from detent.pins import PinSet
from detent.ticks import Ns

PATIENCE = 4  # instants that are run through, for each that a copy may run ahead
LEAST, MOST = 16, 1 << 14  # instants of a turn: those that are looked for first, and at all
FIRST = LEAST * PATIENCE  # eventful instants of a cell before it is looked for
WORTH = 8  # turns that are worth it


def pass_over(circuit: Circuit, until: Ns, most: int) -> bool:
    """Let the programs that turn in loops do so until something else happens, before `until`; whether they did.

    A turn of more than `most` instants is not found. What happens at `until` is left to do, as is what ends it.
    """
    loops: list[int] = []
    until = min(until, circuit.line_deadline)
    for part, deadline in enumerate(circuit.deadlines):
        if deadline < until:
            if _loops(circuit, part):
                loops.append(part)
            else:
                until = deadline
    turns: list[Turn[Entry]] = []
    for part in sorted(loops, key=circuit.turn_of.__getitem__):
        if circuit.deadlines[part] < until:
            turn = _turn(circuit, part, until, most)
            if turn is None:
                return False
            turns.append(turn)
    if all(until - turn.begins < WORTH * turn.period for turn in turns):
        return False
    for turn in turns:
        _forward(circuit, turn, until)
    if circuit.recording is not None:
        circuit.recording.turn(Turns(turns, until))
    return True


def _loops(circuit: Circuit, part: int) -> bool:
    return hasattr(circuit.parts[part], "only_its_program") and _unit(circuit, part).only_its_program(circuit.now)


def _unit(circuit: Circuit, part: int) -> Looping:
    return circuit.parts[part]  # type: ignore[return-value]  # it was asked


def _turn(circuit: Circuit, part: int, until: Ns, most: int) -> Turn[Entry] | None:
    """The turn that a unit is about to begin, if it ends before `until`."""
    wired = circuit.wiring.drives[part]
    before, ahead = duplicate(_unit(circuit, part)), duplicate(_unit(circuit, part))
    registers = before.registers(circuit.now)
    begins = at = circuit.deadlines[part]
    entries: list[Entry] = []
    passed: Ns = 0
    for _ in range(most):
        ahead.advance(at)
        for entry in ahead.drain():
            kind = type(entry)
            if entry.at != at or not (kind is Executing or (kind is PinSet and entry.pin not in wired)):  # type: ignore[union-attr]
                return None
            entries.append(entry)
        following = ahead.next_deadline()
        if following is None or not at < following <= until:
            return None
        if ahead.only_its_program(at) and ahead.registers(at) == registers:  # a round of a loop tells itself soon
            before.postpone(following - begins - passed)
            passed = following - begins
            if same(before, ahead):
                return Turn(part, begins, passed, tuple(entries))
        at = following
    return None


def _forward(circuit: Circuit, turn: Turn[Entry], until: Ns) -> None:
    """Put a unit where it is when it has turned up to `until`."""
    unit = _unit(circuit, turn.unit)
    unit.postpone((until - turn.begins) // turn.period * turn.period)
    while (at := unit.next_deadline()) is not None and at < until:
        unit.advance(at)
        unit.drain()  # it is in the turn
    assert at is not None
    circuit.deadlines[turn.unit] = at


_PLAIN = (int, str, bytes, bool, float, type(None))


def same(one: object, other: object, known: dict[int, int] | None = None) -> bool:
    """Whether two things of any make are equal in everything that they are made of."""
    if one is other:
        return True
    kind = type(one)
    if kind is not type(other):
        return False
    if kind in _PLAIN:
        return one == other
    known = {} if known is None else known
    if id(one) in known:
        return known[id(one)] == id(other)
    known[id(one)] = id(other)
    if isinstance(one, list | tuple | deque):
        return len(one) == len(other) and all(same(a, b, known) for a, b in zip(one, other, strict=True))  # type: ignore
    if isinstance(one, dict):
        if list(one) != list(other):  # type: ignore[call-overload]
            return False
        return all(same(value, other[key], known) for key, value in one.items())  # type: ignore[index]
    if isinstance(one, MethodType):
        return one.__func__ is other.__func__ and same(one.__self__, other.__self__, known)  # type: ignore[attr-defined]
    mine, yours = _made_of(one), _made_of(other)
    if not mine:
        return one == other
    return list(mine) == list(yours) and all(same(value, yours[name], known) for name, value in mine.items())


def _made_of(thing: object) -> dict[str, object]:
    """The attributes of an object by their names."""
    slots = [name for base in type(thing).__mro__ for name in getattr(base, "__slots__", ())]
    return getattr(thing, "__dict__", {}) | {name: getattr(thing, name) for name in slots if hasattr(thing, name)}
