"""The DCB-274's driver against the emulated controller in virtual time, at 9600 baud (page 12)."""

from collections.abc import Callable

import pytest
from tests.hosts.dcb274_units import alone, cell_of, driven, three

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.axis import Limits, Speeds
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.dcb274.answers import Listed
from detent.hosts.errors import Busy, DriverError, MotionFailed, NoAnswer, Refused

SWITCHES = """
[switches.home]
drives = ["unit.HOME"]
axis = "unit"
to = -200
[switches.plus]
drives = ["unit.LIMIT-A"]
axis = "unit"
from = 5000
[switches.minus]
drives = ["unit.LIMIT-B"]
axis = "unit"
to = -900
"""


def test_every_call_of_single_mode() -> None:
    cell, unit = alone()
    assert unit.connect() == "V1.10"
    assert unit.examine()[:7] == (5, 5, 802, 10370, 1, "1/4", "A")
    unit.initial_velocity(400)
    unit.slew_velocity(5000)
    unit.ramp_slope(50, 5)
    unit.divide(2)
    unit.jog_speeds(30, 100)
    unit.decay(255)
    unit.currents(10, 80)
    unit.pre_energize(0.25)
    unit.resolution(2)
    unit.set_options(32)
    assert unit.options() == 32
    assert unit.examine() == (50, 5, 400, 5185, 2, "1/2", "A", 255, True, 32)
    unit.outputs(24)
    assert unit.ports() == (False, False, False, True)
    assert unit.inputs() == (False, False, False, True, True, False, False, False)
    unit.outputs(0)
    assert unit.jog_inputs() == (False, False, False)
    unit.set_position(-700)
    assert unit.position() == -700
    unit.trip(100, 160)
    unit.save()
    unit.reload()
    assert unit.read_memory(229) == b"\x02"
    unit.write_memory(1000, 17)
    assert unit.read_memory(999, 3) == b"\xff\x11\xff"
    assert unit.clear(4) == "V1.10"
    assert unit.read_memory(1000) == b"\xff"
    assert unit.clear(1) == "V1.10"
    assert unit.examine()[:7] == (5, 5, 802, 10370, 1, "1/4", "A")
    assert unit.command("E 9") == ""
    unit.store_name("Q")
    unit.reset()
    assert unit.sign_on() == "V1.10"
    assert unit.name == "Q"
    assert unit.sign_on("R") == "V1.10"
    assert unit.examine().name == "R"
    unit.party_line()
    assert driven(unit.port, "Q", "party")[0].model_number() == 26
    assert cell.now < 10 * 10**9


def test_moves_begin_and_return_and_the_next_one_waits_its_turn() -> None:
    cell, unit = alone()
    unit.move_to(1000)
    assert unit.moving()
    assert unit.moving_status() == 1
    unit.move_by(-300)
    unit.move_by(-50)
    unit.wait()
    assert unit.position() == 650
    unit.run_at(-3000)
    assert unit.moving_status() == 3
    unit.stop()
    unit.wait()
    assert unit.position() < 650
    unit.move_to(0)  # behind M at once: the unit ramps to rest first
    unit.wait()
    assert unit.position() == 0
    unit.run_at(2000)
    unit.halt()
    assert not unit.moving()
    unit.delay(0.5)
    assert unit.position() == cell.controllers()["unit"].status(cell.now).position


def test_an_index_that_a_limit_has_cut_is_told() -> None:
    _, unit = alone(SWITCHES)
    unit.move_to(6000)
    with pytest.raises(MotionFailed, match="stands at 5000, not at 6000: limit A is met"):
        unit.wait()
    assert unit.limits() == Limits(low=False, high=True)
    unit.move_by(-10)
    unit.wait()
    assert unit.position() == 4990


def test_homing_by_the_switch_and_past_a_limit() -> None:
    cell, unit = alone(SWITCHES)
    unit.home()
    unit.wait()
    assert cell.controllers()["unit"].status(cell.now).position == -199  # the first step at which it is high again
    unit.set_position(0)
    unit.move_to(100)
    unit.wait()
    _, lost = alone(SWITCHES.replace("to = -200", "to = -2000"))
    lost.home(-1)
    with pytest.raises(MotionFailed, match="met limit B before the home switch"):
        lost.wait()


@pytest.mark.parametrize("divisor", [37, 41, 42, 255])
def test_home_is_searched_for_whatever_divides_the_speeds(divisor: int) -> None:
    """Page 37: D divides all speeds, and 36 000 steps/s, of which the unit makes 41 480 (page 65), are the most."""
    cell, unit = alone(SWITCHES)
    unit.divide(divisor)
    unit.home()
    unit.wait(60)
    assert cell.controllers()["unit"].status(cell.now).position == -199


def test_speeds_are_those_of_the_motor_whatever_divides_them() -> None:
    cell, unit = alone()
    made = unit.set_speeds(Speeds(20, 2000, 1.0))
    assert made.start == pytest.approx(20, rel=0.02)
    assert made.slew == pytest.approx(2000, rel=0.02)
    assert made.seconds == pytest.approx(1.0, rel=0.05)
    begun = cell.now
    unit.move_by(4000)
    unit.wait()
    assert 4000 / 2000 + 1.0 < (cell.now - begun) / 1e9 < 4000 / 2000 + 2.0
    unit.run_at(-500)
    unit.port.wait(3)
    before = unit.position()
    unit.port.wait(1)
    assert unit.position() - before == pytest.approx(-500, rel=0.05)


def test_programs_are_stored_listed_run_traced_and_ended() -> None:
    _, unit = alone()
    lines = ["O 0", "R 400", "W 8", "Z", "P 256", "M 1000", "L 2048 0", "@"]
    assert unit.write_program(lines)[-1] == Listed(263, "@")
    assert unit.listing(256).end == 264
    assert unit.read_program(0) == ["P 0", "O 0", "R 400", "W 8", "Z 0"]
    assert unit.read_program()[:5] == ["P 0", "O 0", "R 400", "W 8", "Z 0"]
    assert unit.read_program()[-4:] == ["P 256", "M 1003", "L 2048 0", "@"]
    assert unit.trace(0) == ["0 O 0", "4 R 400", "8 W 8", "11 Z 0", "      400"]
    unit.go(0)
    unit.wait()
    assert [line.strip() for line in unit.printed()] == ["400"]
    unit.go(256)
    assert unit.moving()
    with pytest.raises(Busy, match="runs a program and takes no line"):
        unit.position()
    unit.stop()
    unit.wait()
    assert unit.position() > 400
    unit.go(256)
    unit.halt()
    assert not unit.moving()
    with pytest.raises(Refused, match="new instructions stand at 0 to 3, an end mark at 4"):
        unit.write_program(["+ 5", "A 130"])
    assert unit.read_program(0) == ["P 0", "+ 5"]
    unit.write_program(["@"] * 45)
    assert unit.listing(0).end == 45


def test_what_is_left_behind_an_end_mark_is_a_program_only_where_a_jump_leads_to_it() -> None:
    _, unit = alone()
    unit.write_program(["W 1", "W 2", "W 3", "W 4"], 300)
    unit.write_program(["W 9"], 300)
    assert unit.read_program()[-2:] == ["P 300", "W 9"]
    assert unit.left_over == "304-311"
    unit.write_program(["J 306 0"], 400)
    assert unit.read_program()[-7:] == ["P 300", "W 9", "P 306", "W 3", "W 4", "P 400", "J 306 0"]
    assert unit.left_over == "304-305"


def test_a_unit_that_lost_its_supply_in_a_move_is_told_and_signed_on_again() -> None:
    cell, unit = alone()
    unit.move_by(20_000)
    assert unit.moving()
    cell.power("unit", False)
    with pytest.raises(NoAnswer):
        unit.moving()
    cell.power("unit", True)
    with pytest.raises(MotionFailed, match="was switched off and on, or reset: it is at 0"):
        unit.wait()
    unit.wait()
    unit.move_by(10)
    unit.wait()
    assert unit.position() == 10


def test_a_program_that_somebody_else_has_started_is_stopped_and_not_taken_for_a_dead_line() -> None:
    cell, unit = alone()
    unit.write_program(["M 1000", "L 2048 0"])
    cell.controllers()["unit"].start(cell.now)
    unit.port.wait(0.5)
    unit.stop()
    unit.wait()
    assert 0 < unit.position() < 2000


def test_positions_are_followed_while_they_change() -> None:
    _, unit = alone()
    unit.move_by(500)
    seen = unit.follow(0.3)
    assert seen == sorted(seen)
    assert seen[-1] == 500
    assert len(set(seen)) > 5
    assert unit.position() == 500


def test_continuous_reports_of_another_host_do_not_disturb_the_sign_on() -> None:
    cell, unit = alone()
    unit.command("Z 1")
    unit.run_at(500)
    other = BlockingDcb274(Dcb274(), HostPort(cell))
    assert other.examine().name == "A"
    assert other.position() > 0
    assert cell.controllers()["unit"].status(cell.now).state == "moving"


def test_a_half_typed_line_is_taken_back_and_program_mode_is_left_alone() -> None:
    cell, unit = alone()
    unit.connect()
    unit.port.write(b"+100")
    unit.port.wait(0.1)
    other = BlockingDcb274(Dcb274(), HostPort(cell))
    assert other.position() == 0
    other.command("P 300")
    with pytest.raises(Refused, match="is in program mode"):
        BlockingDcb274(Dcb274(), HostPort(cell)).connect()
    other.abort()
    assert other.read_memory(300, 4) == b"\xff" * 4


def test_a_unit_that_was_switched_off_and_on_keeps_its_name() -> None:
    """Page 23: before SPACE any character is a name. A line typed to a unit that waits must not rename it."""
    cell, unit = alone()
    unit.move_to(50)
    unit.wait()
    device = cell.controllers()["unit"]
    device.power(False, cell.now)
    device.power(True, cell.now)
    with pytest.raises(NoAnswer):
        unit.position()
    assert unit.position() == 0
    assert unit.examine().name == "A"


def test_three_axes_of_a_party_line_share_a_port() -> None:
    cell, port = three()
    x, y, z = driven(port, "XYZ", "party")
    x.move_to(1000)
    y.move_by(-500)
    z.run_at(2000)
    assert z.moving()
    z.stop()
    for unit in (x, y, z):
        unit.wait()
    assert [unit.position() for unit in (x, y)] == [1000, -500]
    assert (x.model_number(), x.inputs().p1, x.options()) == (26, False, 0)
    x.write_program(["M 1000", "L 2048 0"])
    x.go()
    assert x.moving()
    y.move_to(0)
    y.wait()
    with pytest.raises(Busy, match="runs a program"):
        x.position()
    x.stop()
    x.wait()
    x.go()
    y.run_at(1000)
    x.halt()  # of X alone
    assert (x.moving(), y.moving()) == (False, True)
    y.abort()
    assert not y.moving()
    with pytest.raises(NoAnswer, match="is not on the line"):
        driven(port, "Q", "party")[0].position()
    before = x.position()
    port.write(b"\nX+55")  # a host that went away in the middle of a line
    port.wait(0.1)
    assert driven(port, "X", "party")[0].position() == before
    assert cell.now < 20 * 10**9


def test_a_daisy_chain_gets_its_names_and_then_is_a_party_line() -> None:
    _, port = three(party=False, kind='kind = "daisy-chain"\n')
    a, b, c, d = driven(port, "ABCD", "daisy", "A")
    b.move_to(100)  # names are given first
    b.wait()
    assert [unit.position() for unit in (a, b, c)] == [0, 100, 0]
    with pytest.raises(NoAnswer, match="is not in the chain, whose first axis is A"):
        d.position()
    b.write_program(["M 1000", "L 2048 0"])
    b.go()
    assert (a.moving(), b.moving()) == (False, True)
    b.stop()
    b.wait()
    before = b.position()
    port.write(b"B+55")  # a host that went away in the middle of a line
    port.wait(0.1)
    assert driven(port, "B", "daisy", "A")[0].position() == before
    b.abort()
    assert a.name_chain() == ("A", "B", "C")
    assert b.position() == 0


def test_a_sin_10_is_scanned_once_and_spools() -> None:
    _, port = three("sin-10", party=False)
    x, y, z, q = driven(port, "XYZQ", "sin10")
    x.move_to(1000)
    y.move_by(-500)
    z.run_at(2000)
    assert z.moving()
    z.stop()
    for unit in (x, y, z):
        unit.wait()
    assert [unit.position() for unit in (x, y)] == [1000, -500]
    assert x.spool(["X+1000", "Y+1000", "9W*", "XZ", "YZ"])[2:] == ["9W*", "XZ     2000", "YZ      500"]
    assert (
        x.read_memory(0, 40) == b"\xeb\xe9\x03\x00\x17d\x00\xed\xe8\x03\x00\x17d\x00\x1a\x00\x07\x00\x00" + b"\xff" * 21
    )
    x.write_program(["M 1000", "L 2048 0"])
    x.go()
    assert x.moving()
    x.stop()
    x.wait()
    x.go()
    y.run_at(1000)
    x.halt()  # of X alone
    assert (x.moving(), y.moving()) == (False, True)
    place = x.position()
    with pytest.raises(NoAnswer, match="is not known to the adapter, which knows X, Y, Z"):
        q.position()
    assert x.position() == place > 2000  # nobody was reset
    assert x.scan() == "XYZ"
    assert x.position() == 0


def test_a_sin_8_is_a_party_line() -> None:
    _, port = three("sin-8", party=False)
    (x,) = driven(port, "X", "party")
    x.move_to(10)
    x.wait()
    assert x.position() == 10


class Noisy(HostPort):
    """Loses or damages the character number `place` that is sent, or that comes."""

    place, outward, lost = -1, True, True

    def write(self, data: bytes) -> int:
        if self.outward:
            data = self._through(data)
        return super().write(data) if data else 0

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        return data if self.outward else self._through(data)

    def _through(self, data: bytes) -> bytes:
        passed = b""
        for value in data:
            if self.place == 0:
                passed += b"" if self.lost else bytes((value ^ 0x08,))
            else:
                passed += bytes((value,))
            self.place -= 1
        return passed


@pytest.mark.parametrize("lost", [True, False])
@pytest.mark.parametrize("outward", [True, False])
@pytest.mark.parametrize("party", [True, False])
def test_a_character_that_is_lost_or_damaged_never_makes_another_move(party: bool, outward: bool, lost: bool) -> None:
    """Page 25: the handshake by echo finds it before the line is complete. Only behind its end a line may fail."""
    wanted, failed = 12_345, []
    for place in range(8):
        if party:
            cell = cell_of('[units.unit]\nmodel = "dcb-274"\nstraps = { PARTY = "high" }\n')
            port = Noisy(cell)
            unit = BlockingDcb274(Dcb274("A", mode="party"), port)
        else:
            cell, unit = alone(port=Noisy)
            port = unit.port
        unit.connect()
        port.outward, port.lost, port.place = outward, lost, place
        try:
            unit.command(f"R{wanted}")
        except (NoAnswer, Refused):
            failed.append(place)
        unit.wait()
        assert unit.position() in ((0, wanted) if place in failed else (wanted,))
    assert all(place >= 6 for place in failed)  # R, five figures: what is behind them ends the line


class Interrupted(HostPort):
    """The user presses ^C when the write number `left` of a figure is due."""

    left = 0

    def write(self, data: bytes) -> int:
        self.left -= data.isdigit()
        if self.left == 0 and data.isdigit():
            raise KeyboardInterrupt
        return super().write(data)


@pytest.mark.parametrize("party", [True, False])
def test_a_stop_behind_a_call_that_was_interrupted_in_the_middle_of_its_line_is_a_stop(party: bool) -> None:
    """Half a line stands in the unit then: @ behind it would be no command, and a LF would carry it out (page 25)."""
    cell, unit = alone('straps = { PARTY = "high" }\n' * party, port=Interrupted)
    if party:
        unit = BlockingDcb274(Dcb274("A", mode="party"), unit.port)
    unit.run_at(1000)
    unit.port.left = 3
    with pytest.raises(KeyboardInterrupt):
        unit.command("R123456")
    unit.stop()
    unit.wait(timeout=5)
    assert 0 < unit.position() < 5000
    assert cell.controllers()["unit"].status(cell.now).state == "ready"


@pytest.mark.parametrize(
    "call", [lambda unit: unit.move_to(1), lambda unit: unit.go(), lambda unit: unit.set_position(5)]
)
def test_every_call_signs_on_by_itself(call: Callable[[BlockingDcb274], object]) -> None:
    _, unit = alone()
    call(unit)
    assert unit.name == "A"


def test_program_mode_that_was_left_open_is_ended_by_a_line() -> None:
    """Page 47: "entering the second P command will terminate the PROGRAM mode"; each call may be another host's."""
    cell, unit = alone()
    unit.command("P 300")
    other = BlockingDcb274(Dcb274(), HostPort(cell))
    assert other.command("A 8") == ""
    third = BlockingDcb274(Dcb274(), HostPort(cell))
    assert third.command("P") == ""
    assert third.read_program(300) == ["P 300", "A 8"]


def test_esc_before_the_sign_on_is_obeyed_and_no_failure() -> None:
    """Pages 31 and 33: a program at 1600 runs, and nobody has typed SPACE."""
    cell, unit = alone()
    unit.write_program(["M 1000", "L 2048 0"], 1600)
    unit.reset()
    other = BlockingDcb274(Dcb274(), HostPort(cell))
    other.port.wait(0.5)
    assert cell.controllers()["unit"].status(cell.now).state == "running"
    other.abort()
    assert cell.controllers()["unit"].status(cell.now).state == "ready"


class Damaging(HostPort):
    """A port that changes a bit of one character, on its way out or on its way back."""

    def __init__(self, cell: Cell, out: int, back: int, bit: int) -> None:
        super().__init__(cell)
        self.out, self.back, self.bit = out, back, bit

    def write(self, data: bytes) -> None:
        super().write(bytes(value ^ (self._due("out") << self.bit) for value in data))

    def receive(self, timeout: float) -> bytes:
        return bytes(value ^ (self._due("back") << self.bit) for value in super().receive(timeout))

    def _due(self, way: str) -> int:
        setattr(self, way, getattr(self, way) - 1)
        return int(getattr(self, way) == -1)


@pytest.mark.parametrize("way", ["stop", "halt"])
@pytest.mark.parametrize("mode", ["single", "party"])
@pytest.mark.parametrize("fresh", [False, True])
def test_a_stop_that_returns_has_stopped_the_axis_whatever_bit_was_changed(mode: str, fresh: bool, way: str) -> None:
    for place in range(4 if fresh else 3):
        for bit in range(8):
            for out in (True, False):
                strap = 'straps = { PARTY = "high" }\noptions = { name = "X" }\n' if mode == "party" else ""
                made = build(parse(f'[units.unit]\nmodel = "dcb-274"\n{strap}', "cell"), str)
                first = BlockingDcb274(Dcb274("X", mode=mode), HostPort(made))
                first.run_at(300)
                far = 14 if fresh and mode == "party" else 0  # behind what spoils the line
                port = Damaging(made, place + far if out else 999, 999 if out else place, bit)
                unit = BlockingDcb274(Dcb274("X", mode=mode), port) if fresh else first
                unit.port = port
                try:
                    getattr(unit, way)()
                except DriverError:
                    continue
                made.run_to(made.now + 5_000_000_000)
                status = made.controllers()["unit"].status(made.now, "")
                assert status.state in ("ready", "programming", "sign on"), (place, bit, out)
                before = status.pulses
                made.run_to(made.now + 5_000_000_000)
                assert made.controllers()["unit"].status(made.now, "").pulses == before, (place, bit, out)
