"""Where a cell comes from that is run, served or looked at: a model by name, or a cell file."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from detent.cell.description import Description, Problem, parse, single
from detent.cell.parts import PARTS
from detent.controllers import catalogue
from detent.pins import PinKind
from detent.realtime.texts import read_text


class CellSource(NamedTuple):
    """A cell to be built: its description, how to read the files it names, and a name for what it writes."""

    description: Description
    read: Callable[[str], str]
    name: str
    inputs: tuple[Path, ...] = ()  # every file that it is read from


def find_cell(
    text: str,
    *,
    straps: Sequence[str] = (),
    options: Sequence[str] = (),
    programs: Sequence[str] = (),
    pins: Sequence[str] = (),
) -> CellSource:
    """The cell that `text` (MODEL or CELL.toml) means. Straps, options and pins are written NAME=VALUE.

    For a cell they say which unit: UNIT.NAME=VALUE, and programs UNIT=FILE. A pin is an input that is held at a level
    by a switch of its name, from before the supply comes. Raises Problem.
    """
    if text.endswith(".toml") or "/" in text:
        path = Path(text)
        try:
            source = read_text(path)
        except (OSError, ValueError) as error:  # ValueError: a name with a NUL
            raise Problem(text, "", f"cannot read it: {getattr(error, 'strerror', None) or error}") from None
        description = _with_pins(_with_choices(parse(source, text), straps, options, programs), pins, "")
        of_motors = [entry.motor for entry in description.motors.values() if entry.motor.endswith(".toml")]
        if of_motors:
            from detent.cell.fitting import with_own_motors

            description = with_own_motors(description, lambda file: read_text(path.parent / file))
        files = [*of_motors]
        files += [file for unit in description.units.values() for file in (unit.program, unit.eeprom) if file]
        inputs = (path, *(path.parent / file for file in files))
        return CellSource(description, lambda file: read_text(path.parent / file), path.stem, inputs)
    try:
        catalogue.model(text)
    except catalogue.CatalogueError as error:
        raise Problem("", "", f"{error}; a cell file ends in .toml") from None
    if len(programs) > 1:
        raise Problem("", "--program", "one unit runs one program: give it once")
    if "" in programs:  # of a shell whose variable is empty
        raise Problem("", "--program", "no file is named: write --program FILE")
    description = single(
        text,
        straps=dict(_pair("--strap", item) for item in straps),
        options=dict(_pair("--set", item) for item in options),
        program=programs[0] if programs else None,
    )
    description = _with_pins(description, pins, text)
    return CellSource(description, lambda file: read_text(Path(file)), text, tuple(map(Path, programs)))


def _pair(flag: str, item: str) -> tuple[str, str]:
    name, equals, value = item.partition("=")
    if not (name and equals and value):
        raise Problem("", flag, f"{item!r}: write NAME=VALUE")
    return name, value


def _with_choices(
    description: Description, straps: Sequence[str], options: Sequence[str], programs: Sequence[str]
) -> Description:
    """The description with what the command line changes in it."""
    units = dict(description.units)
    for flag, items in (("--strap", straps), ("--set", options)):
        for item in items:
            place, value = _pair(flag, item)
            unit, dot, name = place.partition(".")
            if not dot:
                raise Problem("", flag, f"{item!r}: a cell has several units, write UNIT.NAME=VALUE")
            _need(flag, unit, units)
            before = units[unit]
            if flag == "--strap":
                units[unit] = replace(before, straps={**before.straps, name: value})
            else:
                units[unit] = replace(before, options={**before.options, name: value})
    for item in programs:
        unit, file = _pair("--program", item)
        _need("--program", unit, units)
        units[unit] = replace(units[unit], program=str(Path(file).absolute()))
    return replace(description, units=units)


def _with_pins(description: Description, pins: Sequence[str], alone: str) -> Description:
    """The description with inputs held at a level; those of the unit `alone`, if it is, are written without it."""
    if not pins:
        return description
    from detent.cell.tables import Switch

    switches = dict(description.switches)
    for item in pins:
        place, value = _pair("--pin", item)
        unit, dot, name = (alone, ".", place) if alone else place.rpartition(".")
        if not dot:
            raise Problem("", "--pin", f"{item!r}: a cell has several units, write UNIT.PIN=LEVEL")
        _need("--pin", unit, description.units)
        model = description.units[unit].model
        found = (
            PARTS[model].pins if model in PARTS else catalogue.MODELS[model].pins if model in catalogue.MODELS else ()
        )
        kinds = {pin.name: pin.kind for pin in found}
        inputs = [pin for pin, kind in kinds.items() if kind.reads and kind not in (PinKind.STRAP, PinKind.SERIAL)]
        if kinds.get(name) is PinKind.STRAP:
            raise Problem("", "--pin", f"{name} is a strap: give --strap {item}")
        if name not in inputs:
            raise Problem("", "--pin", str(catalogue.unknown(f"input of the {model}", name, inputs)))
        target = f"{unit}.{name}"
        if any(target in switch.drives for switch in switches.values()):
            raise Problem("", "--pin", f"a switch of the cell drives {target}: set that in its file")
        if any(target in wire.to for wire in description.wires):
            raise Problem("", "--pin", f"a wire leads to {target}: cut it in the cell file first")
        try:
            switches[name if alone else f"{unit} {name}"] = Switch.model_validate({"drives": target, "level": value})
        except ValueError:
            raise Problem("", "--pin", f"{item!r}: a level is 0, 1, low or high") from None
    return replace(description, switches=switches)


def _need(flag: str, unit: str, units: Mapping[str, object]) -> None:
    if unit not in units:
        raise Problem("", flag, str(catalogue.unknown("unit", unit, tuple(units))))
