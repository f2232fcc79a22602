"""Faults by name: what a request means, and how a fault that stands is told."""

from collections.abc import Mapping
from typing import Final

from detent.cell.cell import Cell
from detent.cell.faults import Fault, OnLine, StuckPin, StuckSwitch, SupplyDip, WriteFailure
from detent.lines.faults import BitErrors, CableOut, Delay, LineFault, LostCharacters
from detent.pins import Level
from detent.realtime import verbs
from detent.realtime.names import Names
from detent.realtime.plain import as_json
from detent.realtime.verbs import AskedWrongly, Json

_ON_LINES: Final[Mapping[str, type[BitErrors | LostCharacters | Delay | CableOut]]] = {
    "bit-errors": BitErrors,
    "lost": LostCharacters,
    "delay": Delay,
    "cable-out": CableOut,
}


MOST: Final = 100
"""Faults that stand at once: each takes its time with every character of its line."""


def fault_of(names: Names, given: Mapping[str, object]) -> Fault:
    """The fault that is meant by the arguments of the verb `fault`. Raises AskedWrongly."""
    standing = names.cell.faults.standing
    if len(standing) >= MOST:
        raise AskedWrongly(f"{len(standing)} faults stand", "mend some first")
    kind, where = str(given["kind"]), str(given["where"])
    if kind not in verbs.FAULTS:
        raise verbs.unknown("kind of fault", kind, tuple(verbs.FAULTS))
    takes = verbs.FAULTS[kind].takes
    for name in given:
        if name not in ("where", "kind", "for", *takes):
            raise AskedWrongly(f"a fault {kind} takes no {name}", f"it takes: {', '.join((*takes, 'for'))}")
    options = {name: value for name, value in given.items() if name in verbs.FAULTS[kind].takes}
    if kind in _ON_LINES:
        if kind == "delay" and "by" not in options:
            raise AskedWrongly("by how much do characters come later", "give by, a time")
        fault: LineFault = _ON_LINES[kind](**options)  # type: ignore[arg-type]
        return OnLine(names.line(None if where == "line" else where), fault)
    if kind == "stuck":
        if "level" not in options:
            raise AskedWrongly(f"where is {where} stuck", "give level: 0, 1, low or high")
        if where in names.switches:
            return StuckSwitch(where, level(given))
        if "." not in where and len(names.units) > 1:
            raise verbs.unknown("switch", where, [*names.switches, "UNIT.PIN"])
        return StuckPin(*names.pin({"pin": where}), level(given))
    unit = names.unit({"unit": where})
    return SupplyDip(unit) if kind == "dip" else WriteFailure(unit, **options)  # type: ignore[arg-type]


def level(given: Mapping[str, object]) -> Level:
    """The level that is given."""
    found = given["level"]
    assert isinstance(found, int)
    return found


def arguments_of(cell: Cell, fault: Fault) -> dict[str, Json]:
    """The arguments of the verb `fault` that a fault was asked for with."""
    match fault:
        case OnLine(line, what):
            kind = next(name for name, made in _ON_LINES.items() if made is type(what))
            return {"kind": kind, "where": cell.wiring.line_names[line], **as_json(what)}
        case StuckSwitch(switch, level):
            return {"kind": "stuck", "where": switch, "level": level}
        case StuckPin(unit, pin, level):
            return {"kind": "stuck", "where": f"{unit}.{pin}", "level": level}
        case WriteFailure(unit, times):
            return {"kind": "eeprom", "where": unit, "times": times}
        case SupplyDip(unit):
            return {"kind": "dip", "where": unit}
