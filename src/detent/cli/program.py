"""The verbs `upload`, `download` and `compare`: program source, and the program memory of a unit."""

import json as json_text
import re
import sys
from collections.abc import Callable, Sequence
from difflib import unified_diff
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol, cast

from cyclopts import Parameter

from detent.assembler import Assembly, AssemblyFailed, Language, assemble
from detent.cli.codes import ASKED_WRONGLY, FAILED
from detent.cli.overwrite import Overwrite
from detent.cli.unit import NO_UNIT_OPTIONS, ModelName, PortName, UnitOptions

if TYPE_CHECKING:
    from detent.hosts.exchange import Blocking


class Programmed(Protocol):
    """A driver of a unit with program memory. `read_program` of one whose programs have places takes an address."""

    def write_program(self, lines: Sequence[str], /) -> object:
        """Store instructions, verified."""

    @property
    def read_program(self) -> Callable[..., list[str]]:
        """The instructions that are stored."""

    def save(self) -> object:
        """Keep the program over a power-off, where storing it does not do that."""


def upload(
    model: ModelName,
    port: PortName,
    file: Path,
    *,
    save: Annotated[bool, Parameter(negative=())] = False,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Assemble a program and store it in a unit, verified.

    Labels and comments are fine. Nothing is sent unless all of it can be assembled. The program is not started. A
    GS-C200 stays in programming mode, which only E ends, by starting it; that is told.

    For example: `detent upload gs-c200 /dev/ttyUSB0 drill.gsc --save`

    Parameters
    ----------
    file
        The source, one command a line.
    save
        Keep it over a power-off, too: M of a GS-C200, S of a DCB-274 for what stands at 128 to 191.
    json
        Print the result as one line of JSON.
    """
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected
    from detent.workbench.units.programs import lines_of

    assembly = _assembled(model, file)
    lines = lines_of(assembly)
    with progress(f"storing in the {model}") as watch, connected(model, port, unit, watch) as found:
        driver = _programmed(found)
        driver.write_program(lines)
        if save:
            driver.save()
        left_open = getattr(found.driver, "left_open", "")
    facts = {"model": model, "port": port, "file": str(file), "instructions": len(lines), "bytes": assembly.used}
    if json:
        print(json_text.dumps({**facts, "saved": save, **({"left_open": left_open} if left_open else {})}))
    else:
        kept = ", and saved it" if save else ""
        print(f"Stored {len(lines)} instructions, {assembly.used} bytes, read them back{kept}")
        if left_open:
            print(f"What the {model} is sent now is stored, too: {left_open}")


def download(
    model: ModelName,
    port: PortName,
    file: Path | None = None,
    *,
    output: Path | None = None,
    overwrite: Overwrite = False,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Read the program of a unit, as source with labels.

    For example: `detent download gs-c200 /dev/ttyUSB0 drill.gsc`

    Parameters
    ----------
    file
        A file to write instead of the terminal, whole or not at all.
    output
        The same, for who is used to options.
    overwrite
        Write over a file that is there.
    json
        Print source and lines as one line of JSON.
    """
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected
    from detent.outputs.files import InTheWay, check_outputs, write_whole
    from detent.workbench.units.programs import source_of

    if file is not None and output is not None:
        asked_wrongly(f"two files: {file} and --output {output}; say one")
    file = output if file is None else file
    language = _language(model)
    try:
        check_outputs([file], asked=overwrite)
    except InTheWay as error:
        asked_wrongly(error)
    with progress(f"reading the {model}") as watch, connected(model, port, unit, watch) as found:
        lines = _programmed(found).read_program()
        left = getattr(found.driver, "left_over", "")
    if left:
        what = f"left over from an older program at {left}, behind an end mark, where no jump leads: not in this source"
        print(f"detent: {what}; Q {re.split('[-,]', left)[0]} lists it", file=sys.stderr)
    source = source_of(language, lines)
    if file is not None:
        try:
            write_whole(file, source.encode())
        except OSError as error:
            failed(f"{file}: not written: {error.strerror or error}")
    if json:
        facts = {"model": model, "port": port, "file": str(file) if file else None, "lines": lines, "source": source}
        facts |= {"left_over": left} if left else {}
        print(json_text.dumps(facts))
    elif file is not None:
        print(f"Wrote {file}: {source.count(chr(10))} lines")
    else:
        print(source, end="")


def compare(
    model: ModelName,
    port: PortName,
    file: Path,
    *,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Compare the program of a unit with a source file.

    Ends with 1 if they differ. Both are compared as instructions at addresses: labels, comments and spelling do not
    matter. Where programs have places of their own, as on a DCB-274, those of the file are looked at.

    For example: `detent compare gs-c200 /dev/ttyUSB0 drill.gsc`

    Parameters
    ----------
    file
        The source.
    json
        Print the result as one line of JSON.
    """
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected
    from detent.workbench.units.programs import numbered_lines_of, places_of

    assembly = _assembled(model, file)
    with progress(f"reading the {model}") as watch, connected(model, port, unit, watch) as found:
        there = found.perform(places_of(found.driver, assembly))
    wanted = numbered_lines_of(assembly)
    differences = list(unified_diff(there, wanted, "the unit", str(file), lineterm="", n=2))
    if json:
        print(json_text.dumps({"model": model, "port": port, "file": str(file), "differences": differences}))
    elif differences:
        print("\n".join(differences))
    else:
        print(f"The unit holds {file}: {len(wanted)} instructions")
    if differences:
        raise SystemExit(FAILED)


def _language(model: str) -> Language[Any]:
    from detent.cli.endings import asked_wrongly
    from detent.controllers.catalogue import CatalogueError, language

    try:
        return language(model)
    except CatalogueError as error:
        asked_wrongly(error)


def _assembled(model: str, file: Path) -> Assembly[Any]:
    """The assembled source; every error of it is reported before the program ends."""
    from detent.cli.endings import asked_wrongly
    from detent.realtime.texts import read_text

    language = _language(model)
    try:
        source = read_text(file)
    except OSError as error:
        asked_wrongly(f"{file}: {error.strerror or error}")
    try:
        return assemble(language, source, str(file))
    except AssemblyFailed as error:
        print(error, file=sys.stderr)  # FILE:LINE:COLUMN, as compilers tell it and editors find it
        raise SystemExit(ASKED_WRONGLY) from error


def _programmed(unit: "Blocking") -> Programmed:
    return cast("Programmed", unit)
