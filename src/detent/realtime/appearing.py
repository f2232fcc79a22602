"""Devices that are not plugged in yet: which a cell needs, and waiting until they are there."""

import os
import time
from collections.abc import Callable, Sequence

from detent.cell.description import Description
from detent.cell.real_pins import device_of
from detent.realtime.boards.ports import FAKE
from detent.realtime.endpoints.spec import EndpointSpec

LOOK_EVERY = 0.5  # s


def devices(described: Description, endpoints: Sequence[EndpointSpec], *, real: bool) -> dict[str, str]:
    """The devices that have to be there before a cell can be served, each with the key or flag that names it."""
    found: dict[str, str] = {}
    if real:
        used = {table.board for table in described.hardware.values()}
        for name, board in described.boards.items():
            device = device_of(board.serial)[0]
            if name in used and not device.startswith(FAKE):
                found.setdefault(device, f"boards.{name}.serial")
    for one in endpoints:
        if one.kind == "serial":
            found.setdefault(one.where, "--serial")
    for name, line in described.lines.items() if not endpoints else ():
        kind, _, device = (line.endpoint or "").partition(":")
        if kind == "serial" and device:
            found.setdefault(device, f"lines.{name}.endpoint")
    return found


def wait_for(
    devices: Sequence[str],
    tell: Callable[[Sequence[str]], None],
    *,
    there: Callable[[str], bool] = os.path.exists,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Wait until all are there, in whatever order they come. `tell` is told once which are missing, if any are."""
    missing = [device for device in devices if not there(device)]
    if missing:
        tell(missing)
    while missing:
        sleep(LOOK_EVERY)
        missing = [device for device in missing if not there(device)]
