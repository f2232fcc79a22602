"""A cell file with real pins, from opening its boards to letting go of them: what a service needs of all this."""

import gc
import os
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Description
from detent.outputs.steps import Error, Runs, Scale
from detent.pins import Level
from detent.pulses import Train, Uniform
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.driven import Driven
from detent.realtime.boards.opening import Sleep, boards_of, make_ready, set_drivers, turn
from detent.realtime.boards.plan import Plan, plan
from detent.realtime.boards.port import Port
from detent.realtime.boards.ports import open_port
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.stages import check_moves, stages
from detent.realtime.boards.states import News
from detent.realtime.boards.stepper import LONGEST
from detent.realtime.boards.warming import first_moves
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, SECOND, Ns

ENDING: WallNs = SECOND  # for the last steps to leave, and for boards to hear of the end; each
PAUSE: WallNs = 5 * MS
PRIORITY = 20  # of the real-time class: above most, below what the system keeps for itself


class RealPins(NamedTuple):
    """That a service drives the boards of its cell: whom it tells what people should know, and what opens ports.

    `wall` and `sleep` are the clock and the waiting of the host; tests have others.
    """

    tell: Callable[[News], None]
    open_port: Callable[[str], Port] = open_port
    wall: Callable[[], WallNs] = time.monotonic_ns
    sleep: Sleep | None = None


class Opened:
    """The boards of a cell, ready, before there is a cell. `inputs` are what their inputs are at, by UNIT and PIN."""

    def __init__(
        self, described: Description, read: Callable[[str], str], real: RealPins, *, least_lead: Ns = 0
    ) -> None:
        """Open them. Raises Problem. Nothing moves, and no output but those with a level at rest changes.

        `least_lead` is for whoever has time: a busy computer is not late then.
        """
        self._real = real
        trial = build(described, read)
        self.plan: Plan = plan(described, trial.controllers(), least_lead)
        self.stages = stages(self.plan, trial)
        """What the power stage of each stepper is told at first."""
        check_moves(self.plan, first_moves(described))
        self.boards: Boards = boards_of(self.plan, real.open_port)
        try:
            self._levels: dict[str, Level] = make_ready(self.boards, self.plan, real.wall, real.sleep)
            set_drivers(self.boards, self.plan, self.stages, real.wall, real.sleep)
            _warm_up(self.plan.setups[0][0].error)
        except BaseException:
            self.boards.close()
            raise

    @property
    def levels(self) -> Mapping[str, Level]:
        """The levels of all real inputs when the boards were opened, by their names on the boards."""
        return self._levels

    @property
    def real(self) -> RealPins:
        """With what they were opened."""
        return self._real

    @property
    def inputs(self) -> Mapping[tuple[str, str], Level]:
        """The levels of all real inputs, by unit and pin."""
        return {self.plan.inputs[name]: level for name, level in self._levels.items()}

    def drive(self, cell: Cell, stores: HeldStores) -> Driven:
        """The cell, which was built with `inputs`, behind its pins; `begin` lets it begin."""
        return Driven(cell, self.boards, self.plan, stores, wall=self._real.wall, tell=self._real.tell)

    def begin(self, driven: Driven, pace: Pace) -> None:
        """The cell's present is now; from here on pulses leave."""
        driven.on_moving = _no_collection_while
        driven.begin(pace, self._levels)

    def end(self, driven: Driven) -> None:
        """Let go of everything: motors stand first, then drivers and outputs fall, and each board has heard of it.

        A board that does not answer any more does so by itself, when its watchdog runs out.
        """
        driven.halt()
        self._until(driven.let_out)
        driven.close()
        self._until(lambda: self.boards.quiet)
        self.boards.close()

    def _until(self, done: Callable[[], bool]) -> None:
        begun = self._real.wall()
        for _ in range(ENDING // PAUSE):
            if done() or self._real.wall() - begun > ENDING:
                return
            turn(self.boards, self._real.wall, self._real.sleep, PAUSE)


def _warm_up(error: Error) -> None:
    """Do once what the first pulses need: the first time it takes some milliseconds, and a busy computer has none."""
    train = Train((Uniform.at_rate(0, 1000, 300),), 0)
    Runs(train, Scale(12_000_000), error, -1, longest=LONGEST).take()


def _no_collection_while(moving: bool) -> None:
    """A collection of garbage takes longer than a batch may be late: none while something moves."""
    if moving:
        gc.disable()
    else:
        gc.enable()


def take_priority() -> str:
    """Ask for real-time priority for this process; why not, if it may not, with the remedy, else nothing."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(PRIORITY))
    except PermissionError:
        return (
            "real-time priority is not allowed to this user: LimitRTPRIO=95 in its systemd unit, or "
            "`@group - rtprio 95` in /etc/security/limits.conf, allows it; serving without"
        )
    except (OSError, AttributeError) as error:
        return f"this system has no real-time priority ({error}); serving without"
    return ""
