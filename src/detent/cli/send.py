"""The verb `send`: one exchange with a unit, real or emulated, from the command line."""

import json as json_text
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from detent.cli.codes import FAILED
from detent.cli.unit import NO_UNIT_OPTIONS, ModelName, PortName, UnitOptions

if TYPE_CHECKING:
    from detent.hosts.typed import Said

LONGEST_WAIT = 86_400.0  # seconds


def send(
    model: ModelName,
    port: PortName,
    *lines: str,
    raw: bool = False,
    wait: float | None = None,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    r"""Send command lines to a unit and print what it answers.

    Each line goes out as its protocol demands: with checksum and CR, character by character, with the name of the
    axis. A line that begins with a hyphen stands behind `--`: detent send gs-c200 /dev/ttyUSB0 -- -100

    Ends with 1 if a line was refused, ignored or not answered; program mode that the lines have begun is ended then.

    For example: `detent send gs-c200 /dev/ttyUSB0 F V1`

    Parameters
    ----------
    lines
        Command lines as the manual writes them.
    raw
        The lines are bytes, with escapes like \r and \x1b, and go out as they are.
    wait
        Seconds to wait for a motion that a line waits for, or to listen to a program of a DCB-274 that a line has
        started: at most, 60 unless given. With --raw: seconds in which answers are collected, 0.5 unless given.
    json
        Print one line of JSON.
    """
    from detent.cli.endings import asked_wrongly
    from detent.cli.unit import unit as connected
    from detent.hosts.typed import MOTION, cuts_in, leave, listen, say
    from detent.hosts.typed import raw as exchange

    try:
        if not lines:
            raise ValueError("say what to send: detent send MODEL PORT LINE...")
        if wait is not None and not 0 <= wait <= LONGEST_WAIT:
            raise ValueError(f"--wait {wait:g}: say 0 seconds or more, a day at most")
        data = [unescaped(line) for line in lines] if raw else []
    except ValueError as error:
        asked_wrongly(error)
    refused = False
    told: list[dict[str, object]] = []
    try:
        with connected(model, port, unit) as found:
            if raw:
                for sent in data:
                    came = found.perform(exchange(sent, 0.5 if wait is None else wait))
                    told.append({"sent": escaped(sent), "received": escaped(came)})
                    if not json:
                        print(f"> {escaped(sent)}\n< {escaped(came)}", flush=True)
            else:
                seconds = MOTION if wait is None else wait
                for line, then in zip(lines, [*lines[1:], ""], strict=True):
                    printed: list[str] = []

                    def heard(text: str, printed: list[str] = printed) -> None:
                        _tell([text], printed, json)

                    _tell(found.port.receive(0.0).decode("latin-1").splitlines(), printed, json)
                    said = found.perform(say(found.driver, line, seconds, heard))
                    refused |= said.refused
                    facts: dict[str, object] = {
                        name: value for name, value in said._asdict().items() if value or name != "meanings"
                    }
                    told.append({"sent": line, **facts})
                    if not json:
                        print(f"> {line}\n{shown(said)}", flush=True)
                    if not cuts_in(found.driver, then):
                        became = found.perform(listen(found.driver, seconds, heard))
                        if became and not json:
                            print(f"< ({became})", flush=True)
                        told[-1] |= {"program": became} if became else {}
                    told[-1] |= {"printed": printed} if printed else {}
                if refused and (left := found.perform(leave(found.driver))):
                    print(f"detent: a line was refused: {left}", file=sys.stderr)
    finally:  # what was said before something failed has been said, and may have moved something
        if json and told:
            print(json_text.dumps({"model": model, "port": port, "exchanges": told}), flush=True)
    if refused:
        raise SystemExit(FAILED)


def _tell(lines: Sequence[str], printed: list[str], json: bool) -> None:
    """Show at once what a program prints, and keep it."""
    for line in filter(None, map(str.strip, lines)):
        printed.append(escaped(line.encode("latin-1")))
        if not json:
            print(f"| {printed[-1]}", flush=True)


def shown(said: "Said") -> str:
    """What was said, a line each behind ``<``, and what it means."""
    meanings = said.meanings or ("",) * len(said.answers)
    lines = [
        f"< {answer}" + (f"  ({meaning})" if meaning else "")
        for answer, meaning in zip(said.answers, meanings, strict=True)
    ] or ["<"]
    if said.meaning:
        lines[-1] += f"  ({said.meaning})"
    return "\n".join(lines)


def unescaped(text: str) -> bytes:
    r"""The bytes of a text with escapes: ``F\x16\r``. Raises ValueError."""
    try:
        return text.encode("latin-1").decode("unicode_escape").encode("latin-1")
    except (UnicodeError, ValueError):
        raise ValueError(f"{text!r}: bytes are written as characters and escapes like \\r, \\n and \\x1b") from None


def escaped(data: bytes) -> str:
    """Bytes as people read them."""
    return data.decode("latin-1").encode("unicode_escape").decode("ascii")
