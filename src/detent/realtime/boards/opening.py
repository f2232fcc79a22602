"""Opening the boards of a plan and waiting until they are ready: before a cell is switched on, or only to look."""

import os
import select
import time
from collections.abc import Callable, Mapping, Sequence

from detent.cell.description import Problem
from detent.cell.real_pins import device_of
from detent.controllers.device import Stage
from detent.pins import Level
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.events import DriverFault, DriverSet, Lost, Ready, Refusal
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.machine import MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.port import Port
from detent.realtime.boards.ports import FAKE
from detent.realtime.boards.setup import BoardSetup, SetupProblem
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

PATIENCE: WallNs = 10 * SECOND
MOST_PATIENCE: WallNs = 60 * SECOND  # with one that goes on answering, on a slow wire or a busy computer

Sleep = Callable[[Sequence[int], Sequence[int], float], tuple[Sequence[int], Sequence[int]]]
"""Wait until a descriptor can be read or written, or some seconds have passed: those that can."""


class NotYet(Problem):
    """What may be over without another cell file: a board that is not there, a chip that has no supply yet."""


def boards_of(plan: Plan, open_port: Callable[[str], Port]) -> Boards:
    """The boards of a plan with their ports open; nothing is said yet. Raises Problem."""
    opened: list[Port] = []
    devices: dict[str, str] = {}
    try:
        for setup, address in plan.setups:
            other = devices.setdefault(os.path.realpath(device_of(address)[0]), setup.name)
            if other != setup.name and not address.startswith(FAKE):
                what = f"{address} is the device of boards.{other} by another name: each board has one of its own"
                raise Problem(plan.file, f"boards.{setup.name}.serial", what)
            try:
                opened.append(open_port(address))
            except OSError as error:
                raise NotYet(plan.file, f"boards.{setup.name}.serial", str(error)) from None
            if isinstance(opened[-1], FakePort):
                _furnish(opened[-1].board, plan, setup)
        try:
            return Boards([(setup, port) for (setup, _), port in zip(plan.setups, opened, strict=True)])
        except SetupProblem as problem:
            raise plan.problem(problem) from None
    except BaseException:
        for port in opened:
            port.close()
        raise


def _furnish(board: FakeBoard, plan: Plan, setup: BoardSetup) -> None:
    """Put a machine behind a fake board that has none: an axis for each stepper, with the switches of the cell file."""
    if board.machine.axes:
        return
    shafts = {axis.stepper: axis.shaft for axis in plan.axes}
    for stepper in setup.steppers:
        mine = [each for each in plan.stand_ins if (each.board, each.stepper) == (setup.name, stepper.name)]
        minus = None if stepper.minus is None else stepper.minus.name
        reverse = stepper.dir.active_low and minus is None
        axis = MachineAxis(stepper.step.name, stepper.dir.name, reverse, minus, shafts[stepper.name])
        switches = [
            MachineSwitch(stepper.name, each.pin.name, each.low, each.high, each.inside is not each.pin.active_low)
            for each in mine
        ]
        board.machine.add(stepper.name, axis, switches, board.now)


def make_ready(
    boards: Boards, plan: Plan, wall: Callable[[], WallNs] = time.monotonic_ns, sleep: Sleep | None = None
) -> dict[str, Level]:
    """Start the boards and wait until each is ready: the levels of their inputs, by name. Nothing moves.

    Raises Problem where a board refuses, or does not answer in time.
    """
    levels: dict[str, Level] = {}
    began = heard_at = wall()
    heard = 0
    boards.start(began)
    while not boards.ready:
        now = wall()
        if boards.acknowledged != heard:
            heard, heard_at = boards.acknowledged, now
        if now - heard_at > PATIENCE or now - began > MOST_PATIENCE:
            late = next(name for name, board in boards.boards.items() if board.state.value != "ready")
            what = f"the board does not answer as one with Klipper firmware would, for {(now - began) // SECOND} s"
            raise NotYet(plan.file, f"boards.{late}.serial", f"{what}: look with detent boards")
        turn(boards, wall, sleep)
        for event in boards.events():
            if isinstance(event, Refusal):
                problem = plan.problem(SetupProblem(event.item or event.board, event.key, event.text))
                raise _not_yet(problem) if event.passing else problem
            if isinstance(event, Lost):
                raise NotYet(plan.file, f"boards.{event.board}.serial", f"{event.reason}; look at its cable")
            if isinstance(event, Ready):
                levels |= {name: int(level) for name, level in event.inputs.items()}
    return levels


def set_drivers(
    boards: Boards,
    plan: Plan,
    stages: Mapping[str, Stage],
    wall: Callable[[], WallNs] = time.monotonic_ns,
    sleep: Sleep | None = None,
) -> None:
    """Give every driver chip its settings, and wait until each has taken them. Nothing moves. Raises Problem."""
    waiting = {axis.driver for axis in plan.axes if axis.driver}
    try:
        for axis in plan.axes:
            if axis.driver:
                boards.drivers[axis.driver].command(stages[axis.stepper])
    except SetupProblem as problem:
        raise plan.problem(problem) from None
    began = wall()
    while waiting:
        boards.commit(0, wall(), wall)
        turn(boards, wall, sleep)
        for event in boards.events():
            if isinstance(event, DriverFault):
                raise _not_yet(plan.problem(SetupProblem(event.driver, "", event.reason)))
            if isinstance(event, DriverSet):
                waiting.discard(event.driver)
        if waiting and wall() - began > PATIENCE:
            late = SetupProblem(min(waiting), "", "the driver is not set after ten seconds; look at its supply and "
                                "its wires")  # fmt: skip
            raise _not_yet(plan.problem(late))


def _not_yet(problem: Problem) -> NotYet:
    return NotYet(problem.file, problem.key, problem.message)


def turn(boards: Boards, wall: Callable[[], WallNs], sleep: Sleep | None, most: Ns = 20 * MS) -> None:
    """Wait until something comes, is due, or `most` is over; and deal with it. Events are left to the caller."""
    now, due = wall(), boards.deadline()
    left = most if due is None else min(max(due - now, 0), most)
    readable, writable = (sleep or _sleep)(boards.reading(), boards.writing(), left / SECOND)
    now = wall()
    for descriptor in readable:
        boards.receive(descriptor, now)
    for descriptor in writable:
        boards.flush(descriptor, now)
    boards.due(now, wall)


def _sleep(readers: Sequence[int], writers: Sequence[int], seconds: float) -> tuple[Sequence[int], Sequence[int]]:
    readable, writable, _ = select.select(readers, writers, (), seconds)
    return readable, writable
