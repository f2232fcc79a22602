"""The units of the cell as something to connect to: their endpoints, and what their drivers are told."""

from typing import NamedTuple

from detent.controllers.gsc200 import pins
from detent.pins import HIGH
from detent.realtime.connect import HOSTS
from detent.workbench.messages import LinePicture, Picture, UnitPicture

CONNECTS = ("pty", "tcp")  # the kinds of endpoints that a host on this computer connects to


class Emulated(NamedTuple):
    """An axis of the cell: how it is called, and what `connect` takes; `options` as `unit.options_of` reads them."""

    name: str
    model: str
    address: str
    options: str


def emulated(picture: Picture) -> list[Emulated]:
    """Every axis of the cell whose line has an endpoint."""
    found = []
    for unit in picture.units.values():
        if unit.model not in HOSTS or unit.line is None:
            continue
        on = picture.lines[unit.line]
        outside = on
        if on.host is not None:  # an adapter, which has the endpoint
            adapter = picture.units[on.host].line
            if adapter is None:
                continue
            outside = picture.lines[adapter]
        address = next((one.address for one in outside.endpoints if one.kind in CONNECTS), None)
        if address is None:
            continue
        options = _options(picture, unit, on)
        motors = ("X", "Y") if "motor" in HOSTS[unit.model].options else ("",)
        for motor in motors:
            more = f" motor={motor}" if motor else ""
            found.append(Emulated(f"{unit.name} {motor}".strip(), unit.model, address, f"{options}{more}".strip()))
    return found


def _options(picture: Picture, unit: UnitPicture, line: LinePicture) -> str:
    known, chosen = HOSTS[unit.model].options, {option.name: option.value for option in unit.options}
    words = []
    if "checksums" in known:
        straps = {**pins.DEFAULT_STRAPS, **unit.straps}
        number = pins.address(straps)
        words += ["checksums=no"] * (straps["CHS"] != HIGH) + [f"address={number}"] * (number is not None)
        if "revision" in chosen:
            words.append(f"revision={chosen['revision']}")
    if "drive" in known:
        words.append(f"drive={chosen['number']}")
    if "mode" in known:
        words += _mode(picture, unit, line, chosen["name"])
    form = line.format.split()
    if form and form[0].isdecimal() and line.kind == "serial":
        words.append(f"baud={form[0]}")
    return " ".join(words)


def _mode(picture: Picture, unit: UnitPicture, line: LinePicture, name: str) -> list[str]:
    """How the axis of a DCB-274 is addressed. In a daisy chain the driver gives the names, A to the first unit."""
    if line.kind == "daisy-chain":
        return ["mode=daisy", "first=A", f"name={chr(ord('A') + line.units.index(unit.name))}"]
    if line.host is not None:
        return [f"mode={'sin10' if picture.units[line.host].model == 'sin-10' else 'party'}", f"name={name}"]
    return ["mode=party", f"name={name}"] if unit.straps.get("PARTY") == HIGH else []
