"""The verb `service`: a systemd unit that serves a cell from power-on, as the box did that it replaces."""

import getpass
import json as json_text
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from detent.cli.overwrite import Overwrite

if TYPE_CHECKING:
    from detent.cell.description import Description

WATCHDOG = 5  # s without a sign of life, then it is started again
UNITS = Path("/etc/systemd/system")


def service(
    cell: str,
    *,
    name: str | None = None,
    user: str | None = None,
    control: str | None = None,
    output: Path | None = None,
    overwrite: Overwrite = False,
    json: bool = False,
) -> None:
    """Print a systemd unit that serves a cell from power-on.

    Real pins are driven if the cell has any.

    The service waits for boards and serial ports in whatever order they are plugged in, tells systemd when it is
    ready and that it is alive, has real-time priority, and is started again if it fails. What it has to say is in its
    journal.

    For example: `detent service cell.toml --output cell.service`

    Parameters
    ----------
    cell
        A cell file (CELL.toml).
    name
        Name of the unit; by default detent- and the name of the cell file.
    user
        User who runs it, by default you; must be allowed to open the serial ports.
    control
        Listen on HOST:PORT for `detent control`, as `serve --control` does.
    output
        Write the unit to this file instead of printing it, and say what to do with it.
    overwrite
        Write over a file that is there.
    json
        Print name, text and remarks as one line of JSON.
    """
    from detent.cell.build import build
    from detent.cell.description import Problem
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.serve import asked_address
    from detent.outputs.files import check_outputs, write_whole
    from detent.realtime.boards.plan import plan
    from detent.realtime.cell_source import find_cell

    try:
        if not cell.endswith(".toml"):
            raise Problem("", "", f"{cell} is no cell file: a service needs a CELL.toml with its lines and boards")
        found = find_cell(cell)
        if control is not None:
            asked_address("--control", control)
        called = name if name is not None else _name(Path(cell))
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}", called):
            raise Problem("", "--name", f"{called!r}: letters, digits, - and _")
        who = user if user is not None else _me()
        if not re.fullmatch(r"[a-z_][a-z0-9_-]*\$?", who):
            raise Problem("", "--user", f"{who!r} is no name of a user")
        check_outputs([output], found.inputs, asked=overwrite)
        made = build(found.description, found.read, record=False)  # at power-on nobody reads why it cannot be
        if found.description.hardware:
            plan(found.description, made.controllers())
    except ValueError as problem:
        asked_wrongly(problem)
    remarks = _remarks(found.description, who)
    for remark in () if json else remarks:
        print(f"detent: {remark}", file=sys.stderr)
    text = unit(found.description, Path(cell).resolve(), called, who, control)
    if output is not None:
        try:
            write_whole(output, text.encode())
        except OSError as error:
            failed(f"{output}: cannot write there: {error.strerror}")
    if json:
        file = None if output is None else str(output)
        print(json_text.dumps({"name": called, "file": file, "unit": text, "remarks": remarks}))
        return
    if output is None:
        print(text, end="")
        return
    place = UNITS / f"{called}.service"
    print(f"{output} is written. To start it now and with the machine:")
    if output.resolve() != place:
        print(f"    sudo cp {shlex.quote(str(output))} {place}")
    print("    sudo systemctl daemon-reload")
    print(f"    sudo systemctl enable --now {called}")
    print(f"What it says:   journalctl -u {called} -f")


def _me() -> str:
    """The user who runs this. Raises Problem where the system has no name of one: a container, Windows."""
    from detent.cell.description import Problem

    try:
        return getpass.getuser()
    except (KeyError, ImportError, OSError):  # which of them depends on the system and on the version of Python
        raise Problem("", "--user", "this system has no name for you: say who runs the service") from None


def unit(description: "Description", cell: Path, name: str, user: str, control: str | None = None) -> str:
    """The text of the unit for a cell file at the absolute path `cell`."""
    words = [sys.executable, "-m", "detent", "serve", str(cell), "--wait"]
    if description.hardware:
        words += ["--real", "--realtime"]
    if control is not None:
        words += ["--control", control]
    command = " ".join([*map(_quoted, words), "--state", f"%S/{name}"])
    title = " ".join((description.title or name).split()).replace("%", "%%")
    return f"""# Made by `detent service {cell.name}`; made again, it says the same.
[Unit]
Description=Detent: {title}
After=systemd-udevd.service
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
WorkingDirectory={_path(cell.parent)}
User={user}
# it waits for what is not plugged in yet
TimeoutStartSec=infinity
WatchdogSec={WATCHDOG}
# started anew, the cell comes up as the module does at power-on: with REC tied low it looks for home
Restart=on-failure
RestartSec=2
# wrongly asked (a cell file that cannot be): trying again does not help
RestartPreventExitStatus=2
# ended while it waited for something to be plugged in
SuccessExitStatus=143
TimeoutStopSec=10
# EEPROM images, in /var/lib/{name}
StateDirectory={name}
LimitRTPRIO=95
LimitMEMLOCK=infinity
OOMScoreAdjust=-900
NoNewPrivileges=yes
Environment=PYTHONUNBUFFERED=1

[Install]
WantedBy=multi-user.target
"""


def _remarks(description: "Description", user: str) -> list[str]:
    """What will not go well at power-on, though the file is sound."""
    from detent.realtime.appearing import devices

    told = []
    for device, key in devices(description, (), real=True).items():
        if "/by-id/" not in device and "/by-path/" not in device:
            told.append(f"{description.file}: {key}: {device} may be another device at the next start: "
                        "take its name in /dev/serial/by-id")  # fmt: skip
    used = {table.board for table in description.hardware.values()}
    for name, board in description.boards.items():
        if name in used and board.serial.startswith("fake:"):
            told.append(f"{description.file}: boards.{name}.serial: {board.serial} drives no pin: put your board's "
                        "name here (detent boards)")  # fmt: skip
    if not any(line.endpoint for line in description.lines.values()):
        told.append(f"{description.file}: lines: no line says where its host is: endpoint = 'serial:DEVICE'")
    if user == "root":
        told.append(
            "it will run as root: --user NAME takes another, a member of the group of the serial ports (dialout)"
        )
    return told


def _name(cell: Path) -> str:
    stem = cell.resolve().parent.name if cell.stem == "cell" else cell.stem
    return "detent-" + (re.sub(r"[^A-Za-z0-9_-]+", "-", stem).strip("-") or "cell")


def _quoted(word: str) -> str:
    """A word of a command line in a unit (systemd.service(5), "Command lines")."""
    word = word.replace("\\", "\\\\").replace("%", "%%").replace("$", "$$")
    return '"' + word.replace('"', '\\"') + '"' if re.search(r"[\s'\"\\;]", word) else word


def _path(path: Path) -> str:
    return str(path).replace("%", "%%")
