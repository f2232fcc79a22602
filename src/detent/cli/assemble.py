"""The verbs around program source: `asm`, `list`, `disasm`."""

import json as json_text
import sys
from collections.abc import Iterable
from errno import EILSEQ
from pathlib import Path
from typing import Any, Literal

from detent.assembler import (
    Assembly,
    AssemblyFailed,
    ImageError,
    Language,
    assemble,
    disassemble,
    listing,
)
from detent.cli.endings import tell
from detent.cli.overwrite import Overwrite
from detent.outputs.files import InTheWay, check_outputs, write_whole

FAILED = 1
ASKED_WRONGLY = 2


def asm(
    model: str,
    file: Path,
    *,
    output: Path | None = None,
    format: Literal["image", "hex", "commands"] | None = None,
    overwrite: Overwrite = False,
    json: bool = False,
) -> None:
    """Assemble a program: labels and comments in, commands or an image out.

    The source has one command a line as typed on the wire, `label:` where a jump leads, and `;` before
    a comment. The commands are printed with their addresses filled in, and how much memory they take; where the
    controller's programs have places, with the lines that say where each part stands. An image begins at the first
    address of the program memory.

    For example: `detent asm gs-c200 drill.gsc --output drill.img`

    Parameters
    ----------
    model
        The controller: gs-c200, gs-c200s, ...
    file
        The source.
    output
        A file to write, whole or not at all.
    format
        What to write: the image as bytes (the default for a file), the image in hex, or the commands (the
        default for the terminal).
    overwrite
        Write over a file that is there.
    json
        Print everything as JSON: commands, addresses, labels, image, bytes used.
    """
    if format == "image" and output is None:
        raise _asked_wrongly("an image is bytes and needs a file: add --output FILE, or choose --format hex")
    _check_output(output, file, overwrite)
    assembly = _assembly(model, file, json)
    if output is not None:
        _write(output, _formatted(assembly, format or "image"))
    if json:
        _print_json({**_facts(assembly), "output": str(output) if output else None})
    else:
        shown = "hex" if format == "hex" and output is None else "commands"
        print(_formatted(assembly, shown).decode(), end="")
        # a comment, so that what is printed can be kept as a program file
        print(f"{assembly.language.comment} {assembly.used} of {assembly.capacity} bytes")


def list_(model: str, file: Path, *, json: bool = False) -> None:
    """List a program source with the address and bytes of every instruction.

    For example: `detent list gs-c200 drill.gsc`

    Parameters
    ----------
    model
        The controller: gs-c200, gs-c200s, ...
    file
        The source.
    json
        Print the listing as JSON.
    """
    assembly = _assembly(model, file, json)
    if json:
        _print_json(_facts(assembly))
    else:
        print(listing(assembly), end="")


def disasm(
    model: str, file: Path, *, output: Path | None = None, overwrite: Overwrite = False, json: bool = False
) -> None:
    """Turn a program image back into source, with labels for its jumps.

    The EEPROM file of a unit that `serve` keeps is taken as well.

    For example: `detent disasm gs-c200 drill.img --output drill.gsc`

    Parameters
    ----------
    model
        The controller: gs-c200, gs-c200s, ...
    file
        The image that `asm` wrote, or an EEPROM file.
    output
        A file to write instead of the terminal, whole or not at all.
    overwrite
        Write over a file that is there.
    json
        Print the source and its facts as JSON.
    """
    from detent.realtime.images import ImageUnreadable, image_in

    language = _language(model)
    _check_output(output, file, overwrite)
    try:
        image = image_in(_read(file), model)
        source = disassemble(language, image)
    except ImageUnreadable as error:
        raise _asked_wrongly(f"{file}: {error}") from error
    except ImageError as error:
        raise _asked_wrongly(f"{file}: {error}; is it an image for the {model}?") from error
    if output is not None:
        _write(output, source.encode())
    if json:
        written = str(output) if output else None
        facts = {"model": model, "file": str(file), "bytes_used": len(image), "source": source}
        _print_json({**facts, "output": written})
    elif output is None:
        print(source, end="")


def _language(model: str) -> Language[Any]:
    """The program language of `model`."""
    # imported here, as it brings all controllers with it and --help needs none
    from detent.controllers.catalogue import CatalogueError, language

    try:
        return language(model)
    except CatalogueError as error:
        raise _asked_wrongly(str(error)) from error


def _assembly(model: str, file: Path, json: bool) -> Assembly[Any]:
    """The assembled source; every error of it is reported before the program ends."""
    language = _language(model)
    from detent.realtime.texts import read_text

    try:
        source = read_text(file)
    except OSError as error:
        hint = ", or use disasm if it is an image" if error.errno == EILSEQ else ""
        raise _asked_wrongly(f"{file}: {error.strerror or error}{hint}") from error
    try:
        return assemble(language, source, str(file))
    except AssemblyFailed as failed:
        if json:
            errors = [{"file": failed.name, **error._asdict()} for error in failed.errors]
            _print_json({"model": model, "errors": errors})
        print(failed, file=sys.stderr)  # FILE:LINE:COLUMN, as compilers tell it and editors find it
        raise SystemExit(ASKED_WRONGLY) from failed


def _formatted(assembly: Assembly[Any], format: str) -> bytes:
    """What a file in `format` holds."""
    match format:
        case "image":
            return assembly.whole
        case "hex":
            image = assembly.whole
            return _lines(image[at : at + 16].hex(" ").upper() for at in range(0, len(image), 16))
        case _:
            return _lines(assembly.typed)


def _lines(texts: Iterable[str]) -> bytes:
    return "".join(f"{text}\n" for text in texts).encode()


def _facts(assembly: Assembly[Any]) -> dict[str, Any]:
    """What `--json` tells of a program."""
    return {
        "model": assembly.language.model,
        "file": assembly.name,
        "bytes_used": assembly.used,
        "capacity": assembly.capacity,
        "labels": dict(assembly.symbols),
        "image": assembly.whole.hex(),
        "instructions": [
            {
                "address": placed.address,
                "bytes": placed.code.hex(),
                "command": placed.text,
                "line": placed.line,
                "source": assembly.lines[placed.line - 1],
            }
            for placed in assembly.placed
        ],
    }


def _print_json(facts: dict[str, Any]) -> None:
    print(json_text.dumps(facts))


def _read(file: Path) -> bytes:
    from detent.realtime.texts import read_whole

    try:
        return read_whole(file)
    except OSError as error:
        raise _asked_wrongly(f"{file}: {error.strerror or error}") from error


def _check_output(output: Path | None, file: Path, overwrite: bool) -> None:
    try:
        check_outputs([output], [file], asked=overwrite)
    except InTheWay as error:
        raise _asked_wrongly(str(error)) from error


def _write(file: Path, data: bytes) -> None:
    try:
        write_whole(file, data)
    except OSError as error:
        tell(f"{file}: not written: {error.strerror or error}")
        raise SystemExit(FAILED) from error


def _asked_wrongly(message: str) -> SystemExit:
    """The way out after a request that cannot be met; `message` has gone to stderr."""
    tell(message)
    return SystemExit(ASKED_WRONGLY)
