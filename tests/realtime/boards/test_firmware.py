"""The stock firmware itself, where there is one: what it does is what the fake board does."""

import select
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import pytest
from tests.realtime.boards.firmware_process import DIR, MACHINE, STEP, TERMINAL, Machine, with_firmware, with_machine

from detent.axis import Axis, MotionStarted
from detent.pulses import Train
from detent.ramps import constant_acceleration
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.events import (
    CountDiffers,
    InputChanged,
    Ready,
    Recovered,
    Refusal,
    ShutDown,
    Slipped,
    Stopped,
)
from detent.realtime.boards.ports import Look, open_port
from detent.realtime.boards.setup import BoardSetup, InputSetup, OutputSetup, Pin, StepperSetup
from detent.ticks import MS, SECOND, US, Ns, to_fixed

pytestmark = with_firmware

E = TypeVar("E")

MOV, ENABLE, EOT, HOME = 6, 4, 10, 11


class Host:
    """A host with one axis, in real time."""

    def __init__(self, machine: Machine, setup: BoardSetup) -> None:
        self.machine, self.events, self.aligned, self.now = machine, [], False, 0  # type: ignore[var-annotated]
        self.boards = Boards([(setup, open_port(TERMINAL))])
        self.told: list[object] = []
        self.did: list[object] = []  # of the motion in force
        self.dried = 0
        self.armed: tuple[dict[str, bool], Ns] = {}, 0
        self.axis = Axis(self.told)  # type: ignore[arg-type]
        self.busy: Ns = 0

    @property
    def stepper(self) -> object:
        return self.boards.steppers["slide"]

    def begin(self) -> "Host":
        self.boards.start(self.machine.wall())
        self.until(lambda: self.boards.ready)
        self.boards.steppers["slide"].adopt(self.axis.shaft)
        self.boards.align(self.now, self.boards.ns_at(self.machine.wall()))
        self.aligned = True
        return self

    def turn(self) -> None:
        boards = self.boards
        readable, writable, _ = select.select(boards.reading(), boards.writing(), (), 0.0005)
        began = time.thread_time_ns()
        if boards.master.wants_reopening:
            self.machine.begins_anew()
        wall = self.machine.wall()
        for descriptor in readable:
            boards.receive(descriptor, wall)
        for descriptor in writable:
            boards.flush(descriptor, wall)
        boards.due(wall, self.machine.wall)
        self.hear()
        if self.aligned:
            wall = self.machine.wall()
            self.now = max(self.now, boards.cell_at(wall))
            while self.axis.deadline <= self.now:
                self.axis.advance(self.axis.deadline)
            for entry in self.told:
                boards.steppers["slide"].tell(entry)  # type: ignore[arg-type]
                if isinstance(entry, MotionStarted) and entry.first == 1:
                    self.did.clear()
                self.did.append(entry)
            self.told.clear()
            at = boards.commit_at()
            if at is not None and at <= wall:
                boards.commit(self.now, wall, self.machine.wall)
            self.hear()
        self.busy += time.thread_time_ns() - began

    def arm(self, inputs: dict[str, bool], at: Ns) -> None:
        self.armed = inputs, at
        self.boards.stops["slide"].arm(inputs, at)

    def hear(self) -> None:
        """What came; the steps that were late are told once more."""
        for event in self.boards.events():
            if isinstance(event, Stopped) and event.dry:
                self.dried += 1
                stepper = self.boards.steppers["slide"]
                stepper.rewind(event.shaft, slipped=True)
                self.boards.stops["slide"].arm(*self.armed)
                for entry in self.did:
                    stepper.tell(entry)  # type: ignore[arg-type]
            else:
                self.events.append(event)
                if isinstance(event, Stopped):
                    self.armed = {}, 0

    def until(self, done: Callable[[], bool], most: float = 20.0) -> None:
        end = time.monotonic() + most
        while not done():
            assert time.monotonic() < end, [event for event in self.events if not isinstance(event, Stopped)][-6:]
            assert not self.of(Refusal), self.events
            self.turn()

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.turn()

    @property
    def failed(self) -> bool:
        """Whether the firmware shut down without being asked to."""
        return any(event.reason != "emergency stop" for event in self.of(ShutDown))

    def of(self, kind: type[E]) -> list[E]:
        return [event for event in self.events if isinstance(event, kind)]

    def move(self, train: Train, direction: int) -> None:
        marks = () if train.steps is None else (train.steps,)
        self.axis.start(train.shifted(to_fixed(self.now)), direction, marks, self.now)

    def rest(self) -> None:
        self.until(lambda: not self.axis.moving or self.failed, 120)
        assert not self.failed, self.events
        stepper = self.boards.steppers["slide"]
        stop = self.boards.stops["slide"]
        self.until(lambda: (stepper.over(self.machine.wall()) and not stop.firing) or self.failed)
        self.until(lambda: not stepper.proving or self.failed)
        assert not self.failed, self.events

    def stop_at(self, stop: Stopped, started: MotionStarted) -> None:
        """Take the axis back to the stop; what slipped since it started has a lag of its own, as a cell knows."""
        given = (stop.shaft - started.shaft) * started.direction
        first = started.train.time_of(given) if given else started.at
        at = min(max(stop.at, first), started.train.time_of(given + 1) - 1)
        assert at == stop.at or any(slip.at >= started.at for slip in self.of(Slipped))
        self.axis.cut(at)
        self.told.clear()
        self.boards.steppers["slide"].rewind(stop.shaft)
        assert self.axis.shaft == stop.shaft


def setup(watchdog: Ns = 2 * SECOND, pulse: Ns = 5 * US) -> BoardSetup:
    return BoardSetup(
        "left",
        steppers=(StepperSetup("slide", Pin(f"gpio{STEP}"), Pin(f"gpio{DIR}"), pulse),),
        outputs=(
            OutputSetup("MOV", Pin(f"gpio{MOV}")),
            OutputSetup("ENABLE", Pin(f"gpio{ENABLE}", True), watchdog=watchdog),
        ),
        inputs=(InputSetup("EOT", Pin(f"gpio{EOT}", pull=1)), InputSetup("HOME", Pin(f"gpio{HOME}"))),
    )


Begin = Callable[..., Host]


@pytest.fixture
def begin() -> Iterator[Begin]:
    """Makes hosts, each with the setup that it is given, on the one terminal; whatever becomes of them it is let go."""
    made: list[Host] = []

    def another(given: BoardSetup | None = None, machine: Machine | None = None) -> Host:
        made.append(Host(machine or Machine(MACHINE), given or setup()))
        if MACHINE:
            made[-1].axis.shaft = made[-1].machine.position
        return made[-1].begin()

    yield another
    for each in made:
        each.boards.close()


@pytest.fixture
def host(begin: Begin) -> Host:
    return begin()


def test_it_says_what_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    look = Look(open_port(TERMINAL))
    look.start(time.monotonic_ns())
    end = time.monotonic() + 10
    while not look.turn(time.monotonic_ns()):
        assert time.monotonic() < end
        select.select(look.port.reading(), (), (), 0.01)
    look.port.close()
    assert look.found is not None
    assert look.found.missing == ()
    with capsys.disabled():
        print(f"\nchecked against {look.found.firmware} on {look.found.mcu} at {look.found.frequency} Hz")


def test_steps_that_come_too_late_find_the_axis_stopped(host: Host) -> None:
    """What is written is held up for longer than what is under way, again and again: slips, and no shutdown."""
    [(_, port)] = host.boards._pairs
    begin, send = host.axis.shaft, port.send
    held: list[bytes] = []

    def hold(data: bytes, wall: Ns) -> None:
        held.append(data)

    host.move(constant_acceleration.move(200, 1000, 60, 3000).train, 1)
    for _ in range(5):
        host.run(0.2)
        port.send = hold  # type: ignore[method-assign]
        host.run((host.boards.lead + host.stepper.lag + 30 * MS) / SECOND)  # type: ignore[attr-defined]
        port.send = send  # type: ignore[method-assign]
        for data in held:
            send(data, host.machine.wall())
        held.clear()
    host.rest()
    assert not host.of(CountDiffers)
    assert host.stepper.counted() == begin + 3000  # type: ignore[attr-defined]
    assert host.dried >= 4
    if MACHINE:
        assert host.machine.position == begin + 3000


def test_moves_are_counted_as_they_are_told(host: Host) -> None:
    begin = host.axis.shaft
    for direction, steps in ((1, 1000), (-1, 400), (1, 3), (-1, 1)):
        host.move(constant_acceleration.move(200, 1500, 60, steps).train, direction)
        host.rest()
        assert host.boards.steppers["slide"].counted() == host.axis.shaft
        if MACHINE:
            assert host.machine.position == host.axis.shaft
    assert host.axis.shaft == begin + 602
    assert not host.of(CountDiffers)


def test_cuts_in_mid_move(host: Host) -> None:
    for n in range(12):
        host.move(constant_acceleration.move(100, 3000, 200, None).train, 1 - n % 2 * 2)
        host.run(0.05 + 0.03 * n)
        host.axis.cut(host.now)
        host.rest()
        assert host.boards.steppers["slide"].counted() == host.axis.shaft
        if MACHINE:
            assert host.machine.position == host.axis.shaft
    assert not host.of(CountDiffers)


def test_a_hundred_thousand_steps_at_10_khz(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    host.busy = 0
    began = time.monotonic()
    host.move(constant_acceleration.move(1000, 10_000, 1000, 100_000).train, 1)
    host.rest()
    share = host.busy / 1e9 / (time.monotonic() - began)
    assert host.boards.steppers["slide"].counted() == host.axis.shaft
    if MACHINE:
        assert host.machine.position == host.axis.shaft
    with capsys.disabled():
        print(f"\n10 kHz: {100 * share:.0f} % of a core, {host.boards.master.statistics()}")


@with_machine
def test_homings_stop_on_the_step(host: Host) -> None:
    machine = host.machine
    for n in range(50):
        rate = (200, 1000, 2000)[n % 3]
        edge = machine.position + 40 + 7 * n
        machine.switch(EOT, edge, 1 << 40)
        host.run(0.01)
        host.arm({"EOT": False}, host.now)
        host.move(constant_acceleration.move(rate, rate, 1, None).train, 1)
        [started] = host.told
        assert isinstance(started, MotionStarted)
        before = len(host.of(Stopped))
        host.until(lambda before=before: len(host.of(Stopped)) > before)
        stop = host.of(Stopped)[-1]
        assert stop.shaft == machine.position == edge
        host.stop_at(stop, started)
        host.run(0.05)
        assert machine.position == edge
        host.boards.stops["slide"].disarm()
        host.move(constant_acceleration.move(1000, 1000, 1, 30 + 7 * n).train, -1)
        host.rest()
        assert host.boards.steppers["slide"].counted() == host.axis.shaft == machine.position
    assert not host.of(CountDiffers)


@with_machine
def test_outputs_change_with_the_steps_and_inputs_are_told(host: Host) -> None:
    machine = host.machine
    host.boards.outputs["MOV"].set(True, host.now)
    host.run(0.1)
    assert machine.output(MOV)
    host.boards.outputs["MOV"].set(False, host.now)
    host.run(0.1)
    assert not machine.output(MOV)
    machine.put(HOME, False)
    host.run(0.05)
    machine.put(HOME, True)
    host.run(0.05)
    assert [(e.input, e.level) for e in host.of(InputChanged)] == [("HOME", False), ("HOME", True)]


def test_an_emergency_stop_in_a_move_and_on_from_there(host: Host) -> None:
    host.boards.outputs["ENABLE"].set(True, host.now)
    host.move(constant_acceleration.move(1000, 1000, 1, None).train, 1)
    host.run(0.3)
    host.boards.emergency_stop(host.machine.wall())
    host.until(lambda: bool(host.of(ShutDown)))
    host.run(0.1)
    if MACHINE:
        assert host.machine.output(ENABLE)  # active low: off
    host.boards.recover(host.machine.wall())
    host.until(lambda: bool(host.of(Recovered)))
    shaft = host.of(Recovered)[0].shafts["slide"]
    assert shaft is not None
    if MACHINE:
        assert shaft == host.machine.position
    host.axis.cut(host.now)
    host.told.clear()
    host.axis.shaft = shaft
    host.boards.steppers["slide"].rewind(shaft)
    host.move(constant_acceleration.move(200, 1500, 60, 300).train, -1)
    host.rest()
    assert host.boards.steppers["slide"].counted() == host.axis.shaft == shaft - 300
    assert not host.of(CountDiffers)


def test_a_host_that_is_gone_leaves_its_position(host: Host, begin: Begin) -> None:
    """Another host finds the board as this one left it in mid-move: configured, still, and its count kept."""
    host.move(constant_acceleration.move(1000, 1000, 1, None).train, 1)
    host.run(0.3)
    host.boards.close()
    time.sleep(0.2)
    after = begin(machine=host.machine)
    [ready] = after.of(Ready)
    assert not ready.restarted
    after.move(constant_acceleration.move(200, 1500, 60, 200).train, -1)
    after.rest()
    assert after.boards.steppers["slide"].counted() == after.axis.shaft
    if MACHINE:
        assert host.machine.position == after.axis.shaft


def test_an_output_that_nobody_refreshes_falls(host: Host, begin: Begin) -> None:
    host.boards.outputs["ENABLE"].set(True, host.now)
    host.run(0.2)
    if MACHINE:
        assert not host.machine.output(ENABLE)
    host.boards.close()
    time.sleep(2.5)
    if MACHINE:
        assert host.machine.output(ENABLE)
    after = begin(machine=host.machine)  # which clears the shutdown
    assert not after.of(Ready)[0].restarted


def test_another_configuration_starts_it_again(begin: Begin) -> None:
    made = begin(setup(pulse=7 * US))
    assert made.of(Ready)[0].restarted
    begun = made.axis.shaft
    made.move(constant_acceleration.move(200, 1500, 60, 200).train, 1)
    made.rest()
    assert made.boards.steppers["slide"].counted() == made.axis.shaft == begun + 200


@with_machine
def test_step_edges_are_where_they_were_sent(begin: Begin) -> None:
    """Lateness of edges in the process is the operating system's; the middle one is on time, to some us."""
    made = begin()
    machine = made.machine
    before = len(machine.records())
    made.run(0.5)  # that took a while
    target = machine.position + 500
    made.move(constant_acceleration.move(500, 500, 1, 500).train, 1)
    [started] = made.told
    assert isinstance(started, MotionStarted)
    made.until(lambda: machine.position == target)
    made.rest()
    edges = [ns for ns, line, level, _ in machine.records()[before:] if line == STEP and level]
    assert len(edges) == 500
    due = [made.boards.wall_of(started.train.time_of(n) + made.boards.lead) for n in range(1, 501)]
    slips = made.of(Slipped)  # of a busy computer: what follows one is as much later
    behind = [sum(slip.by for slip in slips if started.train.time_of(n) >= slip.at) for n in range(1, 501)]
    late = sorted(edge - at - lag for edge, at, lag in zip(edges, due, behind, strict=True))
    assert abs(late[250]) < 1 * MS
