"""Generated garbage: it is answered, and does no harm. (The laws of all devices: `test_conformance`.)"""

from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.controllers.genstepper.firmware import GenStepper
from detent.ticks import MS
from detent.uart import Char


def started(timed: bool) -> GenStepper:
    board = GenStepper("bs0610", line_timing=timed)
    board.power(True, 0)
    while board.next_deadline() is not None:
        board.advance(board.next_deadline())
    board.drain()
    return board


@settings(max_examples=examples(150), deadline=None)
@given(st.binary(max_size=60), st.integers(0, 50 * MS))
def test_garbage_is_answered_and_never_crashes(data, wait):
    board = started(timed=False)
    now = 600 * MS
    for value in data:
        board.receive("SI", [Char(value)], now)
        now += wait
        while (due := board.next_deadline()) is not None and due <= now:
            board.advance(due)
        assert -(2**31) < board.status(now).position < 2**31
        assert board.next_deadline() is None or board.next_deadline() > now
