"""Bad input in all three modes: never a crash, and a refused command changes nothing."""

import copy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.controllers.dcb274.bench_unit import Bench
from tests.controllers.dcb274.inputs import command
from tests.generated import examples

from detent.controllers.dcb274.firmware import Dcb274
from detent.controllers.device import Refused
from detent.pins import PinSet
from detent.ticks import SECOND
from detent.uart import Char, Sent

START = {"single": b" ", "party": b"", "daisy": b"\nA", "waiting": b""}
NOISE = st.lists(
    st.binary(max_size=40) | command().map(lambda text: f"A{text}\n{text}\r".encode("latin-1")), max_size=12
)


def registers(bench: Bench) -> dict[str, Any]:
    """Everything that a command may change."""
    unit = bench.unit
    found = {name: getattr(unit._settings, name) for name in unit._settings.__slots__}
    return found | {
        "memory": (unit.memory.nv, unit.memory.ram), "position": bench.position, "latch": unit._ports.latch,
        "status": unit.status(bench.now),
    }  # fmt: skip


@pytest.mark.parametrize("mode", START)
@given(noise=NOISE)
@settings(max_examples=examples(60), deadline=None)
def test_no_input_brings_the_unit_down(mode: str, noise: list[bytes]) -> None:
    unit = Dcb274({"PARTY": int(mode == "party")}, line_timing=mode == "single")
    unit.power(True, 0)
    now = 0
    for data in (START[mode], *noise, b"\x03", b" X\r" if mode != "party" else b"AX\n"):
        unit.receive("RX", [Char(value) for value in data], now)
        now += SECOND // 3
        while (at := unit.next_deadline()) is not None and at <= now:
            unit.advance(at)
            for item in unit.drain():
                if type(item).__name__ == "StoreImage":
                    unit.stored(True, at)
    assert unit.status(now).state in ("ready", "waiting", "running", "moving")


@given(text=command())
@settings(max_examples=examples(300), deadline=None)
def test_a_line_that_is_answered_with_a_cross_changes_nothing(text: str) -> None:
    if any(not " " <= c <= "~" for c in text) or len(text) > 15:
        return
    bench = Bench()
    bench.run_to(SECOND)
    before = copy.deepcopy(registers(bench))
    mark = len(bench.out)
    answer = bench.do(text, wait=100_000_000)
    if answer.endswith("#\r\n") and [o for o in bench.out[mark:] if isinstance(o, Refused)]:
        assert registers(bench) == before
        assert all(isinstance(o, (Refused, Sent)) for o in bench.out[mark:])
        assert not [o for o in bench.out[mark:] if isinstance(o, PinSet)]


def test_a_store_that_fails_leaves_everything_as_it_was_and_is_refused() -> None:
    bench = Bench()
    bench.do("P 126")
    before = registers(bench)
    unit = bench.unit
    for line in ("+ 300", "P", "\x0eQ", "\x1b\\ 600 5", "S", "C 1", "C 4"):
        unit.receive("RX", [Char(ord(c)) for c in f"{line}\r"], bench.now)
        answer = ""
        while (at := unit.next_deadline()) is not None:
            bench.now = max(at, bench.now)
            unit.advance(at)
            for item in unit.drain():
                answer += chr(item.char.value) if isinstance(item, Sent) else ""
                if type(item).__name__ == "StoreImage":
                    unit.stored(False, bench.now)
        unit.receive("RX", [], bench.now)
        for item in unit.drain():
            answer += chr(item.char.value) if isinstance(item, Sent) else ""
            if type(item).__name__ == "StoreImage":
                unit.stored(False, bench.now)
        answer += "".join(chr(item.char.value) for item in unit.drain() if isinstance(item, Sent))
        assert "#" in answer, line
        after = registers(bench)
        assert {**after, "status": 0} == {**before, "status": 0}, line
