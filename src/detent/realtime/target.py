"""What is run, served or looked at: a model by name, or a cell file."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from detent.cell.description import Description, Problem, parse, single
from detent.controllers import catalogue
from detent.realtime.texts import read_text


class Target(NamedTuple):
    """A cell to be built: its description, how to read the files it names, and a name for what it writes."""

    description: Description
    read: Callable[[str], str]
    name: str


def target(
    text: str,
    *,
    straps: Sequence[str] = (),
    options: Sequence[str] = (),
    programs: Sequence[str] = (),
) -> Target:
    """The cell that `text` (MODEL or CELL.toml) means. Straps and options are written NAME=VALUE.

    For a cell they say which unit: UNIT.NAME=VALUE, and programs UNIT=FILE. Raises Problem.
    """
    if text.endswith(".toml") or "/" in text:
        path = Path(text)
        try:
            source = read_text(path)
        except (OSError, ValueError) as error:  # ValueError: a name with a NUL
            raise Problem(text, "", f"cannot read it: {getattr(error, 'strerror', None) or error}") from None
        description = _with_choices(parse(source, text), straps, options, programs)
        return Target(description, lambda file: read_text(path.parent / file), path.stem)
    try:
        catalogue.model(text)
    except catalogue.CatalogueError as error:
        raise Problem("", "", f"{error}; a cell file ends in .toml") from None
    if len(programs) > 1:
        raise Problem("", "--program", "one unit runs one program: give it once")
    description = single(
        text,
        straps=dict(_pair("--strap", item) for item in straps),
        options=dict(_pair("--set", item) for item in options),
        program=programs[0] if programs else None,
    )
    return Target(description, lambda file: read_text(Path(file)), text)


def _pair(flag: str, item: str) -> tuple[str, str]:
    name, equals, value = item.partition("=")
    if not (name and equals and value):
        raise Problem("", flag, f"{item!r}: write NAME=VALUE")
    return name, value


def _with_choices(
    description: Description, straps: Sequence[str], options: Sequence[str], programs: Sequence[str]
) -> Description:
    """The description with what the command line changes in it."""
    units = {name: unit.model_dump() for name, unit in description.units.items()}
    for flag, field, items in (("--strap", "straps", straps), ("--set", "options", options)):
        for item in items:
            place, value = _pair(flag, item)
            unit, dot, name = place.partition(".")
            if not dot:
                raise Problem("", flag, f"{item!r}: a cell has several units, write UNIT.NAME=VALUE")
            _need(flag, unit, units)
            units[unit][field] = {**units[unit][field], name: value}
    for item in programs:
        unit, file = _pair("--program", item)
        _need("--program", unit, units)
        units[unit]["program"] = str(Path(file).absolute())
    changed = {name: type(description.units[name]).model_validate(unit) for name, unit in units.items()}
    return description.model_copy(update={"units": changed})


def _need(flag: str, unit: str, units: Mapping[str, object]) -> None:
    if unit not in units:
        raise Problem("", flag, str(catalogue.unknown("unit", unit, tuple(units))))
