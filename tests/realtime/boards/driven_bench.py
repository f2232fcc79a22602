"""A cell behind fake boards, served by the loop itself in virtual time; and the same cell with ideal switches."""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Description, parse
from detent.cell.outside import Store, no_store
from detent.realtime.boards.dictionary import Value
from detent.realtime.boards.driven import Driven
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chip, Chips
from detent.realtime.boards.fake.machine import Machine, MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.frames import Reader, read_integer
from detent.realtime.boards.link import Link
from detent.realtime.boards.opening import boards_of, make_ready, set_drivers
from detent.realtime.boards.plan import Plan, plan
from detent.realtime.boards.registers import CHOPCONF, settings
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.setup import Pin
from detent.realtime.boards.stages import stages
from detent.realtime.boards.states import News
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.ticks import MS, NEVER, SECOND, US, Ns


class Wire(FakePort):
    """A fake board whose host may be kept away while it writes: before it, behind it, or in the middle of a block."""

    def __init__(
        self, board: FakeBoard, clock: Callable[[], Ns], present: Callable[[], Ns], **given: Any
    ) -> None:  # fmt: skip
        """`clock` is looked at within a write, which may take time; `present` is what it said last."""
        super().__init__(board, **given)
        self._clock, self._present = clock, present
        self.spare_exposed = False  # nothing is held up that has a time and no step before it
        self._until: dict[Value, int] = {}
        self.hold: Callable[[], Ns] = lambda: 0  # for how long the wire stands, while its host goes on
        self._free: Ns = 0

    def _exposed(self, data: bytes) -> bool:
        """Whether a board shuts down if this comes later than it says: it cannot be kept from that."""
        found = False
        for each in Reader().feed(data):
            place = 0
            while place < len(each.payload):
                number, place = read_integer(each.payload, place)
                message, place = self.board.form(number).decode(each.payload, place)
                if message.name == "trsync_set_timeout":
                    tick, before = self.board.whole(message.number("clock")), self._until.get(message.values["oid"], 0)
                    found = found or tick <= before
                    self._until[message.values["oid"]] = tick
                found = (
                    found
                    or message.name in ("trsync_start", "queue_digital_out")
                    or (message.name == "endstop_home" and bool(message.values["sample_count"]))
                )
        return found

    def send(self, data: bytes, wall: Ns) -> None:
        wall = max(wall, self._present())  # nothing is written before the clock was looked at last
        exposed = self._exposed(data)
        held = 0 if exposed else self.hold()  # what follows cannot pass it
        self._free = max(self._free, wall + held if held else 0)
        if self._free > wall:
            if exposed and self.spare_exposed:
                self._free = wall
            super().send(data, self._free)
            return
        if exposed and self.spare_exposed:
            super().send(data, wall)
            return
        later = max(wall, self._clock())
        gone = (later - wall) % (len(data) + 1) if later > wall else len(data)
        super().send(data[:gone], wall)
        if gone < len(data):
            super().send(data[gone:], later)


class LoggedChip(Chip):
    """A chip that keeps what was written to it: tick, register, value."""

    def __init__(self, board: FakeBoard, address: int) -> None:
        super().__init__(address)
        self._board = board
        self.log: list[tuple[int, int, int]] = []

    def write(self, register: int, value: int) -> None:
        self.log.append((self._board.now, register, value))
        super().write(register, value)


class LoggedChips(Chips):
    """Those of a board."""

    def __init__(self, board: FakeBoard) -> None:
        super().__init__()
        self._board = board

    def get(self, wire: object, default: Any = None) -> Any:
        return self.setdefault(wire, [LoggedChip(self._board, address) for address in range(4)])


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


def machine_of(described: Description, made: Plan, board: str, switches: Mapping[str, tuple[str, int, int]]) -> Machine:
    """An axis for each stepper of a board, and `switches`: UNIT.PIN -> stepper, first and last place that is low."""
    setup = next(s for s, _ in made.setups if s.name == board)
    axes = {}
    for stepper in setup.steppers:
        minus = None if stepper.minus is None else stepper.minus.name
        reverse = stepper.dir.active_low and minus is None
        axes[stepper.name] = MachineAxis(stepper.step.name, stepper.dir.name, reverse, minus)
    found = []
    for put in setup.inputs:
        if put.name in switches:
            axis, low, high = switches[put.name]
            found.append(MachineSwitch(axis, put.pin.name, low, high, put.pin.active_low))
    return Machine(axes=axes, switches=found)


class Bench:
    """`text` is a cell file. `heard` is what the hosts of its lines heard: board ns, cell time, value."""

    glitch = 1  # ticks between a level that was given for too soon a time, and the one that sets it right

    def __init__(
        self,
        text: str,
        *,
        switches: Mapping[str, tuple[str, int, int]] | None = None,
        store: Store = no_store,
        line_timing: bool = False,
        jitter: Callable[[], Ns] = lambda: 0,
        port: Mapping[str, Any] | None = None,
        board: Mapping[str, Any] | None = None,
        read: Callable[[str], str] = no_file,
        away: Callable[[bool], Ns] = lambda writing: 0,
        spare_exposed: bool = False,
        chips: bool = False,
    ) -> None:
        """`away`: for how long the computer is elsewhere, at each look at its clock, and (True) within each write.

        `spare_exposed`: not within one that has to come in time. `chips`: there are drivers, and they answer.
        """
        self.wall = 1_000 * SECOND
        self._away = away
        self._jitter, self._until = jitter, self.wall
        described = parse(text, "cell.toml")
        trial = build(described, read)
        self.plan = plan(described, trial.controllers())
        self.machines: dict[str, Machine] = {}
        self.ports: dict[str, Wire] = {}
        made = iter(self.plan.setups)

        def open_port(address: str) -> Wire:
            name = next(made)[0].name
            self.machines[name] = machine_of(described, self.plan, name, switches or {})
            fake = FakeBoard(self.machines[name], **{"moves": 400, **(board or {})})
            fake.kept_log = False
            fake.chips = LoggedChips(fake) if chips else {}
            self.ports[name] = Wire(fake, lambda: self.look(True), lambda: self.wall, **(port or {}))
            self.ports[name].spare_exposed = spare_exposed
            return self.ports[name]

        self.boards = boards_of(self.plan, open_port)
        levels = make_ready(self.boards, self.plan, lambda: self.wall, self._sleep)
        if chips:
            set_drivers(self.boards, self.plan, stages(self.plan, trial), lambda: self.wall, self._sleep)
        self.stores = HeldStores(store)
        given = {self.plan.inputs[name]: level for name, level in levels.items()}
        self.cell: Cell = build(described, read, store=self.stores.save, line_timing=line_timing, inputs=given)
        self.news: list[News] = []
        self.driven = Driven(self.cell, self.boards, self.plan, self.stores, wall=self.look, tell=self.news.append)
        for board in self.boards.boards.values():
            self._slow(board.core.link)
        self.pace = Pace(1, origin=self.cell.now, clock=self.driven.clock)
        self.loop = Loop(self.driven, self.pace, [], companion=self.driven, wait=self._wait)
        self.loop._tell = self._hear  # type: ignore[method-assign]
        self.driven.begin(self.pace, levels)
        self.heard: list[list[tuple[Ns, Ns, int]]] = [[] for _ in self.cell.lines]

    def _slow(self, link: Link) -> None:
        """Whatever is said to a board takes its time, too."""
        send = link.send

        def slowly(message: bytes) -> None:
            self.look()
            send(message)

        link.send = slowly  # type: ignore[method-assign]

    def look(self, writing: bool = False) -> Ns:
        """The computer looks at its clock."""
        self.wall += self._away(writing)
        return self.wall

    def close(self) -> None:
        self.loop.close()

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _sleep(self, _: Sequence[int], __: Sequence[int], seconds: float) -> tuple[Sequence[int], Sequence[int]]:
        self.wall += max(round(seconds * 1e9), 10 * US)
        return (), ()

    def _wait(self, *given: Any) -> tuple[list[int], list[int], list[int]]:
        left, seconds = self._until - self.wall, given[3]
        sleep = left if seconds is None else min(round(seconds * 1e9) + 1, left)
        self.wall += max(sleep, 10 * US) + self._jitter()
        return [], [], []

    def _hear(self, _: int) -> None:
        for number, line in enumerate(self.driven.lines):
            for heard in line.take():
                self.heard[number].append((self.driven.clock(), heard.at, heard.char.value))

    def run(self, span: Ns) -> None:
        """Let so much wall time pass."""
        self._until = self.wall + span
        while self.wall < self._until:
            self.loop.step()

    def rest(self, most: Ns = 60 * SECOND) -> None:
        """Until nothing moves, on the pins too, and no stop has come that sets a motion going once more."""
        end = self.wall + most
        while True:
            while self.wall < end and any(state.moving for state in self.driven.axes()):
                self.run(20 * MS)
            self.run(self.plan.lead + self.driven.lag + 150 * MS)
            while self.wall < end and any(stepper.proving for stepper in self.boards.steppers.values()):
                self.run(20 * MS)
            if self.wall >= end or not any(state.moving for state in self.driven.axes()):
                return

    def type(self, unit: str, text: str) -> None:
        """The host of a unit sends a line, now: when the cell is at its present."""
        self.send(unit, self.cell.serial_unit(unit).frame(text))

    def send(self, unit: str, data: bytes) -> None:
        self.loop._catch_up()
        self.driven.send(self.cell.wiring.line_of[self.cell.unit(unit)], data)

    def power(self, unit: str, on: bool) -> None:
        """A hand switches a unit, now."""
        self.loop.ask(lambda: self.cell.power(unit, on))
        self.loop._do_asked()
        self.driven.run_to(self.driven.now)

    def said(self, unit: str) -> str:
        line = self.cell.wiring.line_of[self.cell.unit(unit)]
        return "".join(chr(value & 127) for _, _, value in self.heard[line])

    def stall(self, span: Ns) -> None:
        """The computer is elsewhere."""
        self.wall += span

    def come_back(self) -> None:
        """Every board is plugged in again, and recovered."""
        for port in self.ports.values():
            port.unplugged = False
        self.driven.recover()
        self.run(2 * SECOND)

    def press(self, name: str, level: int) -> None:
        """A hand gives an input (UNIT.PIN) a logical level, now."""
        board = self.plan.board_of[name]
        pin: Pin = next(i.pin for s, _ in self.plan.setups for i in s.inputs if i.name == name)
        self.ports[board].run_to(self.wall)
        self.machines[board].set(pin.name, bool(level) is not pin.active_low, self.ports[board].board.now)

    def check_inputs(self) -> None:
        """Behind a rest the cell has every input as it is."""
        for name, (unit, pin) in self.plan.inputs.items():
            board = self.boards.boards[self.plan.board_of[name]]
            given = self.cell.forced[self.cell.unit(unit), pin]
            assert bool(given) is board.inputs[name], f"{name} is {board.inputs[name]}, and {given} in the cell"

    def check_outputs(self) -> None:
        """Behind a rest every output of a driven unit is on its pin as the cell has it."""
        for out in self.driven.outgoing.outputs.values():
            board = next(name for name, board in self.boards.boards.items() if out.name in board.outputs)
            self.ports[board].run_to(self.wall)
            pin = self.boards.outputs[out.name].setup.pin
            found = self.machines[board].outputs[pin.name] is not pin.active_low
            [*_, (at, level)] = out.levels.before(out.levels.count)
            assert found is level, f"{out.name} is {found}, and {level} in the cell since {at / 1e9:.4f} s"

    def check_levels(self, *, late: bool) -> None:
        """Every output did what it did in the cell, and nothing else.

        Where no stop took anything back, and none is said to have been late. The bench has kept all (`keep`). `late`:
        the computer was kept away; then what it had given for too soon a time may have stood for more than a tick.
        """
        for out in self.driven.outgoing.outputs.values():
            if late and self.boards.outputs[out.name].corrections:
                continue
            if any(news.text.startswith(f"{out.name} changed ") for news in self.news):
                continue
            board = next(name for name, board in self.boards.boards.items() if out.name in board.outputs)
            setup, edges = self.boards.outputs[out.name].setup, self.machines[board].edges
            seen = [(tick, level is not setup.pin.active_low) for tick, pin, level in edges if pin == setup.pin.name]
            wanted = [(-1, setup.initial), *out.levels.since(1)]
            # what had been given to the board for too soon a time is set right as it comes
            assert settled(seen, self.glitch) == settled(wanted, 0), out.name

    def check_microsteps(self) -> None:
        """Every step was made with the microsteps that its controller had commanded before it.

        Where no stop took anything back, and the computer was never away. The bench has kept all (`keep`).
        """
        for ledger in self.driven.ledgers:
            found = [
                setup for board, _ in self.plan.setups for setup in board.drivers if setup.name == ledger.what.driver
            ]
            if not found or not ledger.stages.count:
                continue
            [setup] = found
            wire = setup.uart or setup.select
            assert wire is not None
            chip = self.ports[ledger.what.board].board.chips[wire.name][0]
            written = [(tick, value >> 24 & 15) for tick, register, value in chip.log if register == CHOPCONF]
            told = pulses(ledger.motions.since(0), self.cell.now)
            for (at, place), (tick, _) in zip(told, self.edges(ledger.name), strict=True):
                stage = [staged.stage for staged in ledger.stages.since(0) if staged.behind < at][-1]
                wanted = next(entry.value for entry in settings(setup, stage) if entry.register == CHOPCONF)
                assert [value for since, value in written if since <= tick][-1] == wanted >> 24 & 15, place

    def keep(self) -> None:
        """Nothing is forgotten of what the cell did."""
        self.driven._forget = lambda: None  # type: ignore[method-assign]

    def check_drivers(self, *, late: bool) -> None:
        """No step was made while the driver of its axis was switched off, or had half of its current.

        But where its controller commands the current: then it has what was commanded last. `late`: the computer was
        kept away between an output and steps that are due behind it; then some may have come before.
        """
        for ledger in self.driven.ledgers:
            if ledger.what.half and (stage := ledger.stage_at(NEVER)) is not None:
                holds, full = stage.settling > 0, max(stage.run, stage.hold) if stage.chops else 1.0
                assert self.boards.outputs[ledger.what.half].level is ((stage.hold if holds else stage.run) <= full / 2)
            for name, active in ((ledger.what.enable, True), (ledger.what.half, False)):
                if not name or (name == ledger.what.half and (late or ledger.stages.count)):
                    continue
                machine, pin = self.machines[ledger.what.board], self.boards.outputs[name].setup.pin
                changes = [
                    (tick, level is not pin.active_low) for tick, where, level in machine.edges if where == pin.name
                ]
                for tick, axis, place in machine.steps:
                    if axis == ledger.name:
                        error = 60 * US * self.boards.boards[ledger.what.board].frequency // SECOND
                        levels = [level for at, level in changes if at <= tick - error] + [
                            level for at, level in changes if abs(at - tick) < error and level is active
                        ]
                        assert levels[-1:] == [active], f"{axis} made a step to {place} at {tick} with {name} wrong"

    def position(self, stepper: str) -> int:
        """Where the motor is."""
        board = self.boards.home[stepper]
        self.ports[board].run_to(self.wall)
        return self.machines[board].axes[stepper].position

    def edges(self, stepper: str) -> list[tuple[int, int]]:
        """The steps on the pins so far: tick, and the place behind each."""
        board = self.boards.home[stepper]
        self.ports[board].run_to(self.wall)
        return [(tick, place) for tick, axis, place in self.machines[board].steps if axis == stepper]


def settled(changes: Sequence[tuple[int, bool]], apart: int) -> list[bool]:
    """The levels that an output stayed at: of changes that are no further `apart`, the last."""
    found: list[bool] = []
    before: int | None = None
    for at, level in changes:
        if before is not None and at - before <= apart:
            found.pop()
        found.append(level)
        before = at
    return [level for level, _ in groupby(found)]


def pulses(motions: Sequence[MotionStarted | MotionCut | MotionEnded], until: Ns) -> list[tuple[Ns, int]]:
    """The pulses that an axis gave: time, and the place behind each."""
    found: list[tuple[Ns, int]] = []
    current: MotionStarted | None = None
    for motion in (*motions, None):
        if current is not None:
            if isinstance(motion, MotionStarted):
                last = motion.first - 1
            else:
                last = current.train.steps_by(until) if motion is None else motion.last
            found += [
                (current.train.time_of(n), current.shaft + current.direction * n)
                for n in range(current.first, last + 1)
            ]
        current = motion if isinstance(motion, MotionStarted) else None
    return found
