"""Every key of `[boards]` and `[hardware]` missing, misspelt, of a wrong kind, out of range: one line that names it."""

import copy
import json
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from tests.cell.cells import cell

from detent.cell.description import Problem

WHOLE = tomllib.loads("""
[units.slide]
model = "gs-c200"
[units.bar]
model = "dcb-274"
[units.table]
model = "bs0610"
[boards.left]
serial = "/dev/serial/by-id/usb-Klipper_rp2040_1-if00"
lead = "30 ms"
margin = "4 ms"
error = "1 us"
watchdog = "2 s"
replies = "held"
[boards.right]
serial = "fake:stm32"
[hardware.slide]
board = "left"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
pulse = "20 us"
outputs = { MOV = "gpio6" }
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
sample = "50 us"
samples = 2
[hardware.slide.driver]
kind = "tmc2209"
uart = "gpio8"
transmit = "gpio9"
address = 1
sense = 0.11
amperes = 0.5
microsteps = 2
quiet = true
interpolate = true
[hardware.bar]
board = "right"
step = "PF13"
dir = "PF12"
minus = "PF11"
unwired = ["LIMIT-B"]
inputs = { HOME = "^PG6", LIMIT-A = "^PG9" }
driver = { kind = "tmc5160", select = "PC4", clock = "PA5", mosi = "PA7", miso = "PA6", sense = 0.075 }
[hardware.table]
board = "right"
inputs = { RST = "^PG12" }
[hardware.table.X]
board = "right"
step = "PE1"
dir = "PE2"
unwired = ["LX-", "LX+"]
driver = { kind = "plain", half = "PE3" }
""")
GONE, MISSPELT = object(), object()
LEFT_OUT = {  # what a table does without
    "lead", "margin", "error", "watchdog", "replies", "enable", "pulse", "outputs", "MOV", "sample", "samples",
    "driver", "transmit", "address", "sense", "amperes", "microsteps", "quiet", "interpolate", "minus", "RST",
}  # fmt: skip
NEVER_SOUND = (
    0, -1, 1e9, 10**30, float("nan"), float("inf"), True, False, [], {}, ["a", 1], {"a": "b"}, "", " ", "!", "\n",
    "\x00", "!!gpio2", "^~gpio2", "gpio2 gpio3", "1 parsec", "-1 ms", "x" * 5000,
)  # fmt: skip
SOUND: dict[tuple[str, str], tuple[object, ...]] = {  # of these all the same
    ("driver", "address"): (0,), ("driver", "quiet"): (True, False), ("driver", "interpolate"): (True, False),
    ("driver", "amperes"): (1e9,), ("left", "watchdog"): (1e9,),
    ("slide", "outputs"): ({},), ("table", "inputs"): ({},),
    ("left", "serial"): ("!", "!!gpio2", "^~gpio2", "gpio2 gpio3", "1 parsec", "-1 ms", "x" * 5000),
}  # fmt: skip
SOUND["right", "serial"] = SOUND["left", "serial"]


def toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value) if isinstance(value, str) else str(value)


def places(table: Mapping[str, Any], before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for key, value in table.items():
        if len(before) >= 2:
            yield (*before, key)
        if isinstance(value, Mapping):
            yield from places(value, (*before, key))


def changed(place: tuple[str, ...], value: object) -> str:
    whole = copy.deepcopy(WHOLE)
    table: Any = whole
    for key in place[:-1]:
        table = table[key]
    if value is MISSPELT:
        table[place[-1][:-1] + "_"] = table.pop(place[-1])
    elif value is GONE:
        del table[place[-1]]
    else:
        table[place[-1]] = value
    return "\n".join(f"{key} = {toml(each)}" for key, each in whole.items())


def sound(place: tuple[str, ...], value: object) -> bool:
    if value is GONE:
        return place[-1] in LEFT_OUT or place in (("hardware", "table", "X"), ("hardware", "table", "inputs"))
    return any(type(value) is type(one) and value == one for one in SOUND.get(place[-2:], ()))


def test_as_it_is_it_is_sound() -> None:
    cell("\n".join(f"{key} = {toml(each)}" for key, each in WHOLE.items()))


@pytest.mark.parametrize("place", [p for p in places(WHOLE) if p[0] != "units"], ids=".".join)
def test_what_is_wrong_is_one_line_with_file_and_key(place: tuple[str, ...]) -> None:
    for value in (GONE, MISSPELT, *NEVER_SOUND):
        text = changed(place, value)
        if sound(place, value):
            cell(text)
            continue
        with pytest.raises(Problem) as caught:
            cell(text)
        told = str(caught.value)
        table = ".".join(place[:2])
        assert told.startswith(f"cell.toml: {table}"), (value, told)
        assert told.isprintable(), (value, told)
        assert len(told) < 700, (value, told)
        if value is MISSPELT and place[-1] not in ("board", "X"):
            last = place[-1][:-1] + "_"
            assert last in told or "missing" in told or "has no" in told, told
