"""The check of a machine's wiring: inputs live, jogs that stop in the board, and nothing that moves unasked."""

from collections.abc import Callable
from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Wire, no_file
from tests.realtime.boards.test_currents import GENSTEPPER, HALF
from tests.realtime.boards.test_real_service import Wall

from detent.cell.build import build
from detent.cell.description import Problem, parse
from detent.realtime.boards.checking import LEAD, Check, Leg, Trouble
from detent.realtime.boards.drive import Opened, RealPins
from detent.realtime.boards.equipment import Equipment
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chips
from detent.realtime.boards.fake.machine import Machine, MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.plan import plan
from detent.ticks import MS, Ns

CELL = """
[units.x]
model = "gs-c200"
[boards.b]
serial = "fake:"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
inputs = { EOT = "^gpio10", HOME = "^gpio11", UI1 = "^!gpio12" }
"""


class Busy(Wall):
    """A host that is elsewhere now and then."""

    def __init__(self, away: Callable[[bool], Ns]) -> None:
        super().__init__()
        self._away = away

    def look(self, writing: bool = False) -> Ns:
        self.now += self._away(writing)
        return self.now

    __call__ = look


class Bench:
    """A cell whose machine has a step counter and, if asked, an end of travel from `closed` on."""

    def __init__(
        self, text: str = CELL, closed: int | None = None, chips: bool = True, away: Callable[[bool], Ns] | None = None
    ) -> None:
        """`away`: for how long the computer is elsewhere, at each look at its clock, and (True) within each write."""
        switches = [] if closed is None else [MachineSwitch("x", "gpio10", closed, 10**6, inside=False)]
        self.machine = Machine(axes={"x": MachineAxis("gpio2", "gpio3")}, switches=switches)
        self.fake = FakeBoard(self.machine, moves=400)
        self.fake.chips = Chips() if chips else {}
        self.wall = Wall() if away is None else Busy(away)
        self.port: FakePort = Wire(
            self.fake, lambda: self.wall.now if away is None else self.wall.look(True), lambda: self.wall.now
        )
        described = parse(text, "cell.toml")
        real = RealPins(lambda news: None, lambda _: self.port, self.wall, self.wall.sleep)
        self.check = Check(Opened(described, no_file, real), described)
        self.axis = self.check.plan.axes[0]

    def press(self, pin: str, level: bool) -> None:
        self.machine.set(pin, level, self.fake.now)

    def jog(self, steps: int = 100, rate: int = 200) -> list[Leg]:
        return list(self.check.jog(self.axis, steps, rate))

    def settle(self) -> None:
        for _ in range(20):
            self.check.turn(5 * MS)


def test_a_check_has_time_as_far_as_watchdogs_let_it() -> None:
    """A lead of 200 ms, so that a busy computer is not late; a quarter of the shortest watchdog where that is less."""
    for text, lead in ((CELL, 200), (CELL.replace('"fake:"', '"fake:"\nwatchdog = "400 ms"'), 100)):
        described = parse(text, "cell.toml")
        controllers = build(described, no_file).controllers()
        assert plan(described, controllers, LEAD).setups[0][0].lead == lead * MS
        assert plan(described, controllers).setups[0][0].lead == 30 * MS


def test_nothing_moves_and_no_driver_is_on_while_inputs_are_looked_at() -> None:
    bench = Bench()
    bench.settle()
    bench.press("gpio12", False)
    bench.settle()
    bench.press("gpio12", True)
    bench.settle()
    seen = {put.pin: (put.level, put.changes, put.wire) for put in bench.check.inputs({})}
    assert seen == {"EOT": (1, 0, "^gpio10"), "HOME": (1, 0, "^gpio11"), "UI1": (0, 2, "!^gpio12")}
    assert bench.machine.steps == []
    assert bench.machine.outputs["gpio4"] is True  # active low: off


def test_a_jog_goes_there_and_back_and_lets_the_driver_go() -> None:
    bench = Bench()
    assert bench.jog() == [Leg(1, 100, 100, (), ""), Leg(-1, 100, 100, (), "")]
    assert [place for *_, place in bench.machine.steps] == [*range(1, 101), *range(99, -1, -1)]
    enabled = [level for _, pin, level in bench.machine.edges if pin == "gpio4"]
    assert enabled == [True, False, True]  # on before the first step, off behind the last
    on = next(tick for tick, pin, level in bench.machine.edges if pin == "gpio4" and not level)
    assert on < bench.machine.steps[0][0]
    assert bench.jog()[1].made == 100  # and once more


@pytest.mark.parametrize("seed", seeds(8))
def test_a_computer_that_is_busy_makes_no_check_fail(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is elsewhere while it makes a batch, for longer than a batch may be late."""
    random, bench = Random(seed), Bench(TMC if seed % 2 else CELL)
    stalls = 0

    def busy(work: Callable[..., bool]) -> Callable[..., bool]:
        def works(*given: object) -> bool:
            nonlocal stalls
            waits = work(*given)
            if random.random() < 0.1:
                bench.wall.now += random.randrange(60 * MS)
                stalls += 1
            return waits

        return works

    monkeypatch.setattr(Equipment, "commit", busy(Equipment.commit))
    monkeypatch.setattr(Equipment, "feed", busy(Equipment.feed))
    out, back = bench.jog(60, 400)
    assert (out.made, back.made) == (60, 60)
    assert bench.machine.axes["x"].position == 0
    assert bench.fake.reason is None
    assert stalls > 3


def stalled(seed: int) -> tuple[int, int]:
    """A jog by a computer that is away at any time, also within a write: stalls, and whether the board gave up.

    All its steps are made, a switch stops it where it closes, and it comes back to where it began; or, where something
    came too late that has a time and no step before it, that is told and nothing moves any more.
    """
    random, on = Random(seed), [False]
    chance, longest = random.choice([0.005, 0.02]), random.choice([60, 250, 600]) * MS
    stalls = 0

    def away(writing: bool) -> Ns:
        nonlocal stalls
        if not on[0] or random.random() >= chance:
            return 0
        stalls += 1
        return random.randrange(longest)

    closed = random.choice([None, random.randrange(5, 60)])
    bench = Bench(TMC if seed % 3 == 0 else CELL, closed=closed, away=away)
    assert isinstance(bench.port, Wire)
    bench.port.spare_exposed = random.random() < 0.7
    on[0] = True
    steps, rate = random.randrange(20, 120), random.randrange(100, 900)
    made = steps if closed is None else min(steps, closed)
    legs, trouble = [], ""
    try:
        legs = bench.jog(steps, rate)
    except Trouble as told:
        trouble = str(told)
    if trouble:
        assert "shut down: Timer too close" in trouble
        assert not bench.port.spare_exposed
        on[0] = False
        bench.port.run_to(bench.wall.now + 500 * MS)
        assert bench.machine.outputs["gpio4"] is True
        assert all(place <= made for *_, place in bench.machine.steps)
        return stalls, 1
    assert [leg.made for leg in legs] == [made, made]
    assert [place for *_, place in bench.machine.steps] == [*range(1, made + 1), *range(made - 1, -1, -1)]
    assert bench.fake.reason is None
    return stalls, 0


def test_a_stall_makes_no_check_fail_or_tell_what_is_not_so() -> None:
    assert sum(stalled(seed)[0] for seed in range(12)) > 12


@pytest.mark.slow
def test_stalls_at_any_time_in_many_checks() -> None:
    counts = [stalled(seed) for seed in range(100, 500)]
    assert sum(down for _, down in counts) < 40


def test_a_switch_stops_it_in_the_board_and_the_way_back_ends_where_it_began() -> None:
    bench = Bench(closed=40)
    out, back = bench.jog()
    assert (out.made, out.why) == (40, "x.EOT changed to 0")
    assert [(met.input, met.level, met.steps) for met in out.met] == [("x.EOT", 0, 40)]
    assert (back.made, back.asked, back.why) == (40, 40, "")
    assert bench.machine.axes["x"].position == 0
    assert max(place for *_, place in bench.machine.steps) == 40


@pytest.mark.parametrize("pin", ["gpio10", "gpio11", "gpio12"])
def test_a_hand_on_any_input_of_the_unit_stops_it(pin: str) -> None:
    bench = Bench()

    def hand() -> bool:
        if len(bench.machine.steps) == 30:
            bench.press(pin, not bench.machine.level(pin))
        return False

    out = next(bench.check.jog(bench.axis, 100, 200, hand))
    assert out.why.startswith("x.")
    assert out.made == len(bench.machine.steps) <= 31


@pytest.mark.parametrize("pin", ["gpio10", "gpio12"])
def test_a_touch_that_is_over_before_the_first_step_stops_it_too(pin: str) -> None:
    """What stops it comes into force with the first step, a lead after the jog began."""
    bench = Bench()
    began: list[Ns] = []

    def hand() -> bool:
        began.append(bench.wall.now)
        since = bench.wall.now - began[0]
        level = bench.machine.level(pin)
        if not bench.machine.steps and level is (since < 10 * MS):
            bench.press(pin, not level)
        return False

    out = next(bench.check.jog(bench.axis, 100, 200, hand))
    assert (out.made, len(bench.machine.steps)) == (0, 0)
    assert out.why == ("x.EOT changed to 0" if pin == "gpio10" else "x.UI1 changed to 1")


def test_stopped_by_hand_every_board_is_shut_down_at_once() -> None:
    bench = Bench()
    with pytest.raises(Trouble, match="stopped by hand"):
        list(bench.check.jog(bench.axis, 100, 200, lambda: len(bench.machine.steps) >= 30))
    bench.port.run_to(bench.wall.now + 500 * MS)
    assert len(bench.machine.steps) == 30
    assert bench.fake.reason is not None
    assert bench.machine.outputs["gpio4"] is True  # the driver is off


def test_whoever_leaves_in_the_middle_leaves_nothing_moving() -> None:
    bench = Bench()

    def interrupted() -> bool:
        if len(bench.machine.steps) >= 10:
            raise KeyboardInterrupt
        return False

    with pytest.raises(KeyboardInterrupt):
        list(bench.check.jog(bench.axis, 100, 200, interrupted))
    bench.port.run_to(bench.wall.now + 500 * MS)
    assert len(bench.machine.steps) == 10
    assert bench.fake.reason is not None


def test_an_unplugged_board_is_said_in_a_line() -> None:
    bench = Bench()
    bench.port.unplugged = True
    with pytest.raises(Trouble, match="board b is gone: "):
        bench.settle()


TMC = CELL + 'driver = { kind = "tmc2209", uart = "gpio20", address = 1, amperes = 0.8, microsteps = 2 }\n'


def test_a_chip_under_a_controller_that_commands_no_current_is_set_before_anything_moves() -> None:
    bench = Bench(TMC)
    chip = bench.fake.chips.get("gpio20")[1]
    assert chip.registers[0x6C] >> 24 & 15 == 7  # MRES of half steps
    assert chip.registers[0x10] & 0x1F == chip.registers[0x10] >> 8 & 0x1F > 0  # hold and run alike
    assert bench.check.revolution(bench.axis) == 400


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (("amperes = 0.8, microsteps = 2", "amperes = 0.8"),
         r"cell\.toml: hardware\.x\.driver\.microsteps: a gs-c200 commands no power stage: .*microsteps = 2"),
        (("amperes = 0.8, ", ""), r"cell\.toml: hardware\.x\.driver\.amperes: .*like amperes = 0\.8"),
    ],
)  # fmt: skip
def test_a_chip_that_nobody_would_set_is_refused(change: tuple[str, str], error: str) -> None:
    with pytest.raises(Problem, match=error):
        Bench(TMC.replace(*change))


def test_a_chip_that_does_not_answer_is_refused_before_anything_moves() -> None:
    with pytest.raises(Problem, match=r"cell\.toml: hardware\.x\.driver: the tmc2209 at .*, address 1 does not answer"):
        Bench(TMC, chips=False)


def test_microsteps_are_said_once() -> None:
    text = TMC.replace("gs-c200", "dcb-274").replace("EOT = ", "LIMIT-A = ").replace("UI1 = ", "LIMIT-B = ")
    with pytest.raises(Problem, match=r"hardware\.x\.driver\.microsteps: a dcb-274 commands that itself: leave it out"):
        Bench(text)


def test_a_chip_that_cannot_do_what_a_controller_commands_in_a_move_is_refused_before_anything_moves() -> None:
    """A BS0610 changes to full steps at speed (A)."""
    text = GENSTEPPER.replace(HALF, 'driver = { kind = "tmc2209", uart = "gpio20", amperes = 0.8 }')
    with pytest.raises(Problem, match=r"hardware\.x\.X\.driver\.kind: the controller changes its sequence of"):
        Bench(text)
