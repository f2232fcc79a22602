"""The verb `workbench`: a cell in a browser, in real time, until Ctrl-C."""

import asyncio
import json as json_text
import os
import sys
import webbrowser
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from secrets import token_urlsafe
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from detent.cli.unit import NO_UNIT_OPTIONS, UnitOptions

if TYPE_CHECKING:
    from detent.workbench.client import Bench

FIRST = Path("drilling", "bar-after-bar.toml")
LEAST_MEMORY, MOST_MEMORY = 256, 1_000_000  # MB that the past may take


def workbench(
    target: Annotated[str | None, Parameter(show_default=False)] = None,
    at: Annotated[str | None, Parameter(show_default=False)] = None,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    token: str | None = None,
    open_: Annotated[bool, Parameter(name="--open")] = False,
    folder: Path | None = None,
    pty: Annotated[list[Path] | None, Parameter(consume_multiple=(0, 1), negative=())] = None,
    tcp: str | None = None,
    rfc2217: str | None = None,
    serial: Path | None = None,
    pace: float = 1.0,
    hold: bool = False,
    line_timing: Annotated[bool, Parameter(negative="--no-line-timing")] = True,
    strap: Annotated[Sequence[str], Parameter(negative=())] = (),
    set_: Annotated[Sequence[str], Parameter(name="--set", negative=())] = (),
    memory: int = 512,
    state: Path | None = None,
    control: str | None = None,
    real: Annotated[bool, Parameter(negative=())] = False,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Show a controller or a cell in a browser, running in real time.

    Without a target it is the drilling cell of the GS-C200 datasheet. With a model and a port it is the unit there, and
    beside it the same model, emulated. The address to open is printed; Ctrl-C ends it.

    For example: `detent workbench gs-c200 --open`

    Or: `detent workbench dcb-274 /dev/ttyUSB0`

    Parameters
    ----------
    target
        A model by name, or a cell file (CELL.toml).
    at
        Where a real unit of that model is: a serial device, HOST:PORT, or rfc2217://HOST:PORT.
    host
        Listen on this address. Any but loopback needs --token.
    port
        Listen on this port; 0: any free one. Without it 8274, so that a browser knows the workbench again; if that is
        taken, the next that is free, and it says so.
    token
        Let in only who knows this word of at least 8 characters; on loopback a random one unless you give one. The
        address that is printed has it, and programs at --control must know it, too.
    open_
        Open the address in the browser of this machine.
    folder
        The only folder whose files can be opened and saved: that of the cell file, or the current one.
    pty
        Open a pseudo-terminal; with a value, make this symbolic link to it (of several lines: LINK-LINE).
    tcp
        Listen on HOST:PORT for one host program at a time. Port 0: any free port; several lines count up from PORT.
    rfc2217
        The same as a serial port over TCP: a client sets baud rate and format, and hears garbage if they do not fit.
    serial
        Be the controller at this serial device. The line timing is then left to the wire.
    pace
        Run so many times as fast as real time.
    hold
        Let the cell stand at first.
    line_timing
        Let characters take their time on the serial line.
    strap
        PIN=LEVEL (low, high, open), or UNIT.PIN=LEVEL for a cell.
    set_
        OPTION=VALUE, or UNIT.OPTION=VALUE for a cell.
    memory
        How many MB, about, the past may take; what is older is dropped, and the time line then begins later.
    state
        Keep EEPROM images and drafts in this folder instead of $XDG_STATE_HOME/detent or ~/.local/state/detent.
    control
        Listen on HOST:PORT for programs that look at the same cell and meddle with it, see `detent control`. Port 0:
        any free port. Any host but loopback needs --token or $DETENT_TOKEN.
    real
        Drive the pins of the boards in the cell file. Time then goes on, and one can only look back.
    json
        Print one line of JSON once everything is ready, and nothing else.
    unit
        Which real unit is meant, and its line.
    """
    from detent.cell.description import Problem
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.serve import asked_address, asked_endpoints
    from detent.extras import MissingExtra, need
    from detent.realtime.cell_source import find_cell
    from detent.realtime.examples import home
    from detent.realtime.images import ImagesUnusable, cell_name, default_folder
    from detent.realtime.pace import check_pace

    links = list(pty) if pty is not None else None
    if target is None and links:  # `workbench --pty gs-c200`: what follows --pty was meant to be shown
        target, links = str(links[0]), []
    own = Path(target).parent if target is not None and _is_file(target) else Path()
    shown = target if target is not None else str(home() / FIRST)
    kept = state if state is not None else default_folder()
    try:
        need("workbench", "the workbench needs")
        try:
            check_pace(pace)
        except ValueError as error:
            raise Problem("", "--pace", str(error)) from None
        if real and (pace != 1 or hold):
            raise Problem("", "--real", "real pins keep real time: leave out --pace and --hold")
        if not LEAST_MEMORY <= memory <= MOST_MEMORY:
            what = f"{memory} MB are too {'few' if memory < LEAST_MEMORY else 'many'}"
            raise Problem("", "--memory", f"{what}; it takes {LEAST_MEMORY} to {MOST_MEMORY}")
        endpoints = asked_endpoints(links, tcp, rfc2217, serial)
        control_at = None if control is None else asked_address("--control", control)
        find_cell(shown, straps=strap, options=set_)  # at once, not when everything is loaded
        written = _unit_options(target, at, unit)
    except (Problem, MissingExtra) as error:
        asked_wrongly(error)
    from detent.realtime.http import TOKEN
    from detent.workbench.client import Bench, BenchError
    from detent.workbench.drafts import Drafts
    from detent.workbench.folder import Folder, OutsideFolder
    from detent.workbench.guard import check_place, is_loopback
    from detent.workbench.listening import USUAL, Place, listen, listen_as_usual

    known = token or os.environ.get(TOKEN)  # to programs; that of chance is for windows
    try:
        if token is None and is_loopback(host):
            token = token_urlsafe(16)  # other users of this computer reach loopback, too
        check_place(host, token)
        chosen = Folder(folder if folder is not None else own)
        listening = listen(Place(host, port, token)) if port is not None else listen_as_usual(host, token)
    except (OutsideFolder, ValueError) as error:
        asked_wrongly(error)
    except OSError as error:
        asked_wrongly(
            Problem(
                "",
                "--host and --port",
                f"cannot listen on {host}:{USUAL if port is None else port}: {error.strerror or error}",
            )
        )
    if port is None and listening.port != USUAL:
        told = f"port {USUAL} is taken, by another workbench perhaps: this one is at {listening.port}"
        print(
            f"detent: {told}. A browser keeps theme, drafts of lines and the like for each port apart.", file=sys.stderr
        )
    url = listening.url(token)

    async def show() -> None:
        opening = asyncio.create_task(
            Bench.open(
                shown, straps=strap, options=set_, endpoints=endpoints, pace=pace, line_timing=line_timing,
                state_dir=kept, held=hold, real=real, memory=memory, control=control_at, token=known,
            )
        )  # fmt: skip
        server = await asyncio.to_thread(import_module, "detent.workbench.server")  # seconds, while the cell starts
        bench = await opening
        try:
            drafts = Drafts(kept, cell_name(shown, is_file=_is_file(shown)))
            place = Place(host, listening.port, token)
            site, units = server.application(bench, chosen, drafts, place, kept)
            if target is not None and at is not None:
                try:
                    await units.unit_connect(target, at, written)
                except ValueError as error:
                    raise Problem("", "", str(error)) from None

            first = listening.url(token, "" if at is None else "unit")  # who connects a unit wants to see it

            def ready() -> None:
                if json:
                    print(json_text.dumps(_facts(bench, url)), flush=True)
                else:
                    _print_ready(bench, first, chosen.root, kept)
                if open_:
                    webbrowser.open(first)

            try:
                await server.serve(site, listening, ready)
            finally:
                await units.close()
        finally:
            await bench.close()

    try:
        asyncio.run(show())
    except (Problem, ImagesUnusable) as error:
        asked_wrongly(error)
    except (BenchError, OSError) as error:  # a PortError is an OSError
        failed(error)
    finally:
        listening.socket.close()


def _unit_options(target: str | None, at: str | None, unit: UnitOptions) -> str:
    """The options of a real unit as the page Unit writes them. Raises Problem."""
    from detent.cell.description import Problem
    from detent.realtime.addresses import Address

    if at is None:
        if unit != NO_UNIT_OPTIONS:
            raise Problem("", "", "options of a real unit go with its port: detent workbench MODEL PORT")
        return ""
    try:
        Address.parse(at)
        given = unit.given(target or "")
    except ValueError as error:
        raise Problem("", "", str(error)) from None
    words = {name: ("yes" if value else "no") if isinstance(value, bool) else value for name, value in given.items()}
    return " ".join(f"{name}={value}" for name, value in words.items())


def _is_file(target: str) -> bool:
    """Whether a target is a cell file, as `realtime.cell_source` tells it from a model."""
    return target.endswith(".toml") or "/" in target


def _facts(bench: "Bench", url: str) -> dict[str, object]:
    """What `--json` tells."""
    endpoints = [
        {"unit": line.units[0] if len(line.units) == 1 else line.name, "kind": one.kind, "address": one.address}
        for line in bench.picture.lines.values()
        for one in line.endpoints
    ]
    return {"url": url, "endpoints": endpoints, "control": bench.control_url}


def _print_ready(bench: "Bench", url: str, folder: Path, kept: Path) -> None:
    """Say what to open, and what hosts connect to."""
    picture = bench.picture
    for report in picture.reports:
        print(f"detent: {report}", file=sys.stderr)
    print(f"{picture.title or picture.target}: {', '.join(picture.units)}")
    print(f"Open in a browser:  {url}")
    ends = [(line, one) for line in picture.lines.values() for one in line.endpoints]
    if ends:
        print("Hosts connect to:")
    width = max((len(line.name) for line, _ in ends), default=0)
    for line, one in ends:
        print(f"  {line.name:{width}}  {one.address}  # {one.kind}, {line.format}")
    if bench.control_url is not None:
        print(f"Look at it, meddle with it, break it:\n  detent control {bench.control_url}")
    print(f"Files are opened and saved in {folder}; EEPROM images and drafts are kept in {kept}")
    print("Ctrl-C ends it.", flush=True)
