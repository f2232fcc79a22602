"""A whole run on a machine: references, trials, what goes wrong between, and what has been shown in the end."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from detent.hosts.errors import DriverError
from detent.hosts.exchange import Steps
from detent.motors.chance import bound
from detent.moves.law import Law, Values
from detent.moves.spelling import spelled
from detent.tuner.machine.bench import Bench
from detent.tuner.machine.carriage import Carriage, MachineError, Room
from detent.tuner.machine.recipe import Found, Recipe, RecipeError, Trial, recipe


class OtherRun(MachineError):
    """A log that is none of this plan; nothing goes on from it."""


class NothingToShip(MachineError):
    """The trials have come to their end without a setting to ship: nothing goes on from their log either."""


MISHAPS = 3  # broken trials in a row that are made again
TRIALS, CONFIRM = 3, 59

Record = Mapping[str, Any]
"""A line of the log: plain JSON."""


@dataclass(frozen=True)
class Plan:
    """What is tried. `begin` are settings that are safe, `moves` one-way distances in steps.

    `reserve` None is that of the knob. MachineError for what cannot be tried in this room.
    """

    law: Law
    begin: Values
    moves: tuple[int, ...]
    room: Room
    trials: int = TRIALS
    confirm: int = CONFIRM
    reserve: float | None = None

    def __post_init__(self) -> None:
        problem = self.room.problem(self.moves) if self.moves else "give a move or more"
        if problem:
            raise MachineError(problem)
        if max(self.moves) > self.law.most:
            raise MachineError(f"a {self.law.model} moves at most {self.law.most} steps at once")
        if self.trials < 1 or self.confirm < 1:
            raise MachineError("a setting is tried once or more, and so is the one to ship")
        if self.reserve is not None and not 1 <= self.reserve <= 100:
            raise MachineError(f"a reserve is a factor of 1 to 100, not {self.reserve:g}")

    def recorded(self, bench: Bench) -> dict[str, Any]:
        """The first line of the log. A run goes on from another only if this is the same."""
        room = asdict(self)["room"]
        return {
            "kind": "plan", "model": self.law.model, "begin": dict(self.begin), "moves": list(self.moves),
            "room": dict(zip(self.room._fields[:-1], room, strict=False)), "knob": bench.knob.name, "away": bench.away,
            "trials": self.trials, "confirm": self.confirm, "reserve": self.reserve or bench.knob.reserve,
        }  # fmt: skip

    def recipe(self, bench: Bench) -> Recipe:
        """The trials, from the beginning."""
        return recipe(
            bench.knob,
            bench.knob.gentlest(self.begin),
            self.moves,
            trials=self.trials,
            confirm=self.confirm,
            reserve=self.reserve,
        )


@dataclass(frozen=True)
class Result:
    """What a run has shown. `best` and `shipped` are settings, `trials` all that were made, lost ones among them."""

    found: Found
    best: Values
    shipped: Values
    trials: int
    lost: int

    @property
    def rate(self) -> float:
        """What the clean trials of the shipped setting prove of the rate of losses, at 95 %, on that day."""
        return bound(0, self.found.clean, looks=self.found.looks)


def replayed(plan: Plan, bench: Bench, past: Iterable[Record]) -> tuple[Recipe, Trial | Found, int, int]:
    """The recipe with the trials of a log in it: itself, what comes next, how many trials there were, and losses.

    OtherRun where the log is not that of this plan, NothingToShip where that has ended so.
    """
    made = plan.recipe(bench)
    records = iter(past)
    first = next(records, None)
    if first is not None:
        _same(first, plan.recorded(bench))
    count = losses = 0
    ahead: Trial | Found = next(made)
    for record in records:
        if record.get("kind") != "trial":
            continue
        lost, which = record.get("lost"), (record.get("knob"), record.get("steps"))
        if not isinstance(ahead, Trial) or which != (ahead.knob, ahead.steps) or not isinstance(lost, bool):
            raise OtherRun(f"trial {count + 1} of the log is not one of this plan: begin with another log")
        count += 1
        losses += lost
        ahead = _sent(made, lost)
    return made, ahead, count, losses


def _sent(made: Recipe, lost: bool) -> Trial | Found:
    try:
        return made.send(lost)
    except StopIteration as end:
        found: Found = end.value
        return found
    except RecipeError as error:
        raise NothingToShip(str(error)) from None


def _same(there: Record, here: Record) -> None:
    wrong = [name for name in here if there.get(name) != here[name]]
    if wrong:
        told = ", ".join(f"{name} was {there.get(name)!r} and is {here[name]!r}" for name in wrong)
        raise OtherRun(f"the log is of another run: {told}. Give it the same, or another --log")


def run(plan: Plan, bench: Bench, record: Callable[[Record], object], past: Iterable[Record] = ()) -> Steps[Result]:
    """Carry out a plan, or go on with it where the log `past` ends. `record` is given each line as it happens.

    The axis stands when it returns or raises MachineError; after a DriverError nobody knows (but no motion is longer
    than one move).
    """
    made, ahead, count, losses = replayed(plan, bench, past)
    if isinstance(ahead, Trial):
        carriage = Carriage(bench, plan.room, lambda zeros: record({"kind": "reference", "counts": list(zeros)}))
        yield from carriage.begin()
        yield from _slow_round(carriage, max(plan.moves))
    while isinstance(ahead, Trial):
        record({"kind": "begins", "number": count + 1, "knob": ahead.knob, "steps": ahead.steps})
        values = bench.knob.set(plan.begin, ahead.knob)
        early = yield from _tried(carriage, plan, ahead, values, record)
        if early < -plan.room.tolerance:  # on the way back, perhaps, of which the settings know nothing
            yield from _after_a_loss(carriage, plan, ahead, early, record)
            early = yield from _tried(carriage, plan, ahead, values, record)
        lost = abs(early) > plan.room.tolerance
        count += 1
        losses += lost
        record({
            "kind": "trial", "number": count, "knob": ahead.knob, "settings": spelled(plan.law, values),
            "steps": ahead.steps, "early": early, "lost": lost, "confirms": ahead.confirms,
        })  # fmt: skip
        if lost:
            yield from _after_a_loss(carriage, plan, ahead, early, record)
        ahead = _sent(made, lost)
    shipped = bench.knob.set(plan.begin, ahead.shipped)
    result = Result(ahead, bench.knob.set(plan.begin, ahead.good), shipped, count, losses)
    record({"kind": "end", **ahead._asdict(), "settings": spelled(plan.law, shipped), "below": result.rate})
    yield from bench.settings(shipped)
    return result


def left_safe(plan: Plan, bench: Bench) -> Steps[None]:
    """After a run that did not come to its end: stand, and have the settings with which it began.

    Those of a trial may be too hard for a longer move, and those of the way back are as slow as it was.
    """
    yield from bench.end()
    yield from bench.settings(plan.begin)


def _tried(
    carriage: Carriage, plan: Plan, trial: Trial, values: Values, record: Callable[[Record], object]
) -> Steps[int]:
    """A trial, made again when the line or the unit failed in it."""
    seconds = (plan.law.train(values, trial.steps).duration or 0) * 1e-9
    for left in reversed(range(MISHAPS + 1)):
        try:
            return (yield from carriage.out_and_back(trial.steps, values, seconds))
        except DriverError as error:
            record({"kind": "mishap", "what": str(error), "knob": trial.knob})
            if not left:
                yield from carriage.bench.end()
                raise
        yield from carriage.recover()
    raise AssertionError("the last try returned or raised")


def _after_a_loss(
    carriage: Carriage, plan: Plan, trial: Trial, early: int, record: Callable[[Record], object]
) -> Steps[None]:
    """A new reference; where lost steps would not make such a difference, see whether the witness is to be trusted."""
    yield from carriage.reference()
    room = plan.room
    off = (early + room.turn // 2) % room.turn - room.turn // 2
    if early < 0 or abs(off) > max(room.turn // 4, room.fine):
        why = "closed late" if early < 0 else f"is {early} steps off, no whole number of {room.turn}"
        record({"kind": "doubt", "what": f"the witness {why}", "early": early})
        yield from _slow_round(carriage, trial.steps, f"The witness {why} after a trial, and ")


def _slow_round(carriage: Carriage, steps: int, why: str = "") -> Steps[None]:
    """Out and back slowly: nothing may be lost. So the travel is known to be free, and the way back to be safe."""
    early = yield from carriage.out_and_back(steps)
    if abs(early) > carriage.room.tolerance:
        raise MachineError(
            f"{why}{steps} steps out and back at {carriage.room.rate} steps/s end {early:+d} steps off. So a slow move "
            "loses steps, the travel is not free, or coupling or switch slips. Mend that, or give another --safe-rate"
        )
