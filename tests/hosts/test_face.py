"""The face of the drivers in an editor: names, signatures and types that are there and true."""

import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import detent
from detent.hosts.dcb274 import AsyncDcb274, BlockingDcb274, Dcb274
from detent.hosts.exchange import Operation
from detent.hosts.genstepper import AsyncGenStepper, BlockingGenStepper, GenStepper
from detent.hosts.gsc200 import AsyncGsC200, BlockingGsC200, GsC200
from detent.hosts.supersigma import AsyncSupersigma, BlockingSupersigma, Supersigma
from detent.realtime.connect import connect, connect_async

DRIVERS = {
    GsC200: (BlockingGsC200, AsyncGsC200),
    Dcb274: (BlockingDcb274, AsyncDcb274),
    GenStepper: (BlockingGenStepper, AsyncGenStepper),
    Supersigma: (BlockingSupersigma, AsyncSupersigma),
}


def test_the_package_shows_what_it_has() -> None:
    assert {"connect", "connect_async"} <= set(dir(detent))


@pytest.mark.parametrize("kind", DRIVERS)
def test_signatures_of_a_shell_are_those_of_calls(kind: type[Any]) -> None:
    for shell in DRIVERS[kind]:
        unit = shell(kind(), object())
        names = [name for name in dir(kind) if isinstance(inspect.getattr_static(kind, name), Operation)]
        assert len(names) > 10
        for name in names:
            found = inspect.signature(getattr(unit, name))
            of_class = inspect.signature(getattr(type(unit), name))
            assert [*of_class.parameters] == ["self", *found.parameters], "as help of the class shows it"
            assert of_class.return_annotation == found.return_annotation
            assert "self" not in found.parameters
            assert "Generator" not in str(found), name
            assert getattr(unit, name).__doc__
    position = inspect.signature(DRIVERS[kind][0](kind(), object()).position)
    assert str(position) == "() -> int"


PROGRAM = """
from detent import connect, connect_async

def calls() -> None:
    unit = connect("{model}", "PORT")
    here: int = unit.position()
    unit.move_to(here + 1)
    unit.wait(timeout=2.0)
    unit.close()

async def coroutines() -> None:
    unit = await connect_async("{model}", "PORT")
    here: int = await unit.position()
    await unit.move_to(here + 1)
    await unit.close()
"""
MISTAKES = {
    "unit.positoin()": 'has no attribute "positoin"',
    "unit.move_to('home')": "incompatible type",
    "there: str = unit.position()": "Incompatible types in assignment",
}


@pytest.mark.slow
@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610", "supersigma"])
def test_a_type_checker_takes_what_is_right_and_finds_a_misspelt_name(model: str, tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    lines = PROGRAM.format(model=model).splitlines()
    wrong = lines.index("    unit.close()")
    lines[wrong:wrong] = [f"    {line}" for line in MISTAKES]
    file = tmp_path / "program.py"
    file.write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", f"--cache-dir={tmp_path}", str(file)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    told = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(told) == len(MISTAKES), done.stdout + done.stderr
    for (line, what), found in zip(MISTAKES.items(), told, strict=True):
        assert what in found, (line, found)


@pytest.mark.parametrize("port", [115_200, None, b"/dev/ttyUSB0", Path("/dev/ttyUSB0"), object()])
def test_what_is_no_port_is_told_at_once(port: Any) -> None:
    with pytest.raises(ValueError, match="a port is a serial device like /dev/ttyUSB0, HOST:PORT"):
        connect("gs-c200", port)
    with pytest.raises(ValueError, match="a port is a serial device"):
        connect_async("gs-c200", port).send(None)


def test_a_number_in_the_place_of_a_port_is_taken_for_the_rate() -> None:
    with pytest.raises(ValueError, match="a rate is named, baud=115200"):
        connect("gs-c200", 115_200)  # type: ignore[call-overload]
