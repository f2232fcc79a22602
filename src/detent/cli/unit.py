"""The unit that a host-side verb talks to: its options on the command line, its connection, how far it is."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from cyclopts import Group, Parameter

if TYPE_CHECKING:
    from detent.hosts import exchange
    from detent.hosts.errors import DriverError
    from detent.hosts.exchange import Blocking, Watch


@Parameter(name="*", group=Group("Which unit, and its line", sort_key=2))
@dataclass(frozen=True)
class UnitOptions:
    """Which unit is meant, and its line. Everything has the default of the model.

    Parameters
    ----------
    address
        GS-C200: address of a module on a multipoint line, 1 to 7; without it a module alone.
    no_checksum
        GS-C200: without checksums, as where CHS is strapped low.
    revision
        GS-C200: revision of its firmware; 2.2 unless given. Up to 2.1 checksums are made in another way.
    name
        DCB-274: name of the axis on a party line, like A; or on another line, by --mode.
    mode
        DCB-274: single, party, daisy or sin10; party where --name is given, else single.
    first
        DCB-274: name of the first axis of a daisy chain.
    motor
        BS0610, BS0710: X or Y; X unless given.
    drive
        SUPERSIGMA: number of the drive, 0 to 255; 1 unless given.
    baud
        Rate of the line, bits/s; that of the model unless given: 9600, but for a SUPERSIGMA.
    data_bits
        Data bits of a character, 7 or 8; those of the model unless given.
    parity
        none, odd or even; that of the model unless given.
    stop_bits
        Stop bits of a character, 1 or 2; those of the model unless given.
    patience
        Seconds that the unit may take before it answers; 0.25 to 1 unless given, by the model.
    """

    address: int | None = None
    no_checksum: Annotated[bool, Parameter(negative=())] = False
    revision: str | None = None
    name: str | None = None
    mode: str | None = None
    first: str | None = None
    motor: str | None = None
    drive: int | None = None
    baud: int | None = None
    data_bits: int | None = None
    parity: str | None = None
    stop_bits: int | None = None
    patience: float | None = None

    def given(self, model: str) -> dict[str, Any]:
        """What `detent.connect` is told for `model`. Raises ValueError for an option that is not for it."""
        from detent.realtime.connect import host
        from detent.uart import Format

        found = host(model)
        chosen = {field.name: value for field in fields(self) if (value := getattr(self, field.name)) is not None}
        if chosen.pop("no_checksum"):
            chosen["checksums"] = False
        for option in chosen:
            if option not in found.options and option not in Format._fields:
                flags = ", ".join(flag(one) for one in found.options)
                raise ValueError(f"{flag(option)} is not for a {model}; it takes {flags}")
        if "name" in chosen and "mode" not in chosen:
            chosen["mode"] = "party"  # in single mode an axis needs no name
        return chosen

    def written(self) -> str:
        """The options that differ from the model's, as they are typed behind a command."""
        chosen = {field.name: value for field in fields(self) if (value := getattr(self, field.name)) is not None}
        given = [
            f"--{name.replace('_', '-')}" + ("" if value is True else f" {shlex.quote(str(value))}")
            for name, value in chosen.items()
            if value is not False
        ]
        return "".join(f" {option}" for option in given)


NO_UNIT_OPTIONS = UnitOptions()

# what every verb that talks to a unit takes
ModelName: TypeAlias = Annotated[str, Parameter(help="The controller: gs-c200, dcb-274, ...")]
PortName: TypeAlias = Annotated[
    str, Parameter(help="A serial device or a link to one, HOST:PORT, or rfc2217://HOST:PORT.")
]


def flag(option: str, value: object = None) -> str:
    """An option of a driver as it is written on the command line, with its value if one is given."""
    if option == "checksums":
        return "--no-checksum"
    written = f"--{option.replace('_', '-')}"
    return written if value is None else f"{written} {value}"


@contextmanager
def unit(model: str, port: str, options: UnitOptions, watch: "Watch | None" = None) -> "Iterator[Blocking]":
    """The driver of the unit. What goes wrong ends the program: 2 for what was asked wrongly, 1 for what failed."""
    from detent.cli.endings import asked_wrongly, failed
    from detent.hosts.errors import DriverError
    from detent.realtime.addresses import PortError
    from detent.realtime.connect import connect

    try:
        connected: Blocking = connect(model, port, watch=watch, **options.given(model))
    except PortError as error:
        failed(error)
    except ValueError as error:
        asked_wrongly(error)
    with connected:
        try:
            yield connected
        except DriverError as error:
            failed(error.told + _another(error, port))
        except ValueError as error:
            asked_wrongly(error)


def _another(error: "DriverError", port: str) -> str:
    """What may be there in the unit's place, where nothing that it says was heard."""
    from detent.hosts.errors import BadAnswer, NoAnswer

    if not isinstance(error, BadAnswer | NoAnswer) or "--no-checksum" in error.what:
        return ""
    if error.spoken is not None and error.spoken.echoed:
        return "" if error.unit.startswith("DCB-274") else f"; a DCB-274 echoes, too: detent find {port}"
    came = b"" if error.spoken is None else error.spoken.received
    likely = ""
    if came.rstrip().endswith(b"*") or b"GenStepper" in came:
        likely = " (what came reads like a GenStepper board, bs0610)"
    elif b"AMS" in came or b"SMC-27" in came or came.endswith((b"#\r\n", b"#\n")):
        likely = " (what came reads like a DCB-274)"
    return f"; is another controller there, or another rate{likely}? See: detent find {port}"


@contextmanager
def progress(what: str) -> "Iterator[Watch]":
    """Shows how far a long operation is, with the time it will still take; on a terminal only, and gone afterwards."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        totals = [0]

        def watch(step: "exchange.Progress") -> None:
            if step.total != totals[0]:  # another part of the operation
                bar.reset(task, total=step.total)
                totals[0] = step.total
            bar.update(task, completed=step.done, description=f"{what}: {step.what}" if step.what else what)

        yield watch
