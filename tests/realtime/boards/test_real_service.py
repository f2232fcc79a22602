"""A service with real pins: what it opens, refuses, tells, and what `detent control` does to it."""

from collections.abc import Iterator

import pytest
from tests.realtime.boards.test_driven import CELL
from tests.realtime.served import no_file

from detent.cell.build import build
from detent.cell.description import Problem, parse
from detent.realtime.boards.drive import RealPins
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chip
from detent.realtime.boards.fake.machine import Machine, MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.ports import open_port
from detent.realtime.boards.states import News
from detent.realtime.control import Control
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.service import Service
from detent.realtime.verbs import AskedWrongly
from detent.ticks import MS, SECOND


class Wall:
    """Host time that passes when somebody waits."""

    def __init__(self) -> None:
        self.now = 1_000 * SECOND

    def __call__(self) -> int:
        return self.now

    def sleep(self, *given: object) -> tuple[tuple[int, ...], tuple[int, ...]]:
        seconds = given[2]
        assert isinstance(seconds, float)
        self.now += max(round(seconds * SECOND), 10_000)
        return (), ()


def made(text: str, port: FakePort | None = None, **options: object) -> tuple[Service, Wall, list[News]]:
    wall, news = Wall(), []
    fake = port or FakePort(FakeBoard(moves=400))
    real = RealPins(news.append, lambda address: fake, wall, wall.sleep)
    service = Service(parse(text, "cell.toml"), no_file, [EndpointSpec("tcp", "127.0.0.1:0")], real=real, observed=True,
                      line_timing=False, **options)  # type: ignore[arg-type]  # fmt: skip
    service._loop._wait = lambda r, w, x, s: (*wall.sleep(r, w, 0.02 if s is None else min(s, 0.02)), ())  # type: ignore[assignment,return-value]
    service.restart_clock()
    return service, wall, news


def run(service: Service, wall: Wall, span: int) -> None:
    end = wall.now + span
    while wall.now < end:
        service.step()


@pytest.fixture
def served() -> Iterator[tuple[Service, Wall, list[News]]]:
    service, wall, news = made(CELL)
    with service:
        yield service, wall, news


def test_control_looks_stops_and_recovers(served: tuple[Service, Wall, list[News]]) -> None:
    service, wall, news = served
    control = Control(service)
    run(service, wall, 100 * MS)
    control.do("type", {"text": "+3000"})
    run(service, wall, 400 * MS)
    state = control.do("board", {})
    assert isinstance(state, dict)
    axis = state["axes"]["x"]  # type: ignore[index,call-overload]
    assert axis["standing"] == "driven"
    assert axis["armed"] == ["x.ENABLE"]
    assert 0 < axis["shaft"] < 3000
    assert state["boards"]["b"]["state"] == "ready"  # type: ignore[index,call-overload]
    control.do("stop", {})
    run(service, wall, 200 * MS)
    assert control.do("state", {})["real"]["axes"]["x"]["standing"] == "fault"  # type: ignore[index]
    control.do("recover", {})
    run(service, wall, 300 * MS)
    state = control.do("board", {})
    assert state["axes"]["x"]["standing"] == "driven"  # type: ignore[index]
    assert [item.severity.value for item in news] == ["fault", "warning"], news


@pytest.mark.parametrize(
    ("verb", "given", "error"),
    [
        ("pause", {}, "real pins are driven, and their time does not stand; stop the motors with stop"),
        ("pace", {"pace": 2}, "real pins are driven"),
        ("set", {"pin": "x.EOT", "level": 0}, "x.EOT is an input of a board; its level is that of the pin"),
        ("set", {"pin": "EOT", "level": 0}, "x.EOT is an input of a board"),
        ("fault", {"where": "x.EOT", "kind": "stuck", "level": 1}, "x.EOT is an input of a board"),
    ],
)
def test_what_would_fool_a_motor_is_refused(
    served: tuple[Service, Wall, list[News]], verb: str, given: dict[str, object], error: str
) -> None:
    with pytest.raises(AskedWrongly, match=error):
        Control(served[0]).do(verb, given)


def test_without_real_pins_there_is_nothing_to_stop() -> None:
    with (
        Service(parse(CELL, "cell.toml"), no_file, [EndpointSpec("tcp", "127.0.0.1:0")], observed=True) as service,
        pytest.raises(AskedWrongly, match="no real pins are driven; serve the cell with --real"),
    ):
        Control(service).do("stop", {})


@pytest.mark.parametrize(("typed", "span"), [("", 0), ("+3000", 2), ("+3000", 300), ("-3000", 700), ("+40", 900)])
def test_an_orderly_end_leaves_every_output_at_rest_and_says_where_the_motor_stands(typed: str, span: int) -> None:
    """As the watchdog does when the host dies: a relay on UO1 must not stay on because somebody ended the service."""
    machine = Machine(axes={"x": MachineAxis("gpio2", "gpio3")})
    port = FakePort(FakeBoard(machine, moves=400))
    service, wall, _ = made(CELL, port)
    with service:
        control = Control(service)
        run(service, wall, 100 * MS)
        control.do("type", {"text": "A1"})
        run(service, wall, 100 * MS)
        assert machine.outputs["gpio8"] is True
        control.do("type", {"text": typed or "V"})
        run(service, wall, span * MS)
        moving = service.driven is not None and service.driven.axes()[0].moving
    assert service.driven is not None
    port.run_to(wall.now + SECOND)
    rest = {"gpio6": False, "gpio7": False, "gpio8": False, "gpio4": True}  # MOV, RDY (active low), UO1, enable (low)
    assert {pin: machine.outputs[pin] for pin in rest} == rest
    let_go = max(tick for tick, pin, level in machine.edges if pin == "gpio4" and level)
    assert all(tick <= let_go for tick, _, _ in machine.steps), "the motor is held until its last step"
    [line] = service.driven.ended()
    cut = "; it was stopped in mid-move, without a ramp" if moving else ""
    assert line == f"x stands at {machine.axes['x'].position}{cut}"
    assert moving is (0 < span < 900)


def test_an_end_on_a_switch_and_an_end_at_fault_say_so() -> None:
    machine = Machine(
        axes={"x": MachineAxis("gpio2", "gpio3")}, switches=[MachineSwitch("x", "gpio12", 150, 900, False)]
    )
    port = FakePort(FakeBoard(machine, moves=400))
    service, wall, _ = made(CELL, port)
    with service:
        control = Control(service)
        run(service, wall, 100 * MS)
        control.do("type", {"text": "+3000"})
        while machine.axes["x"].position < 150:
            run(service, wall, 1 * MS)
    assert service.driven is not None
    assert service.driven.ended()[0].startswith(f"x stands at {machine.axes['x'].position}")
    service, wall, _ = made(CELL)
    with service:
        run(service, wall, 100 * MS)
        Control(service).do("stop", {})
    assert service.driven is not None
    assert service.driven.ended() == ["x stands: emergency stop"]


def test_a_board_that_is_gone_delays_no_end() -> None:
    deaf = False
    port = FakePort(FakeBoard(moves=400), spoil=lambda data, to_board: [] if deaf else [data])
    service, wall, _ = made(CELL, port)
    with service:
        run(service, wall, 100 * MS)
        deaf = True
        before = wall.now
    assert wall.now - before < 3 * SECOND


def test_positions_are_waited_for_across_a_stop_that_takes_the_cell_back() -> None:
    service, wall, _ = made(CELL)
    with service:
        control = Control(service)
        run(service, wall, 100 * MS)
        waits = control.do("wait", {"unit": "x", "position": 20})
        control.do("type", {"text": "+30"})
        run(service, wall, 1 * SECOND)
        assert waits.done()  # type: ignore[union-attr]


def test_a_board_that_is_not_there_is_one_line() -> None:
    def open_port(address: str) -> FakePort:
        raise OSError(2, "No such file or directory: plug the board in")

    with pytest.raises(Problem, match=r"cell\.toml: boards\.b\.serial: .*No such file"):
        Service(parse(CELL, "cell.toml"), no_file, real=RealPins(lambda news: None, open_port))


def test_a_pin_that_the_board_has_not_is_named_with_its_key() -> None:
    with pytest.raises(Problem, match=r"cell\.toml: hardware\.x\.outputs\.MOV: .*gpio99"):
        made(CELL.replace('MOV = "gpio6"', 'MOV = "gpio99"'))


def test_a_firmware_that_is_too_old_names_what_is_missing() -> None:
    port = FakePort(FakeBoard(moves=400, leave_out=("trsync_start",)))
    with pytest.raises(Problem, match=r"cell\.toml: boards\.b\.serial: .*trsync_start"):
        made(CELL, port)


def test_what_is_no_board_does_not_answer() -> None:
    port = FakePort(FakeBoard(moves=400), spoil=lambda data, to_board: [])
    with pytest.raises(Problem, match=r"cell\.toml: boards\.b\.serial: it does not answer"):
        made(CELL, port)


def test_a_cell_without_pins_says_so() -> None:
    with pytest.raises(Problem, match=r"hardware: no pin of this cell is real: add \[boards\.NAME\]"):
        made('[units.x]\nmodel = "gs-c200"\n')


def test_a_pace_of_its_own_is_refused() -> None:
    with pytest.raises(Problem, match="real pins keep real time"):
        made(CELL, pace=2)


def test_a_mushroom_button_in_the_supply_of_the_motors_is_told_and_recover_sets_the_chip_again() -> None:
    driver = 'driver = { kind = "tmc2209", uart = "gpio20", amperes = 0.8, microsteps = 2 }\ninputs ='
    machine, chip = Machine(axes={"x": MachineAxis("gpio2", "gpio3")}), Chip()
    fake = FakeBoard(machine, moves=400)
    fake.chips["gpio20"] = [chip]
    service, wall, news = made(CELL.replace("inputs =", driver), FakePort(fake))
    with service:
        control = Control(service)
        assert service.driven is not None
        run(service, wall, 100 * MS)
        told = dict(chip.registers)
        control.do("type", {"text": "+30000"})
        run(service, wall, 400 * MS)
        chip.deaf = True
        run(service, wall, 3 * SECOND)
        [axis] = service.driven.axes()
        assert (axis.standing.value, axis.known, axis.moving) == ("fault", False, False)
        assert "does not answer; look at its supply" in axis.why
        place = machine.axes["x"].position
        assert axis.shaft == place
        chip.deaf, chip.writes, chip.registers = False, 0, {}
        run(service, wall, 3 * SECOND)
        assert chip.registers == {}
        control.do("recover", {})
        run(service, wall, 1 * SECOND)
        assert service.driven.axes()[0].standing.value == "driven"
        assert chip.registers == told
        control.do("type", {"text": "+10"})
        run(service, wall, 1 * SECOND)
        assert machine.axes["x"].position == place + 10
    assert [item.severity.value for item in news if item.severity.value != "note"] == ["fault", "warning"], news


MACHINE = """
[units.slide]
model = "gs-c200"
straps = { REC = "low" }
shaft = 40
[boards.b]
serial = "fake:"
[hardware.slide]
board = "b"
step = "!gpio2"
dir = "!gpio3"
enable = "!gpio4"
inputs = { EOT = "^gpio10", HOME = "^!gpio11" }
[switches.end]
drives = "slide.EOT"
axis = "slide"
from = 300
machine = true
[switches.home]
drives = "slide.HOME"
axis = "slide"
to = -20
machine = true
"""


def test_a_fake_board_has_the_machine_of_the_cell_file_behind_it() -> None:
    """Homing at power-on ends where it does in virtual time, stopped by switches that the board reads."""
    ideal = build(parse(MACHINE, "cell.toml"), no_file)
    ideal.run_to(20 * SECOND)
    port = open_port("fake:")
    assert isinstance(port, FakePort)
    service, wall, news = made(MACHINE, port=port)
    with service:
        run(service, wall, 20 * SECOND)
        assert service.driven is not None
        [axis] = service.driven.axes()
        assert axis.stops == 2
        assert axis.shaft == port.board.machine.axes["slide"].position == -20
        assert not service.description.switches
        found, same = (one.controllers()["slide"].status(one.now) for one in (service.cell, ideal))
        assert found == same
        assert port.board.machine.steps == []  # nobody reads them
    assert not news


@pytest.mark.parametrize("where", ["deadline", "receive", "flush", "serve"])
def test_what_fails_between_cell_and_board_stops_motors_and_not_the_service(
    served: tuple[Service, Wall, list[News]], where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    service, wall, _ = served
    driven = service.driven
    assert driven is not None
    run(service, wall, 100 * MS)
    Control(service).do("type", {"text": "+3000"})
    run(service, wall, 300 * MS)
    assert 0 < driven.axes()[0].shaft < 3000

    def fails(*_: object) -> None:
        monkeypatch.undo()
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(driven, where, fails)
    run(service, wall, 300 * MS)
    if where in ("receive", "flush"):
        getattr(service._loop._companion, where)(0)  # this board has no descriptors
        run(service, wall, 300 * MS)
    assert service.stopped.endswith("s: a fault of ours")
    assert driven.axes()[0].standing.value == "fault"
    assert Control(service).do("board", {})["boards"]["b"]["state"] == "shut down"  # type: ignore[index,call-overload]
