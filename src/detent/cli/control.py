"""The verb `control`: look at a cell that is served, meddle with it, break it."""

import json as json_text
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from rich.console import Console

    from detent.realtime.verbs import Verb

LONGER = 30.0  # seconds for an answer, all of it, beyond what a verb waits for
MOST_ANSWER = 64 << 20  # bytes: more than the journal of any cell


def control(
    url: str,
    *words: Annotated[str, Parameter(allow_leading_hyphen=True)],
    token: str | None = None,
    json: bool = False,
) -> None:
    """Look at a cell that is served, meddle with it, break it.

    `detent serve TARGET --control 127.0.0.1:8400` prints the URL. Behind it a verb with its arguments, by place or as
    --NAME VALUE; without a verb the state is shown, and `help` lists the verbs (`help VERB`: its arguments).

    For example: `detent control http://127.0.0.1:8400 fault bar bit-errors --rate 0.01`

    Parameters
    ----------
    url
        What `serve --control` printed, like http://127.0.0.1:8400.
    words
        A verb and its arguments.
    token
        What `serve` was given as --token; $DETENT_TOKEN without it.
    json
        Print the answer as one line of JSON.
    """
    from detent.cli.endings import asked_wrongly, failed
    from detent.realtime import verbs
    from detent.realtime.verbs import AskedWrongly

    name, *given = words or ("state",)
    try:
        if name in ("help", "verbs"):
            _print_help([verbs.verb(other) for other in given], json)
            return
        verb = verbs.verb(name)
        arguments = placed(verb, given)
        read = verb.read(arguments)
    except AskedWrongly as error:
        asked_wrongly(error)
    timeout = read.get("timeout")
    waits = verbs.SHORT_WAIT if verb.waits else 0.0
    patience = LONGER + (timeout / 1e9 if isinstance(timeout, int) else waits)
    answer = _ask(url, verb, arguments, token or os.environ.get("DETENT_TOKEN"), patience)
    if json:
        print(json_text.dumps(answer))
    else:
        try:
            _print(verb.name, answer)
        except (LookupError, TypeError, ValueError, AttributeError):
            failed(f"{url} is no service: it does not answer {verb.name} as one does")
    if answer.get("reached") is False:
        raise SystemExit(1)


def placed(verb: "Verb", words: Sequence[str]) -> dict[str, str]:
    """The arguments in `words`: those without --NAME in the order of the table. Raises AskedWrongly."""
    from detent.realtime.verbs import AskedWrongly

    found: dict[str, str] = {}
    left = list(words)
    loose: list[str] = []
    while left:
        word = left.pop(0)
        if word == "--":
            loose += left
            break
        if not word.startswith("--"):
            loose.append(word)
            continue
        name, equals, value = word[2:].partition("=")
        if not equals:
            if not left:
                raise AskedWrongly(f"--{name} lacks its value", f"write --{name} VALUE")
            value = left.pop(0)
        found[name] = value
    for parameter in verb.parameters[: verb.placed]:
        if loose and parameter.name not in found:
            found[parameter.name] = " ".join(loose) if parameter.rest else loose[0]
            loose = [] if parameter.rest else loose[1:]
    if loose:
        takes = " ".join(p.name.upper() for p in verb.parameters[: verb.placed]) or "only --NAME VALUE"
        raise AskedWrongly(f"{verb.name}: {loose[0]!r} is too much", f"it takes {takes}")
    return found


LAST_LATIN = 0xFF  # what comes behind that no header of a request can have


def _ask(url: str, verb: "Verb", given: Mapping[str, str], token: str | None, patience: float) -> dict[str, Any]:
    """The answer. Ends the program with a line on stderr if not all of it has come within so many seconds."""
    import socket
    import threading
    from contextlib import suppress
    from http.client import HTTPConnection, HTTPException
    from urllib.parse import urlsplit

    from detent.cli.endings import asked_wrongly, failed
    from detent.realtime.verbs import AskedWrongly

    try:
        parts = urlsplit(url if "://" in url else f"http://{url}")
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if host is None or port is None or parts.scheme != "http":
        asked_wrongly(AskedWrongly(f"{url!r} is no URL of a service", "write it like http://127.0.0.1:8400"))
    headers = {"Content-Type": "application/json"}
    if token:
        if not token.isprintable() or any(ord(letter) > LAST_LATIN for letter in token):
            asked_wrongly(AskedWrongly("the token has characters that no request can have", "give the one of serve"))
        headers["Authorization"] = f"Bearer {token}"
    connection = HTTPConnection(host, port, timeout=patience)
    late = threading.Event()

    def end_it() -> None:
        late.set()
        with suppress(OSError, AttributeError):  # it is closed, or was never opened
            connection.sock.shutdown(socket.SHUT_RDWR)

    timer = threading.Timer(patience, end_it)  # who answers a byte at a time is patient with no single one
    timer.daemon = True
    timer.start()
    try:
        connection.request("POST", f"/{verb.name}", json_text.dumps(given), headers)
        response = connection.getresponse()
        data = response.read(MOST_ANSWER + 1)
        if len(data) > MOST_ANSWER:
            failed(f"{url} is no service: its answer has no end")
        status, answer = response.status, json_text.loads(data)
    except (OSError, HTTPException, ValueError, RecursionError) as error:
        if late.is_set() or isinstance(error, TimeoutError):
            failed(f"{url} does not answer within {patience:g} s: is it a service? detent serve prints its URL")
        reason = " ".join(str(getattr(error, "strerror", None) or error).split())
        failed(f"{url} does not answer: {reason}; start it with detent serve TARGET --control {host}:{port}")
    finally:
        timer.cancel()
        connection.close()
    if status != 200 or not isinstance(answer, dict):
        told = (
            answer if isinstance(answer, dict) else {"error": f"{url} is no service: it answers with status {status}"}
        )
        text = "; ".join(str(told[key]) for key in ("error", "remedy") if key in told)
        if 400 <= status < 500:
            asked_wrongly(ValueError(text))
        failed(text)
    return answer


# -- for people --------------------------------------------------------------------------------------------


def _print(verb: str, answer: dict[str, Any]) -> None:
    from rich.console import Console

    console = Console(highlight=False)
    if "axes" in answer:
        _print_real(console, answer)
        return
    if "units" in answer:
        if answer.get("reached") is False:
            console.print("It has not come to that in time.\n")
        _print_state(console, answer)
        return
    if verb == "pins":
        for unit, pins in answer["pins"].items():
            console.print(_table(unit, ["pin", "level", "kind", "wired", "stuck"],
                                 ([name, *pin.values()] for name, pin in pins.items())))  # fmt: skip
        return
    if verb == "faults":
        _print_faults(console, answer["faults"])
    elif verb == "journal":
        for entry in answer["journal"]:
            at, action = entry.pop("at_ns"), entry.pop("deed")
            console.print(f"{_seconds(at)}  {action}  {_named(entry)}", markup=False)
    else:
        told = [f"fault {answer['fault']}"] if "fault" in answer else []
        told += [f"mended {_listed(answer['mended'])}"] if "mended" in answer else []
        console.print(", ".join([*told, _time(answer)]), markup=False)


def _print_state(console: "Console", answer: dict[str, Any]) -> None:
    late = answer["late_ns"]
    console.print(f"{_time(answer)}; deadlines late by {late['p99'] / 1e6:.3f} ms (99 %)", markup=False)
    if "stopped" in answer:
        console.print(answer["stopped"], markup=False)
    rows = []
    for name, unit in answer["units"].items():
        executing = unit.get("executing")
        doing = f"{executing['address']}: {executing['instruction']}" if executing else ""
        for axis, where in (unit.get("axes") or {"": {}}).items():
            rows.append([f"{name}.{axis}" if axis else name, unit["model"], where.get("state", ""),
                         where.get("position", ""), where.get("pulses", ""), _rate(where.get("rate", 0.0)),
                         doing])  # fmt: skip
    console.print(_table("", ["unit", "model", "state", "position", "pulses", "steps/s", "executing"], rows))
    for name, unit in answer["units"].items():
        high = [pin for pin, level in unit["pins"].items() if level]
        low = [pin for pin, level in unit["pins"].items() if level == 0]
        console.print(f"{name}: 1 at {_listed(high)}; 0 at {_listed(low)}", markup=False)
        if unit["refused"]:
            refused = unit["refused"]
            console.print(
                f"  refused {refused['frame']!r} at {_seconds(refused['at'])}: {refused['reason']}", markup=False
            )
    console.print(_table("lines", ["line", "format", "units", "characters in", "out", "endpoints"],
                         ([name, line["format"], _listed(line["units"]), line["received"], line["sent"],
                           _listed(line["endpoints"])] for name, line in answer["lines"].items())))  # fmt: skip
    if answer["switches"]:
        told = [f"{name} {s['level']}{' (stuck)' if s['stuck'] else ''}" for name, s in answer["switches"].items()]
        console.print(f"switches: {_listed(told)}", markup=False)
    for name, motor in answer["motors"].items():
        console.print(f"motor {name}: at {motor['place']:.3f}, wanted at {motor['command']:.3f}, "
                      f"{motor['rad_per_s']:.3g} rad/s", markup=False)  # fmt: skip
    if "real" in answer:
        _print_real(console, answer["real"])
    if answer["faults"]:
        _print_faults(console, answer["faults"])


def _print_real(console: "Console", real: dict[str, Any]) -> None:
    """How real pins stand."""
    rows = []
    for name, axis in real["axes"].items():
        rows.append([name, axis["standing"], axis["shaft"], "" if axis["known"] else "not known", axis["stops"],
                     axis["slips"], f"{axis['lead'] / 1e6:g} ms", f"{axis['lag'] / 1e6:.3g} ms",
                     _listed(axis["armed"])])  # fmt: skip
    columns = ["axis", "standing", "steps", "motor", "stops", "slips", "lead", "lag", "stopped by"]
    console.print(_table("real pins", columns, rows))
    for name, axis in real["axes"].items():
        if axis["why"]:
            console.print(f"{name} stands: {axis['why']}", markup=False)
    boards = ([name, b["state"], b["firmware"], b["frequency"], b["move_count"]] for name, b in real["boards"].items())
    console.print(_table("boards", ["board", "state", "firmware", "ticks/s", "queue"], boards))
    if real.get("waits_for"):
        console.print(f"waiting for the boards of {_listed(real['waits_for'])}", markup=False)


def _print_faults(console: "Console", faults: Sequence[dict[str, Any]]) -> None:
    if not faults:
        console.print("Nothing is broken.")
        return
    rows = []
    for fault in faults:
        rest = {name: value for name, value in fault.items() if name not in ("fault", "kind", "where", "met", "struck")}
        struck = f"{fault['struck']} of {fault['met']}" if "met" in fault else ""
        rows.append([fault["fault"], fault["kind"], fault["where"], _named(rest), struck])
    console.print(_table("faults", ["fault", "kind", "where", "how", "struck"], rows))


def _print_help(asked: "Sequence[Verb]", json: bool) -> None:
    """The verbs that were asked for, each with its arguments; all, and the faults, if none was."""
    from rich.console import Console

    from detent.realtime.verbs import FAULTS, VERBS

    shown = asked or list(VERBS.values())
    if json:
        print(json_text.dumps({verb.name: [p.name for p in verb.parameters] for verb in shown}))
        return
    console = Console(highlight=False)
    console.print(_table("verbs", ["verb", "arguments", "what"],
                         ([verb.name, usage(verb), verb.help] for verb in shown)))  # fmt: skip
    for verb in asked:
        if verb.parameters:
            rows = ([p.name, p.kind.takes, p.help] for p in verb.parameters)
            console.print(_table(f"arguments of {verb.name}", ["argument", "takes", "what"], rows))
    if asked and all(verb.name != "fault" for verb in asked):
        return
    faults = ([kind.name, kind.where, " ".join(kind.takes), kind.help] for kind in FAULTS.values())
    console.print(_table("faults", ["kind", "where", "arguments", "what"], faults))


def usage(verb: "Verb") -> str:
    """The arguments of a verb as they are typed: ``PIN LEVEL``; those that may be left out in brackets."""
    words = [p.name.upper() if p.required else f"[{p.name.upper()}]" for p in verb.parameters[: verb.placed]]
    words += [f"[--{p.name}]" for p in verb.parameters[verb.placed :]]
    return " ".join(words)


def _table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Any:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title or None, title_justify="left", box=None, pad_edge=False, header_style="dim")
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(Text(_shown(cell)) for cell in row))
    return table


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else ""
    return "-" if value is None else str(value)


def _time(answer: Mapping[str, Any]) -> str:
    pace = answer["pace"]
    how = "paused" if answer["paused"] else "free" if pace is None else f"pace {pace:g}"
    if answer["paused"] and answer.get("why"):  # a workbench knows why
        how += f" {answer['why']}" if answer["why"].startswith("by ") else f": {answer['why']}"
    if answer.get("past"):
        how += f", looking back: the present is {_seconds(answer['present_ns'])}"
    if waiting := answer.get("waiting"):
        how += f", {waiting} command{'s wait' if waiting != 1 else ' waits'}"
    return f"{_seconds(answer['time_ns'])}, {how}"


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.6f} s"


def _rate(rate: float) -> str:
    return f"{rate:.4g}" if rate else ""


def _listed(items: Iterable[object]) -> str:
    return ", ".join(map(str, items)) or "nothing"


def _named(values: Mapping[str, Any]) -> str:
    shown = []
    for name, value in values.items():
        if isinstance(value, dict):
            shown.append(f"{value.get('kind', name)} {_named({k: v for k, v in value.items() if k != 'kind'})}".strip())
        elif value not in ("", None):
            shown.append(f"{name} {value!r}" if isinstance(value, str) and not value.isalnum() else f"{name} {value}")
    return ", ".join(shown)
