"""The axes of an emulated cell: which driver each needs, on which line, and what that driver is told."""

from collections.abc import Mapping
from typing import NamedTuple

from detent.cell.cell import Cell
from detent.cell.description import Description, Problem
from detent.controllers import catalogue
from detent.controllers.gsc200 import pins as gsc200_pins
from detent.hosts.genstepper.dialogue import MOTORS
from detent.pins import HIGH, Level
from detent.realtime.connect import HOSTS
from detent.uart import Format


class CellAxis(NamedTuple):
    """An axis of unit `title`: the model of its driver, what that is told, and its line."""

    title: str
    model: str
    options: Mapping[str, object]
    line: int  # number of the line in the cell
    form: Format


def axes(description: Description, cell: Cell) -> list[CellAxis]:
    """Every axis that a host outside can drive, in file order. Raises Problem if there is none."""
    controllers = cell.controllers()
    found = []
    for unit, entry in description.units.items():
        if entry.model not in HOSTS:
            continue  # an adapter, or another part
        on = next((line for line in description.lines.values() if unit in line.units), None)
        adapter = on.host if on is not None else None
        number = cell.wiring.line_of[cell.unit(adapter or unit)]
        if number < 0:
            continue
        given = _options(description, unit, controllers[unit].straps)
        found += [
            CellAxis(f"{unit} {motor}" if motor else unit, entry.model, {**given, **more}, number,
                     cell.lines[number].format)
            for motor, more in ([(motor, {"motor": motor}) for motor in MOTORS] if "motor" in HOSTS[entry.model].options
                                else [("", {})])
        ]  # fmt: skip
    if not found:
        raise Problem(description.file, "units", "there is no controller on a serial line whose axis could be driven")
    return found


def _options(description: Description, unit: str, straps: Mapping[str, Level]) -> dict[str, object]:
    """What the driver of `unit` is told, by its straps, its options and its line."""
    entry = description.units[unit]
    model = catalogue.MODELS[entry.model]
    chosen = {option.name: str(entry.options.get(option.name, option.default)) for option in model.options}
    known = HOSTS[entry.model].options
    if "checksums" in known:
        given: dict[str, object] = {"checksums": straps["CHS"] == HIGH, "address": gsc200_pins.address(straps)}
        return given | ({"revision": chosen["revision"]} if "revision" in chosen else {})
    if "drive" in known:
        return {"drive": int(chosen["number"])}
    if "mode" in known:
        return _mode(description, unit, chosen["name"], straps)
    return {}


def _mode(description: Description, unit: str, name: str, straps: Mapping[str, Level]) -> dict[str, object]:
    """How the axis of a DCB-274 is addressed. In a daisy chain the driver gives the names, A to the first unit."""
    on = next((line for line in description.lines.values() if unit in line.units), None)
    if on is not None and on.kind == "daisy-chain":
        return {"mode": "daisy", "first": "A", "name": chr(ord("A") + list(on.units).index(unit))}
    if on is not None and on.host is not None:
        return {"mode": "sin10" if description.units[on.host].model == "sin-10" else "party", "name": name}
    return {"mode": "party", "name": name} if straps.get("PARTY") == HIGH else {}
