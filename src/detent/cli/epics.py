"""The verb `epics`: axes as EPICS motor records, emulated in this process or at a port."""

import asyncio
import json as json_text
import os
import re
import sys
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager
from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import Parameter

from detent.cli.unit import NO_UNIT_OPTIONS, UnitOptions

if TYPE_CHECKING:
    from detent.bridges.epics.fields import Settings
    from detent.bridges.epics.ioc import ServedMotor
    from detent.realtime.cell_source import CellSource

_SETTINGS = {
    "resolution": "resolution", "egu": "egu", "low": "low", "high": "high", "velocity": "velocity", "base": "base",
    "max-velocity": "most", "acceleration": "acceleration",
}  # fmt: skip
"""The options that say how a record begins, and what `Settings` calls them."""

USUAL_PORT = 5064  # of Channel Access
PREFIX = r"[A-Za-z0-9_:+\[\]<>;-]{0,50}"  # of a record's name, which has 60 characters at most

Each = Annotated[Sequence[str], Parameter(negative=())]


class RecordSetup(NamedTuple):
    """An axis to be served: what it is called, the driver's model and options, where, how its record begins."""

    record: str
    title: str
    model: str
    options: Mapping[str, object]
    port: str
    settings: "Settings"


def epics(
    target: Annotated[str | None, Parameter(show_default=False)] = None,
    port: str | None = None,
    *,
    prefix: str = "SIM:",
    resolution: Each = (),
    egu: Each = (),
    low: Annotated[Each, Parameter(allow_leading_hyphen=True)] = (),
    high: Annotated[Each, Parameter(allow_leading_hyphen=True)] = (),
    velocity: Each = (),
    base: Each = (),
    max_velocity: Each = (),
    acceleration: Each = (),
    interfaces: Annotated[Sequence[str], Parameter(negative=())] = (),
    ca_port: int | None = None,
    list_pvs: Annotated[bool, Parameter(negative=())] = False,
    pace: float = 1.0,
    line_timing: Annotated[bool, Parameter(negative="--no-line-timing")] = True,
    strap: Annotated[Sequence[str], Parameter(negative=())] = (),
    set_: Annotated[Sequence[str], Parameter(name="--set", negative=())] = (),
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Serve axes as EPICS motor records by Channel Access, until Ctrl-C.

    The records are called PREFIX and m1, m2, ... Without PORT the units are emulated here. Settings are in engineering
    units; RECORD=VALUE (m2=0.01) sets one record, VALUE alone all of them. Needs caproto.

    For example: `detent epics gs-c200s --resolution 0.0025 --egu mm --low -10 --high 40 --velocity 5`

    Parameters
    ----------
    target
        A model by name, or a cell file (CELL.toml): all axes that a host could drive.
    port
        Where the real unit is: a serial device or a link to one, HOST:PORT, or rfc2217://HOST:PORT.
    prefix
        What the names of all records begin with.
    resolution
        MRES: engineering units in one step of the controller; negative if it counts the other way.
    egu
        EGU: the engineering unit, like mm.
    low
        DLLM: the low dial limit. Both limits at 0 are none.
    high
        DHLM: the high dial limit.
    velocity
        VELO: units/s of a move; 500 steps/s unless you say.
    base
        VBAS: units/s at which a move begins; a fifth of the velocity unless you say.
    max_velocity
        VMAX: the largest velocity that a client may set; the unit's own unless you say.
    acceleration
        ACCL: seconds from the base velocity to the velocity.
    interfaces
        Addresses to listen on instead of all, or of $EPICS_CAS_INTF_ADDR_LIST. Channel Access asks for no password.
    ca_port
        Port of Channel Access; $EPICS_CA_SERVER_PORT or 5064 without it.
    list_pvs
        Print the name of every field that means something, and end.
    pace
        Emulated: run so many times as fast as real time.
    line_timing
        Emulated: let characters take their time on the serial line.
    strap
        Emulated: PIN=LEVEL, or UNIT.PIN=LEVEL for a cell.
    set_
        Emulated: OPTION=VALUE, or UNIT.OPTION=VALUE for a cell.
    json
        Print one line of JSON once clients can connect, and nothing else.
    unit
        Real: which unit is meant, and its line.
    """
    from detent.cell.description import Problem
    from detent.cli.endings import asked_wrongly
    from detent.extras import MissingExtra, need

    given = {"resolution": resolution, "egu": egu, "low": low, "high": high, "velocity": velocity, "base": base,
             "max-velocity": max_velocity, "acceleration": acceleration}  # fmt: skip
    try:
        if target is None:
            raise Problem("", "", "say what to serve: a model like gs-c200 (detent models), or a CELL.toml")
        if not re.fullmatch(PREFIX, prefix):
            what = "a record's name has letters, digits and _ - + : [ ] < > ;, and 60 of them at most"
            raise Problem("", "--prefix", f"{prefix!r}: {what}")
        if ca_port is not None:
            if not 0 < ca_port < 65536:
                raise Problem("", "--ca-port", f"{ca_port} is no port; it takes 1 to 65535")
            os.environ["EPICS_CA_SERVER_PORT"] = str(ca_port)
        search = _search_port()
        if not list_pvs:
            need("epics", "EPICS records need")
        with _axes(target, port, unit, given, pace=pace, line_timing=line_timing, strap=strap, options=set_) as axes:
            if list_pvs:
                _print_names(prefix, axes, json=json)
                return
            known = bool(interfaces or os.environ.get("EPICS_CAS_INTF_ADDR_LIST"))
            ready = _ready(prefix, axes, search, json=json, everywhere=not known)
            asyncio.run(_serve(prefix, axes, interfaces, ready, quiet=json))
    except (Problem, MissingExtra, ValueError) as error:
        asked_wrongly(error)


@contextmanager
def _axes(
    target: str,
    port: str | None,
    unit: UnitOptions,
    given: Mapping[str, Sequence[str]],
    *,
    pace: float,
    line_timing: bool,
    strap: Sequence[str],
    options: Sequence[str],
) -> Iterator[list[RecordSetup]]:
    """The axes that are asked for. Emulated ones live while this lasts. Raises Problem, ValueError."""
    from detent.cell.description import Problem
    from detent.hosts.genstepper.dialogue import MOTORS
    from detent.realtime.cell_source import find_cell
    from detent.realtime.connect import host

    if port is None:
        found = find_cell(target, straps=strap, options=options)
        with _emulated(found, pace, line_timing) as parts:
            yield _named(parts, given)
        return
    if strap or options or pace != 1 or not line_timing:
        raise Problem("", "", "--strap, --set, --pace and --no-line-timing are for emulated units: leave PORT out")
    if target.endswith(".toml"):
        raise Problem(target, "", "a cell is emulated: leave PORT out, or name the model of the unit at PORT")
    told = unit.given(target)
    both = "motor" in host(target).options and "motor" not in told
    kinds = [{**told, "motor": motor} for motor in MOTORS] if both else [told]
    titles = [f"{target} {kind['motor']}" if "motor" in kind else target for kind in kinds]
    yield _named([(title, target, kind, port) for title, kind in zip(titles, kinds, strict=True)], given)


@contextmanager
def _emulated(
    found: "CellSource", pace: float, line_timing: bool
) -> Iterator[Sequence[tuple[str, str, Mapping[str, object], str]]]:
    """Serve the cell in a thread of this process: its axes, each with the port of its line."""
    from detent.bridges.epics.cells import axes
    from detent.realtime.endpoints.spec import EndpointSpec
    from detent.realtime.service import Service

    endpoints = [EndpointSpec("tcp", "127.0.0.1:0")]
    with Service(found.description, found.read, endpoints, pace=pace, line_timing=line_timing) as service:
        where = {line: address for line, _, address in service.addresses()}
        parts = [
            (axis.title, axis.model, {**axis.options, **axis.form._asdict()}, where[axis.line])
            for axis in axes(found.description, service.cell)
        ]
        with service.in_thread():
            yield parts


def _named(
    parts: Sequence[tuple[str, str, Mapping[str, object], str]], given: Mapping[str, Sequence[str]]
) -> list[RecordSetup]:
    """The axes with the names and settings of their records. Raises Problem."""
    from detent.bridges.epics.fields import Settings
    from detent.cell.description import Problem
    from detent.controllers.catalogue import unknown

    names = [f"m{number}" for number in range(1, len(parts) + 1)]
    chosen: dict[str, dict[str, str]] = {name: {} for name in names}
    for option, items in given.items():
        for item in items:
            record, equals, value = item.rpartition("=")
            if equals and record not in names:
                raise Problem("", f"--{option}", str(unknown("record", record, names)))
            for name in [record] if equals else names:
                chosen[name][option] = value
    made = []
    for name, (title, model, options, port) in zip(names, parts, strict=True):
        settings: dict[str, float | str] = {"description": title}
        for option, text in chosen[name].items():
            try:
                settings[_SETTINGS[option]] = text if option == "egu" else float(text)
            except ValueError:
                raise Problem("", f"--{option}", f"{text!r} is no number") from None
        step = abs(float(settings.get("resolution", 1.0)))
        settings.setdefault("velocity", 500 * step)
        settings.setdefault("base", float(settings["velocity"]) / 5)
        if "resolution" in settings:
            settings.setdefault("egu", "")
        try:
            made.append(RecordSetup(name, title, model, options, port, Settings(**settings)))  # type: ignore[arg-type]
        except ValueError as error:
            raise Problem("", name, str(error)) from None
    return made


async def _serve(
    prefix: str, axes: Sequence[RecordSetup], interfaces: Sequence[str], ready: Callable[[int], None], *, quiet: bool
) -> None:
    """Serve until a signal comes. Ends the program with 1 where a unit does not answer."""
    from detent.bridges.epics.ioc import serve
    from detent.cli.endings import failed
    from detent.hosts.errors import DriverError
    from detent.realtime.addresses import PortError
    from detent.realtime.system import ended_by_signals

    def report(text: str) -> None:
        if not quiet:
            print(f"detent: {text}", file=sys.stderr, flush=True)

    loop, serving = asyncio.get_running_loop(), asyncio.current_task()
    assert serving is not None
    try:
        with ended_by_signals(loop, serving.cancel):
            async with _motors(prefix, axes, report) as motors:
                await serve(motors, interfaces, ready, report)
    except (DriverError, PortError) as error:
        failed(error)
    except OSError as error:
        failed(f"Channel Access cannot be served: {error.strerror or error}; choose another --ca-port or --interfaces")
    except asyncio.CancelledError:
        pass


@asynccontextmanager
async def _motors(
    prefix: str, axes: Sequence[RecordSetup], report: Callable[[str], None]
) -> "AsyncIterator[list[ServedMotor]]":
    """The records, connected to their units. Raises DriverError, PortError, Problem."""
    from detent.bridges.epics.ioc import ServedMotor
    from detent.cell.description import Problem
    from detent.hosts.exchange import AsyncPort
    from detent.realtime.connect import connect_async

    ports: dict[str, AsyncPort] = {}
    motors = []
    try:
        for axis in axes:
            driver = await connect_async(axis.model, ports.get(axis.port, axis.port), **axis.options)
            ports[axis.port] = driver.port
            motor = ServedMotor(f"{prefix}{axis.record}", driver, axis.settings, report)
            try:
                await motor.begin()
            except ValueError as error:
                raise Problem(
                    "", axis.record, f"{error}; see --velocity, --base, --acceleration and --max-velocity"
                ) from None
            motors.append(motor)
        yield motors
    finally:
        for port in ports.values():
            await port.close()


def _print_names(prefix: str, axes: Sequence[RecordSetup], *, json: bool) -> None:
    """The names of all fields that mean something."""
    from detent.bridges.epics.fields import Settings

    names = [f"{prefix}{axis.record}.{field}" for axis in axes for field in Settings().fields()]
    print(json_text.dumps(names) if json else "\n".join(names))


def _somewhere(settings: "Settings") -> str:
    """A position to try, within the limits and some two seconds away, in digits that say it exactly."""
    low, high = settings.low, settings.high
    near = float(f"{2 * settings.velocity:.0e}")
    if not low and not high:
        return f"{near:g}"
    far = high if high > 0 else low
    for at in (near if far > 0 else -near, float(f"{far / 2:.0e}"), (low + high) / 2):
        if low <= float(f"{at:g}") <= high and at:
            return f"{at:g}"
    return repr(high)


def _search_port() -> int:
    """Where clients look for records. Raises Problem."""
    from detent.cell.description import Problem

    text = os.environ.get("EPICS_CA_SERVER_PORT", str(USUAL_PORT)).strip()
    if not re.fullmatch("[0-9]{1,5}", text) or not 0 < int(text) < 65536:
        raise Problem("", "$EPICS_CA_SERVER_PORT", f"{text[:40]!r} is no port; it takes 1 to 65535")
    return int(text)


def _ready(
    prefix: str, axes: Sequence[RecordSetup], search: int, *, json: bool, everywhere: bool
) -> Callable[[int], None]:
    """What tells people, or a program, that clients can connect; they look for records at the port `search`."""
    names = [f"{prefix}{axis.record}" for axis in axes]

    def tell(port: int) -> None:
        if json:
            motors = [{"pv": name, "unit": axis.title, "model": axis.model} for name, axis in
                      zip(names, axes, strict=True)]  # fmt: skip
            print(json_text.dumps({"port": port, "motors": motors}), flush=True)
            return
        print(f"Motor records by Channel Access, port {search}:")
        width = max(map(len, names))
        for name, axis in zip(names, axes, strict=True):
            made = axis.settings
            limits = f", from {made.low:g} to {made.high:g}" if made.low or made.high else ", no soft limits"
            step = f"{made.resolution:g} {made.egu}".strip()
            print(f"  {name:{width}}  {axis.title}: {step} a step{limits}")
        there = "" if search == USUAL_PORT else f"EPICS_CA_SERVER_PORT={search} "
        print("Try:")
        print(f"  {there}caget {names[0]}.RBV")
        print(f"  {there}caput -c -w 60 {names[0]} {_somewhere(axes[0].settings)}")
        if port != search:
            print(
                f"Another server has port {search}, too: connections go to {port}. Who looks for records at one address"
            )
            print("hears one of the two: give this one another --ca-port where its records are not found.")
        if everywhere:
            print("All who reach this computer can move these axes; --interfaces 127.0.0.1 keeps it to this computer.")
        print("Ctrl-C ends it.", flush=True)

    return tell
