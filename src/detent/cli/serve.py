"""The verb `serve`: a controller or a cell in real time, on terminals, ports and wires."""

import gc
import json as json_text
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cell.description import Description
    from detent.realtime.boards.drive import RealPins
    from detent.realtime.endpoints.spec import EndpointSpec
    from detent.realtime.endpoints.tcp import TcpAddress
    from detent.realtime.notify import Notifier
    from detent.realtime.service import Served, Service

RETRY = 2.0  # seconds until what is there and does not answer is asked again


def serve(
    target: Annotated[str | None, Parameter(show_default=False)] = None,
    *,
    pty: Annotated[list[Path] | None, Parameter(consume_multiple=(0, 1), negative=())] = None,
    tcp: str | None = None,
    rfc2217: str | None = None,
    serial: Path | None = None,
    pace: float = 1.0,
    line_timing: Annotated[bool, Parameter(negative="--no-line-timing")] = True,
    strap: Annotated[Sequence[str], Parameter(negative=())] = (),
    set_: Annotated[Sequence[str], Parameter(name="--set", negative=())] = (),
    pin: Annotated[Sequence[str], Parameter(negative=())] = (),
    state: Path | None = None,
    control: str | None = None,
    token: str | None = None,
    real: Annotated[bool, Parameter(negative=())] = False,
    realtime: Annotated[bool, Parameter(negative=())] = False,
    wait: Annotated[bool, Parameter(negative=())] = False,
    json: bool = False,
) -> None:
    """Serve a controller or a cell in real time, until Ctrl-C.

    Without --pty, --tcp, --rfc2217 and --serial every line gets the endpoint of its cell file, or a pseudo-terminal
    (a free TCP port where the system has none).
    What to connect to is printed.

    For example: `detent serve gs-c200 --pty /tmp/gsc --strap CHS=low`

    Or: `detent serve cell.toml --tcp 127.0.0.1:4001`

    Parameters
    ----------
    target
        A model by name, or a cell file (CELL.toml).
    pty
        Open a pseudo-terminal; with a value, make this symbolic link to it (of several lines: LINK-LINE).
    tcp
        Listen on HOST:PORT for one client at a time. Port 0: any free port; several lines count up from PORT.
    rfc2217
        The same as a serial port over TCP: a client sets baud rate and format, and hears garbage if they do not fit.
    serial
        Be the controller at this serial device. The line timing is then left to the wire.
    pace
        Run so many times as fast as real time.
    line_timing
        Let characters take their time on the serial line.
    strap
        PIN=LEVEL (low, high, open), or UNIT.PIN=LEVEL for a cell.
    set_
        OPTION=VALUE, or UNIT.OPTION=VALUE for a cell.
    pin
        PIN=LEVEL: an input is held at a level, or UNIT.PIN=LEVEL for a cell; `detent control` can change it.
    state
        Keep EEPROM images in this folder instead of $XDG_STATE_HOME/detent or ~/.local/state/detent.
    control
        Listen on HOST:PORT for who looks and meddles, see `detent control`. Port 0: any free port.
    token
        What those have to know, where it is not this computer alone that can ask; $DETENT_TOKEN without it.
    real
        Drive the pins of the boards in the cell file: steps, outputs and inputs of [boards] and [hardware].
    realtime
        Take real-time priority, so that a busy computer makes no step late.
    wait
        Wait for boards and serial ports that are not plugged in yet, in whatever order they come.
    json
        Print one line of JSON once everything is open, and nothing else.
    """
    from detent.cell.description import Problem
    from detent.cli.codes import FAILED
    from detent.cli.endings import asked_wrongly, failed
    from detent.realtime.appearing import devices
    from detent.realtime.boards.drive import take_priority
    from detent.realtime.cell_source import find_cell
    from detent.realtime.endpoints.endpoint import EndpointError, EndpointLost
    from detent.realtime.images import Images, ImagesUnusable, default_folder
    from detent.realtime.notify import Notifier
    from detent.realtime.pace import check_pace
    from detent.realtime.polling import allow_many
    from detent.realtime.service import Service, models

    links = list(pty) if pty is not None else None
    if target is None and links:  # `serve --pty gs-c200`: what follows --pty was meant to be served
        target, links = str(links[0]), []
    try:
        if target is None:
            raise Problem("", "", "say what to serve: a model like gs-c200 (detent models), or a CELL.toml")
        try:
            check_pace(pace)
        except ValueError as error:
            raise Problem("", "--pace", str(error)) from None
        endpoints = asked_endpoints(links, tcp, rfc2217, serial)
        control_at = None if control is None else asked_address("--control", control)
        if real and pace != 1:
            raise Problem("", "--pace", "real pins keep real time: leave it out with --real")
        found = find_cell(target, straps=strap, options=set_, pins=pin)
        folder = state if state is not None else default_folder()
        images = Images.of(folder, target, models(found.description), is_file=bool(found.description.file))
    except (Problem, ImagesUnusable) as error:
        asked_wrongly(error)
    notifier = Notifier(os.environ)
    allow_many()
    try:
        try:
            pins = _real_pins(notifier) if real else None
            on_wire = (lambda text: _tell_wire(text, notifier)) if real or wait else None

            def opened() -> Service:
                return Service(found.description, found.read, endpoints, pace=pace, line_timing=line_timing,
                               images=images, observed=control_at is not None, on_stop=_tell_stop,
                               real=pins, timers=(notifier,), on_wire=on_wire)  # fmt: skip

            needed = devices(found.description, endpoints, real=real)
            service = _wait(needed, opened, notifier) if wait else opened()
            url = _control(service, control_at, token)
        except (Problem, EndpointError) as error:
            asked_wrongly(error)
        except ImagesUnusable as error:
            failed(error)  # a service tries again: the disk may come back
        except ValueError as error:
            asked_wrongly(Problem("", "", str(error)))
        # before anybody is told that it is ready: who hears that may end it at once
        with service, service.stopped_by_signals():
            for report in service.reports:
                print(f"detent: {report}", file=sys.stderr)
            refused = take_priority() if realtime else ""
            if refused:
                print(f"detent: {refused}", file=sys.stderr)
            if json:
                print(json_text.dumps(_facts(service, url)), flush=True)
            else:
                _print_ready(service, found.description, folder, pace, url)
            notifier.ready(f"serving {', '.join(found.description.units)}")
            gc.freeze()  # what is there now stays: no collection shall look at it while a deadline waits
            try:
                service.run()
            except EndpointLost as error:
                failed(error)
            finally:
                notifier.stopping()
        if not json:
            _print_end(service)
        if service.stopped:
            raise SystemExit(FAILED)
    finally:
        notifier.close()
        images.close()


def _tell_stop(why: str) -> None:
    print(f"detent: {why}", file=sys.stderr)
    print("detent: it hears nothing any more, and can be looked at; Ctrl-C ends it.", file=sys.stderr, flush=True)


def asked_endpoints(
    links: list[Path] | None, tcp: str | None, rfc2217: str | None, serial: Path | None
) -> "list[EndpointSpec]":
    """The endpoints that the command line asks for. Raises Problem."""
    from detent.realtime.endpoints.spec import EndpointSpec

    endpoints = []
    if links is not None:
        endpoints.append(EndpointSpec("pty", str(links[0]) if links else ""))
    for kind, address in (("tcp", tcp), ("rfc2217", rfc2217)):
        if address is not None:
            asked_address(f"--{kind}", address)
            endpoints.append(EndpointSpec(kind, address))
    if serial is not None:
        endpoints.append(EndpointSpec("serial", str(serial)))
    return endpoints


def asked_address(flag: str, text: str) -> "TcpAddress":
    """HOST:PORT of an option. Raises Problem."""
    from detent.cell.description import Problem
    from detent.realtime.endpoints.tcp import TcpAddress

    try:
        return TcpAddress.parse(text)
    except ValueError as error:
        raise Problem("", flag, str(error)) from None


def _control(service: "Service", address: "TcpAddress | None", token: str | None) -> str | None:
    """Open the interface for looks and interference; its URL. It ends with the service. Raises EndpointError."""
    from detent.realtime.control import Control
    from detent.realtime.http import TOKEN, HttpControl

    if address is None:
        return None
    try:
        http = HttpControl(Control(service), address, token or os.environ.get(TOKEN))
    except BaseException:
        service.close()
        raise
    service.ends_with(http.close)
    return http.url


def _wait(needed: "Mapping[str, str]", opened: "Callable[[], Service]", notifier: "Notifier") -> "Service":
    """Until every device is there and does what it should; told once which are not. Raises Problem."""
    from detent.realtime.appearing import wait_for
    from detent.realtime.boards.opening import NotYet
    from detent.realtime.endpoints.endpoint import EndpointError

    told: set[str] = set()

    def tell(text: str) -> None:
        if text not in told:
            told.add(text)
            print(f"detent: {text}", file=sys.stderr, flush=True)
        notifier.status(text)

    while True:
        wait_for(list(needed), lambda missing: tell("waiting for " + ", ".join(f"{d} ({needed[d]})" for d in missing)))
        try:
            return opened()
        except (NotYet, EndpointError) as error:
            tell(f"{error}; trying again")
        time.sleep(RETRY)


def _tell_wire(text: str, notifier: "Notifier") -> None:
    """A serial port went away, or came back."""
    print(f"{'<4>' if notifier.heard else ''}detent: {text}", file=sys.stderr, flush=True)
    notifier.status(text)


def _real_pins(notifier: "Notifier") -> "RealPins":
    """What people should know of real pins is a line on stderr, with the time of the cell.

    A service manager is told how much each matters, by the prefix that its journal takes (sd-daemon(3)).
    """
    from detent.realtime.boards.drive import RealPins
    from detent.realtime.boards.states import News, Severity

    grave = {Severity.FAULT: "<3>", Severity.WARNING: "<4>"} if notifier.heard else {}

    def tell(news: News) -> None:
        if news.severity is not Severity.NOTE:
            notifier.status(f"{news.severity.value} at {news.at / 1e9:.3f} s: {news.text}")
        weight = f"{grave.get(news.severity, '')}detent: {news.at / 1e9:.3f} s: {news.severity.value}"
        print(f"{weight}: {news.text}", file=sys.stderr, flush=True)

    return RealPins(tell)


def _facts(service: "Service", control: str | None) -> dict[str, object]:
    """What `--json` tells."""
    told: dict[str, object] = {
        "endpoints": [{"unit": e.unit, "kind": e.kind, "address": e.address} for e in service.endpoints],
        "control": control,
    }
    if service.driven is not None:
        told["boards"] = [state._asdict() for state in service.driven.board_states()]
        told["axes"] = [ledger.name for ledger in service.driven.ledgers]
    return told


def _print_ready(
    service: "Service", description: "Description", folder: Path, pace: float, control: str | None
) -> None:
    """Say what is served, and how to connect: a line to copy for each endpoint."""
    from detent.cell.real_pins import unreal

    speed = "real time" if pace == 1 else f"{pace:g} times real time"
    print(f"Serving {', '.join(description.units)} in {speed}; EEPROM images in {folder}")
    for unit, line in _straps(description, service.cell):
        print(f"  {unit}: {line}")
    if service.driven is not None:
        for state in service.driven.board_states():
            axes = ", ".join(ledger.name for ledger in service.driven.ledgers if ledger.what.board == state.board)
            lead = service.driven.plan.lead / 1e6
            print(f"Real pins of {state.board} ({state.firmware}): {axes or 'no axis'}; {lead:g} ms behind")
    for line in unreal(description, tuple(service.cell.controllers()), driven=service.driven is not None):
        print(line)
    print("Connect:")
    width = max(len(endpoint.unit) for endpoint in service.endpoints)
    commands = [(endpoint, _command(endpoint)) for endpoint in service.endpoints]
    longest = max(len(command) for _, command in commands)
    for endpoint, command in commands:
        print(f"  {endpoint.unit:{width}}  {command:{longest}}  # {_what(endpoint)}")
    if control is not None:
        print(f"Look at it, meddle with it, break it:\n  detent control {control}")
    for hint in _hints(description):
        print(hint)
    print("Ctrl-C ends it.", flush=True)


def _hints(description: "Description") -> list[str]:
    """What a person who types by hand should know of the models that are served."""
    from detent.controllers import catalogue

    models = dict.fromkeys(unit.model for unit in description.units.values())
    hints = [catalogue.MODELS[model].by_hand for model in models if model in catalogue.MODELS]
    return [hint for hint in dict.fromkeys(hints) if hint]


def _straps(description: "Description", cell: "Cell") -> list[tuple[str, str]]:
    """Every controller with its model and its straps as they are read."""
    listed = []
    for unit, controller in cell.controllers().items():
        model = description.units[unit].model
        text = " ".join(f"{pin}={level}" for pin, level in controller.straps.items())
        listed.append((unit, f"{model}, straps {text}" if text else model))
    return listed


def _command(endpoint: "Served") -> str:
    """A line that connects a terminal to an endpoint."""
    match endpoint.kind:
        case "pty":  # without the format, which a pseudo-terminal does not have
            return f"picocom --baud {endpoint.form.baud} {endpoint.address}"
        case "tcp":
            host, port = _reachable(endpoint.address)
            # Enter sends CR, at once: what the controllers wait for and a terminal in its usual mode never sends
            return f"stty -icrnl -icanon; nc {host} {port}; stty sane"
        case "rfc2217":
            host, port = _reachable(endpoint.address)
            url = f"rfc2217://{f'[{host}]' if ':' in host else host}:{port}"
            form = endpoint.form  # as pyserial wants it
            settings = f'{form.baud}, {form.data_bits}, "{form.parity[0].upper()}", {form.stop_bits}'
            return f'serial.serial_for_url("{url}", {settings})'
        case _:
            return endpoint.address


def _reachable(address: str) -> tuple[str, str]:
    """Host and port at which a client on this computer reaches what listens on `address`."""
    host, _, port = address.rpartition(":")
    return {"0.0.0.0": "127.0.0.1", "[::]": "::1"}.get(host, host.strip("[]")), port


def _what(endpoint: "Served") -> str:
    """What kind of endpoint it is."""
    match endpoint.kind:
        case "pty":
            return f"pseudo-terminal, {endpoint.form}"
        case "tcp":
            return f"TCP {endpoint.address}, {endpoint.form}"
        case "rfc2217":
            return f"RFC 2217 (pyserial), {endpoint.form}"
        case _:
            return f"the wire at this serial port, {endpoint.form}"


def _print_end(service: "Service") -> None:
    print(f"Ended after {service.cell.now / 1e9:.3f} s: {service.lateness()}.")
    for line in () if service.driven is None else service.driven.ended():
        print(f"  {line}")
    dropped = service.dropped()
    if dropped:
        print(f"{dropped} bytes were lost because a client did not read them.")
