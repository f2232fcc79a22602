"""What the drive does beyond single dialogues (Cassinis, "Firmware" and "Additional features")."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.assembler import ImageError
from detent.axis import MotionEnded, MotionStarted
from detent.controllers.device import Refused
from detent.controllers.supersigma import commands
from detent.controllers.supersigma.firmware import Supersigma
from detent.controllers.supersigma.link import answers
from detent.pins import PinSet
from detent.ramps.differences import PAPER
from detent.ramps.short_movements import movement
from detent.ramps.ways import Way
from detent.ticks import MS, SECOND, Ns
from detent.uart import Char, Sent


class Bench:
    """A drive without line timing, and what it did."""

    def __init__(self, **options: object) -> None:
        self.drive = Supersigma(line_timing=False, **options)  # type: ignore[arg-type]
        self.now: Ns = 0
        self.out: list[object] = []
        self.drive.power(True, 0)
        self.collect()

    def collect(self) -> None:
        self.out += self.drive.drain()

    def to(self, now: Ns) -> None:
        while (at := self.drive.next_deadline()) is not None and at <= now:
            self.drive.advance(at)
            self.collect()
        self.now = now

    def rest(self) -> None:
        while (at := self.drive.next_deadline()) is not None:
            self.to(at)

    def say(self, text: str) -> None:
        self.drive.receive("BUS", [Char(value) for value in self.drive.frame(text)], self.now)
        self.collect()

    def pin(self, name: str, level: int) -> None:
        self.drive.set_pin(name, level, self.now)
        self.collect()

    def ask(self) -> str:
        before = len(self.out)
        self.say("status")
        sent = bytes(item.char.value for item in self.out[before:] if isinstance(item, Sent))
        (answer,) = answers(sent)
        return answer

    def all(self, kind: type) -> list:  # type: ignore[type-arg]
        return [item for item in self.out if isinstance(item, kind)]

    @property
    def position(self) -> int:
        return self.drive.status(self.now).position


@pytest.mark.parametrize("way", Way)
@pytest.mark.parametrize("steps", [1, 2, 10, 403, 404, 777, 5143, 5144, 30_000, 65_535])
def test_a_move_gives_exactly_its_steps(way: Way, steps: int) -> None:
    bench = Bench(short=way)
    for text, sign in ((f"move {steps:+d}", 1), (f"move {-steps:+d}", -1)):
        before = bench.position
        bench.say(text)
        assert bench.drive.status(bench.now).state == "running"
        bench.rest()
        assert bench.position - before == sign * steps
        assert bench.ask() == f"{steps} steps"
    assert bench.all(MotionStarted)[0].train.segments == movement(PAPER, steps, 10, way, 232).train.segments


def test_speed_bytes_are_units_of_100_half_steps_a_second() -> None:
    bench = Bench()
    bench.say("constant +1000 6")
    bench.rest()
    assert bench.now == 1000 * 3333 * 500  # N = INT(2e6 / 600 - 1 + 0.5) = 3332


@settings(deadline=None, max_examples=examples(80))
@given(st.integers(1, 20_000), st.sampled_from(list(Way)), st.floats(0, 1.2), st.sampled_from(["stop", "emergency"]))
def test_status_tells_the_steps_done_after_a_stop_anywhere(steps: int, way: Way, part: float, word: str) -> None:
    bench = Bench(short=way)
    bench.say(f"move -{steps}")
    full = bench.all(MotionStarted)[0].train.duration
    bench.to(int(full * part))
    bench.say(word)
    bench.rest()
    assert bench.ask() == f"{-bench.position} steps"
    assert -bench.position <= steps
    given = bench.all(MotionStarted)[-1].train.times()
    if len(given) > 1 and -bench.position < steps:
        assert given[-1] - given[-2] >= 3077 * 500  # the last step at low speed or less


def test_an_emergency_input_brakes_at_the_instant_it_becomes_active_and_status_tells_it() -> None:
    for pin, word in (("RAIL", "end of rail"), ("FORCE", "excessive force")):
        bench = Bench()
        bench.say("move +30000")
        bench.to(1 * SECOND)
        bench.pin(pin, 0)
        assert bench.drive.status(bench.now).state == "braking"
        bench.rest()
        assert 1 * SECOND < bench.now < 1 * SECOND + 80 * MS  # a quarter of 0.3 s, and a step at low speed
        assert bench.ask() == f"{bench.position} steps, {word}"
        bench.say("move -100")  # away from it, with the input still active
        bench.rest()
        assert bench.ask() == "100 steps"


def test_braking_can_be_chosen() -> None:
    took = {}
    for braking in (1, 4, 10):
        bench = Bench(braking=braking)
        bench.say("move +30000")
        bench.to(1 * SECOND)
        bench.say("emergency")
        bench.rest()
        took[braking] = bench.now - 1 * SECOND
    assert took[1] == pytest.approx(300 * MS, rel=0.02)
    assert took[4] == pytest.approx(75 * MS, rel=0.03)
    assert took[10] == pytest.approx(30 * MS, rel=0.1)


def test_origination_goes_back_to_the_switch_and_forward_until_it_is_released() -> None:
    bench = Bench()
    bench.say("originate")
    bench.to(100 * MS)
    bench.pin("RAIL", 0)
    back = bench.drive.status(bench.now).pulses
    bench.to(200 * MS)
    bench.pin("RAIL", 1)
    assert back == 64
    assert bench.drive.status(bench.now) == (0, 128, "ready")
    assert bench.ask() == "64 steps, originated"
    assert bench.drive.next_deadline() is None


def test_the_end_of_the_rail_does_not_brake_an_origination_but_force_does() -> None:
    bench = Bench()
    bench.say("originate")
    bench.to(100 * MS)
    bench.pin("FORCE", 0)
    bench.rest()
    assert bench.ask() == "65 steps, excessive force"
    bench.pin("FORCE", 1)
    bench.pin("RAIL", 0)
    bench.say("originate")  # already at the switch: forward at once
    assert bench.all(MotionStarted)[-1].direction == 1
    bench.pin("RAIL", 1)
    assert bench.ask() == "0 steps, originated"


def test_a_new_origination_forgets_the_origin_until_it_is_found() -> None:
    bench = Bench()
    bench.pin("RAIL", 0)
    bench.say("originate")
    bench.pin("RAIL", 1)
    bench.say("move +10")
    bench.rest()
    assert bench.ask() == "10 steps, originated"
    bench.say("originate")
    assert bench.ask() == "0 steps, moving"
    bench.say("stop")
    bench.rest()
    assert bench.ask() == "1 steps"


@pytest.mark.parametrize("text", ["move +0", "constant +10 0", "limit +0 5", "constant +0 0", "00", "08", "7f", "ff"])
def test_what_makes_no_sense_is_refused_and_changes_nothing_else(text: str) -> None:
    bench = Bench()
    bench.say(text)
    assert bench.drive.next_deadline() is None
    assert len(bench.all(Refused)) == 1
    assert bench.ask() == "0 steps, refused"
    bench.say("move +1")
    bench.rest()
    assert bench.ask() == "1 steps"


def test_a_move_while_moving_is_refused_and_the_first_goes_on() -> None:
    bench = Bench()
    bench.say("move +500")
    for text in ("move +1", "constant +1 1", "limit +1 1", "originate"):
        bench.say(text)
    assert bench.ask() == "0 steps, moving, refused"
    bench.rest()
    assert bench.ask() == "500 steps, refused"
    assert len(bench.all(MotionEnded)) == 1


def test_status_lines_tell_of_movement_and_of_what_wants_attention() -> None:
    bench = Bench()
    bench.say("move +0")
    bench.say("move +1")
    bench.rest()
    edges = [
        (item.pin, item.level) for item in bench.all(PinSet) if item.pin in ("P23", "P24") and (item.level or item.at)
    ]
    assert edges == [("P24", 1), ("P23", 1), ("P23", 0)]
    assert bench.all(PinSet)[-1].at == 3077 * 500


def test_without_supply_it_neither_hears_nor_moves_and_afterwards_knows_nothing() -> None:
    bench = Bench()
    bench.say("move +5000")
    bench.to(100 * MS)
    bench.drive.power(False, bench.now)
    bench.collect()
    assert bench.drive.next_deadline() is None
    bench.say("move +100")
    bench.pin("FORCE", 0)
    assert bench.drive.status(bench.now).state == "off"
    bench.drive.power(True, bench.now)
    bench.collect()
    assert bench.ask() == "0 steps"
    assert bench.position == 0


def test_a_message_is_not_kept_over_a_power_failure() -> None:
    bench = Bench()
    bench.drive.receive("BUS", [Char(1), Char(1), Char(0)], bench.now)
    bench.drive.power(False, bench.now)
    bench.drive.power(True, bench.now)
    assert bench.ask() == "0 steps"


def test_it_has_no_memory_for_programs() -> None:
    drive = Supersigma()
    for action in (lambda: drive.restore(b""), lambda: drive.load(b"", 0, 0)):
        with pytest.raises(ImageError, match="holds no programs"):
            action()


def test_a_copy_in_the_middle_of_a_ramp_goes_on_alike() -> None:
    bench = Bench()
    bench.say("move +9000")
    bench.to(150 * MS)
    twin = copy.deepcopy(bench)
    for one in (bench, twin):
        one.say("emergency")
        one.rest()
    assert bench.out == twin.out
    assert bench.position == twin.position


@settings(deadline=None, max_examples=examples(200))
@given(
    st.lists(
        st.one_of(st.binary(max_size=5), st.sampled_from([b"\x01\x05", b"\x01\x01\x00\x05", b"\x01\x06"])), max_size=20
    )
)
def test_garbage_never_crashes_and_the_bus_comes_back(pieces: list[bytes]) -> None:
    bench = Bench()
    for piece in pieces:
        bench.drive.receive("BUS", [Char(value) for value in piece], bench.now)
        bench.to(bench.now + 10 * MS)
    # no message is longer than five bytes, and zeros are messages of two to a drive that is not there
    stream = b"".join(pieces)
    at = 0
    while at < len(stream):
        at += commands.length(stream[at + 1]) if at + 1 < len(stream) else 2
    bench.drive.receive("BUS", [Char(0)] * (at - len(stream)), bench.now)
    bench.say("emergency")
    bench.to(bench.now + SECOND)
    assert "moving" not in bench.ask()
