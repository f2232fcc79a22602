"""The verb `find`: which controllers are at which ports, found by questions that harm none of them."""

import json as json_text
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from detent.cli.codes import FAILED
from detent.cli.endings import asked_wrongly, failed, tell
from detent.cli.unit import flag

if TYPE_CHECKING:
    from detent.hosts.finding import Found, Pass
    from detent.realtime.addresses import Address


def find(
    *ports: str,
    model: Sequence[str] = (),
    baud: Sequence[int] = (),
    json: bool = False,
) -> None:
    """Look for controllers, at the serial ports of this computer or at those named.

    Every protocol and every rate that a controller can be set to is tried, with questions that move, write and reset
    nothing: SPACE, then F, then the names of a party line. A port where another device listens gets these characters
    as well: name the ports if that may matter. A controller that runs a program may not answer.

    Ends with 1 if nothing was found.

    For example: `detent find /dev/ttyUSB0 --model gs-c200`

    Parameters
    ----------
    ports
        Serial devices or links to one, HOST:PORT, rfc2217://HOST:PORT.
    model
        Look for this family alone: gs-c200, dcb-274, bs0610, or supersigma, which is looked for on request only. May
        be given several times.
    baud
        Try this rate alone. May be given several times.
    json
        Print what was looked at and what was found as one line of JSON.
    """
    from detent.hosts.finding import USUAL
    from detent.realtime.addresses import Address, PortError
    from detent.realtime.finding import listed, passes_for

    try:
        wanted = [(port, "") for port in ports] or [(port.device, port.what) for port in listed()]
    except PortError as error:
        failed(error)
    try:
        families = _families(model) or USUAL
        searches = [
            Search(port, what, Address.parse(port), passes_for(Address.parse(port), families, baud or None))
            for port, what in wanted
        ]
    except ValueError as error:
        asked_wrongly(error)
    if not searches:
        failed("this computer has no serial ports; name one: detent find /dev/ttyUSB0")
    results, failures = _look(searches)
    found = [(search, unit) for search, units in results for unit in units]
    if json:
        looked = [{"port": one.port, "device": one.what, "error": failures.get(one.port)} for one in searches]
        facts = [_facts(search, unit) for search, unit in found]
        print(json_text.dumps({"looked_at": looked, "looked_for": families, "found": facts}))
    else:
        _print(found)
        silent = ", ".join(search.port for search, units in results if not units)
        if silent:
            print(f"Nothing was found at {silent}, looked at for {', '.join(families)}.")
            print("Is it switched on, are TXD and RXD crossed, does it run a program?")
    if not found:
        raise SystemExit(FAILED)


class Search(NamedTuple):
    """A port that is looked at: as it was named, what is known of it, and what will be asked."""

    port: str
    what: str
    address: "Address"
    passes: "list[Pass]"

    @property
    def seconds(self) -> float:
        """How long it takes where nobody answers."""
        return sum(one.questions * one.seconds for one in self.passes)


def _families(models: Sequence[str]) -> tuple[str, ...]:
    """The families of some models. Raises ValueError, with the likeliest of the models there are."""
    from detent.hosts.finding import FORMATS
    from detent.realtime.connect import HOSTS, host

    return tuple(dict.fromkeys(next(family for family in FORMATS if HOSTS[family] is host(model)) for model in models))


def _look(searches: "list[Search]") -> "tuple[list[tuple[Search, list[Found]]], dict[str, str]]":
    """What is found, port after port, and what went wrong, by port: it is told, and the next is looked at."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from detent.hosts.errors import DriverError
    from detent.hosts.exchange import Progress as Step
    from detent.realtime.addresses import PortError
    from detent.realtime.finding import Talks
    from detent.realtime.finding import find as look

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    results = []
    failures: dict[str, str] = {}
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("looking", total=sum(search.seconds for search in searches))
        before = 0.0
        for search in searches:

            def watch(step: Step, search: Search = search, before: float = before) -> None:
                bar.update(task, completed=before + step.done / 1e3, description=f"{search.port}: {step.what}")

            try:
                results.append((search, look(search.address, search.passes, watch)))
            except PortError as error:
                failures[search.port] = str(error)
            except (DriverError, Talks) as error:
                failures[search.port] = f"{search.port}: {error}"
            if search.port in failures:
                tell(failures[search.port])
            before += search.seconds
    return results, failures


def _facts(search: Search, unit: "Found") -> dict[str, object]:
    return {
        "port": search.port,
        "device": search.what,
        "model": unit.model,
        "format": None if search.address.formless else str(unit.form),
        "options": unit.options,
        "says": unit.says,
        "terminal": _command(search, unit),
    }


def _command(search: Search, unit: "Found") -> str:
    """The line to go on with."""
    from detent.realtime.connect import HOSTS

    words = ["detent", "terminal", unit.model, shlex.quote(search.port)]
    if not search.address.formless and unit.form.baud != HOSTS[unit.model].form.baud:
        words.append(flag("baud", unit.form.baud))
    words += [flag(name, shlex.quote(str(value))) for name, value in unit.options.items()]
    return " ".join(words)


def _print(found: "list[tuple[Search, Found]]") -> None:
    """A row for each controller, and below it the line to go on with."""
    for search, unit in found:
        form = "" if search.address.formless else f", {unit.form}"
        which = "".join(f", {name} {value}" for name, value in unit.options.items() if name != "checksums")
        checksum = ", no checksums" if unit.options.get("checksums") is False else ""
        device = f" ({search.what})" if search.what else ""
        print(f"{search.port}{device}: {unit.model}{form}{which}{checksum}: {unit.says}")
        print(f"    {_command(search, unit)}")
