"""A look at the wiring of a machine before a program runs: inputs live, and each axis jogged there and back.

No cell runs, and nothing moves until `jog` is called. While an axis is jogged the firmware itself stops it as soon as
any input of its unit changes: a switch that is met, or a hand on one.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from detent.axis import MotionEnded, MotionStarted
from detent.cell.description import Description
from detent.pulses import Train
from detent.pulses.uniform import Uniform
from detent.realtime.boards.drive import Opened
from detent.realtime.boards.events import CountDiffers, DriverFault, InputChanged, Lost, ShutDown, Stopped
from detent.realtime.boards.opening import turn
from detent.realtime.boards.plan import CYCLE, DrivenAxis
from detent.ticks import MS, SECOND, Ns, to_fixed

SLOW = 4  # seconds that a revolution takes
USUAL_STEPS = 200  # full steps of a revolution, where no motor is named
USUAL_MICROSTEPS = 2  # a plain driver in half steps
MOST_RATE = 2000  # steps/s: no ramp is driven
WAKING: Ns = 300 * MS  # from enabling a driver to the first step
ENDING: Ns = 60 * MS  # two reports of a stop
LEAD: Ns = 200 * MS  # nobody waits for a jog, and a busy computer is not late
PATIENCE: Ns = 3 * SECOND  # for the count, behind the last step


class Input(NamedTuple):
    """An input as it stands. `changes` since the boards were opened; `help` is the controller's own line about it."""

    unit: str
    pin: str
    board: str
    wire: str  # the pin of the board, with its signs
    level: int  # as the controller reads it
    changes: int
    help: str


class Met(NamedTuple):
    """While it was jogged an input took another level; the axis stood `steps` from where it began."""

    input: str
    level: int
    steps: int


class Leg(NamedTuple):
    """One way: what was asked, what the board counted, what was met, and why it ended early ("": it did not)."""

    direction: int
    asked: int
    made: int
    met: tuple[Met, ...]
    why: str


class Trouble(Exception):
    """The board cannot go on; nothing moves any more."""


class Check:
    """Boards that are open and ready, and what hangs on them. Whoever opened them closes them, with `end` first."""

    def __init__(self, opened: Opened, described: Description) -> None:
        self.plan, self._boards, self._stages, self._real = opened.plan, opened.boards, opened.stages, opened.real
        self._described = described
        self._levels = dict(opened.levels)
        self._changes = dict.fromkeys(self._levels, 0)
        self._boards.align(0, self._boards.ns_at(self._real.wall()))
        for stepper in self._boards.steppers.values():
            stepper.adopt(0)

    # -- inputs

    def inputs(self, helps: Mapping[tuple[str, str], str]) -> list[Input]:
        """Every input, in the order of the file. `helps`: what each is, by unit and pin."""
        wires = {entry.name: str(entry.pin) for setup, _ in self.plan.setups for entry in setup.inputs}
        return [
            Input(unit, pin, self.plan.board_of[name], wires[name], self._levels[name], self._changes[name],
                  helps.get((unit, pin), ""))
            for name, (unit, pin) in self.plan.inputs.items()
        ]  # fmt: skip

    def turn(self, most: Ns = 20 * MS) -> list[InputChanged]:
        """Wait for `most`, or until something comes: what changed. Raises Trouble."""
        return list(self._turn(most))

    def _turn(self, most: Ns = 20 * MS) -> Iterator[InputChanged]:
        self._heard: list[Stopped | CountDiffers] = []
        boards, wall = self._boards, self._real.wall
        wanted = boards.commit_at()
        now = wall()
        if wanted is not None and wanted <= now:
            boards.commit(boards.cell_at(now), now, wall)
        elif wanted is not None:
            most = min(most, wanted - now)
        turn(boards, wall, self._real.sleep, most)
        for event in boards.events():
            if isinstance(event, InputChanged):
                if self._levels[event.input] != int(event.level):
                    self._levels[event.input] = int(event.level)
                    self._changes[event.input] += 1
                    yield event
            elif isinstance(event, Stopped):
                self._heard.append(event)
                if event.input and self._levels[event.input] != int(event.present):
                    self._levels[event.input] = int(event.present)
                    self._changes[event.input] += 1
            elif isinstance(event, CountDiffers):
                self._heard.append(event)
            elif isinstance(event, ShutDown):
                raise Trouble(f"board {event.board} has shut down: {event.reason}")
            elif isinstance(event, Lost):
                raise Trouble(f"board {event.board} is gone: {event.reason}")
            elif isinstance(event, DriverFault):
                raise Trouble(f"{event.driver}: {event.reason}")

    # -- axes

    def revolution(self, axis: DrivenAxis) -> int:
        """Pulses of a turn of the motor: of the motor that the file names, or 200 full steps, and the microsteps."""
        full = USUAL_STEPS
        for motor in self._described.motors.values():
            if motor.unit == axis.unit and motor.axis in (None, "", axis.axis):
                full = round(float(motor.data.get("steps", full)))
        stage = self._stages.get(axis.stepper)
        microsteps = USUAL_MICROSTEPS if stage is None or not stage.places else max(CYCLE // abs(stage.places), 1)
        return full * microsteps

    def guards(self, axis: DrivenAxis) -> dict[str, int]:
        """The inputs that stop a jog when they change, by their names on the board, as they are now."""
        stops = next(s.stops for setup, _ in self.plan.setups for s in setup.steppers if s.name == axis.stepper)
        return {name: self._levels[name] for name in stops or ()}

    def jog(
        self, axis: DrivenAxis, steps: int, rate: int, aborted: Callable[[], bool] = lambda: False
    ) -> Iterator[Leg]:
        """`steps` pulses at `rate` a second in the plus direction, and back to where it began: a leg each.

        Its driver is enabled before and let go afterwards. `aborted` is asked all the time; if so, and at any
        error, every board stops at once. Raises Trouble.
        """
        boards = self._boards
        whole = False
        try:
            self._enable(axis, True)
            out = self._leg(axis, 1, steps, rate, frozenset(), aborted)
            yield out
            if out.made:
                yield self._leg(axis, -1, out.made, rate, frozenset(met.input for met in out.met), aborted)
            whole = True
            self._enable(axis, False)
        finally:
            if not whole:
                boards.emergency_stop(self._real.wall())

    def _enable(self, axis: DrivenAxis, on: bool) -> None:
        if axis.enable:
            self._boards.outputs[axis.enable].now(on)
        if axis.half and on:
            self._boards.outputs[axis.half].now(False)
        now = self._real.wall()
        self._boards.commit(self._boards.cell_at(now), now, self._real.wall)
        self._pass(WAKING if on and axis.enable else 50 * MS)

    def _pass(self, span: Ns) -> None:
        end = self._real.wall() + span
        while self._real.wall() < end:
            self.turn(5 * MS)

    def _leg(
        self, axis: DrivenAxis, direction: int, steps: int, rate: int, expected: frozenset[str],
        aborted: Callable[[], bool],
    ) -> Leg:  # fmt: skip
        boards, wall = self._boards, self._real.wall
        stepper = boards.steppers[axis.stepper]
        began = stepper.shaft
        now = boards.cell_at(wall())
        guards = {name: not level for name, level in self.guards(axis).items() if name not in expected}
        boards.stops[axis.stepper].arm(guards, now)
        train = Train((Uniform.at_rate(0, rate, steps),), to_fixed(now))
        ended = MotionEnded(train.time_of(steps), steps, axis.axis)
        motion = MotionStarted(now, train, 1, direction, began, axis.axis), ended
        for entry in motion:
            stepper.tell(entry)
        end = wall() + (steps * SECOND) // rate + self.plan.lead + PATIENCE
        met: list[Met] = []
        why, touched = "", ""
        ending: Ns | None = None  # a stop on the last step is heard of later
        while ending is None or wall() < ending:
            if aborted():
                raise Trouble("stopped by hand; the boards are shut down, and their outputs off")
            for event in self._turn(5 * MS):
                gone = train.steps_by(boards.cell_at(wall()) - self.plan.lead)
                met.append(Met(event.input, int(event.level), gone))
                if guards.get(event.input) is event.level:
                    touched = touched or event.input
            if touched and not why and boards.stops[axis.stepper].alive:  # it came and went before the first step
                boards.stops[axis.stepper].now()
            for heard in self._heard:
                if isinstance(heard, Stopped) and heard.stepper == axis.stepper and heard.dry:
                    stepper.rewind(heard.shaft, slipped=True)  # they were late, and come later
                    boards.stops[axis.stepper].arm(guards, now)
                    for entry in motion:
                        stepper.tell(entry)
                elif isinstance(heard, Stopped) and heard.stepper == axis.stepper:
                    made, name = abs(heard.shaft - began), heard.input or touched
                    level = int(heard.level if heard.input else guards[touched])
                    met = [one for one in met if one.input != name]  # this is where it was, exactly
                    met.append(Met(name, level, made))
                    stepper.rewind(heard.shaft)
                    why = f"{name} changed to {level}"
                elif isinstance(heard, CountDiffers):
                    raise Trouble(
                        f"{axis.stepper}: the board has counted {heard.counted} where {heard.shaft} were sent"
                    )
            over = stepper.over(wall()) and not stepper.proving and not boards.stops[axis.stepper].firing
            if ending is None and over:
                boards.stops[axis.stepper].disarm()
                ending = wall() + ENDING
            if wall() > end:
                raise Trouble(f"{axis.stepper}: its steps did not come in time")
        return Leg(direction, steps, abs(stepper.shaft - began), tuple(met), why)

    def end(self) -> None:
        """Drivers are let go."""
        for axis in self.plan.axes:
            if axis.enable and not self._boards.outputs[axis.enable].dead:
                self._boards.outputs[axis.enable].now(False)
        now = self._real.wall()
        self._boards.commit(self._boards.cell_at(now), now, self._real.wall)
