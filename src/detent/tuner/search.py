"""Best first: points in the order of their time, each against counter-examples, until one survives them all.

The time of a point follows from its pulses, so the first point that survives is the fastest on the grid that does.
What survives meets fresh variants; those that it loses join the counter-examples, which only grow: a point that is
lost stays lost. A survivor at an end of the grid widens it, and each has its neighbourhood looked at between the
points of the grid. Last comes a look at variants that nobody has met, all corners among them, with a finer substep:
what that proves, the number of such looks counted, is what is said of the answer.
"""

import heapq
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

from detent.motors import chance
from detent.motors.motor import MotorError
from detent.motors.variants import percent
from detent.tuner.grid import Dimension, points
from detent.tuner.judge import Job, Judge, Lost, Runner, judge_of, one_by_one
from detent.tuner.spaces import Point, Profile
from detent.tuner.task import NOMINAL, Task, TunerError, check_installed

AT_FIRST = 16  # draws among the counter-examples
ADDED = 8  # losers of one look that join them
BLOCK = 256  # fresh variants that are looked at together
SLICE = 512  # of the final look, a job each
PROBES = 12
MOST_WIDENED = 24  # times
AHEAD = 1  # points judged at once by a runner that says nothing else


class Progress(NamedTuple):
    """How far a search is: points that are settled of about so many, and the fastest known to be lossless so far."""

    done: int
    total: int
    best: float | None  # s, all moves
    doing: str


Watch = Callable[[Progress], None]
Cancelled = Callable[[], bool]


class Check(NamedTuple):
    """What is known of a point: fresh variants and corners judged, how many lose a step, how often it was looked."""

    variants: int
    lost: int
    corners: int
    corners_lost: int
    looks: int
    met: int  # counter-examples and screened variants that it survives besides

    @property
    def bound(self) -> float:
        """The rate of losses is below this with 95 % confidence; 1 where no fresh variant was judged."""
        return chance.bound(self.lost, self.variants, looks=self.looks) if self.variants else 1.0

    def __str__(self) -> str:
        corners = f" and of {self.corners} corners" if self.corners else ""
        if not self.variants:
            every = f"all {self.corners} corners and " if self.corners else ""
            return f"survives {self.met} variants, among them {every}all that other settings lost; no fresh ones yet"
        if self.lost == self.corners_lost:
            what = f"{self.lost} of {self.variants}{corners} lost"
        else:
            what = f"{self.lost} of {self.variants} and {self.corners_lost} of {self.corners} corners lost"
        looks = "" if self.looks == 1 else f", {self.looks} looks counted"
        return f"{what}: less than {percent(self.bound)} at 95 %{looks}"


class Found(NamedTuple):
    """The answer of a search. `whole` is false where it was stopped: then it is the best that was known."""

    point: Point
    profile: Profile
    times: tuple[float, ...]  # s of each move
    time: float  # s of all, each as often as it is made
    check: Check
    whole: bool
    tested: int  # points that were judged
    examples: tuple[int, ...]  # the counter-examples in the end


@dataclass
class _Agenda:
    """Points by time. Where times are dear a point comes first with a time that it cannot be below."""

    judge: Judge
    dimensions: list[Dimension]
    heap: list[tuple[float, bool, Point]] = field(default_factory=list)
    known: set[Point] = field(default_factory=set)

    def add(self, parts: Sequence[Sequence[int]]) -> None:
        """Every combination that may be, and is not known yet."""
        space = self.judge.space
        for point in points(parts):
            if point in self.known or not space.admits(point):
                continue
            self.known.add(point)
            if space.least is None:
                self._exact(point)
            else:
                least = sum(time * move.weight
                            for time, move in zip(space.least(point), self.judge.task.moves, strict=True))  # fmt: skip
                if least < float("inf"):
                    heapq.heappush(self.heap, (least, False, point))

    def back(self, time: float, point: Point) -> None:
        """A point that is not settled yet."""
        heapq.heappush(self.heap, (time, True, point))

    def next(self) -> tuple[float, Point] | None:
        """The fastest; None if there is none left."""
        while self.heap:
            time, is_exact, point = heapq.heappop(self.heap)
            if is_exact:
                return time, point
            self._exact(point)
        return None

    def _exact(self, point: Point) -> None:
        time = self.judge.time(point)
        if time is not None:
            heapq.heappush(self.heap, (time, True, point))


def nobody(_: Progress) -> None:
    """A watch that looks away."""


def never() -> bool:
    """Go on."""
    return False


class Stopped(TunerError):
    """Cancelled before any lossless point was known."""


def search(
    task: Task, *, run: Runner = one_by_one, ahead: int = AHEAD, watch: Watch = nobody, cancelled: Cancelled = never
) -> Found:
    """The fastest point that survives. `run` does the jobs, `ahead` of them at once; neither changes the answer.

    `cancelled` is asked between jobs; then the best so far is returned, or Stopped raised where there is none.
    TunerError where no point survives, MissingExtra where it would take hours.
    """
    check_installed()
    return _Search(task, run, max(ahead, 1), watch, cancelled).whole()


class _Cancelled(Exception):
    pass


class _Search:
    def __init__(self, task: Task, run: Runner, ahead: int, watch: Watch, cancelled: Cancelled) -> None:
        self.task, self.run, self.ahead, self.watch, self.cancelled = task, run, ahead, watch, cancelled
        self.judge = judge_of(task)
        self.examples = [NOMINAL, *task.corners, *task.drawn(0, AT_FIRST)]
        self.drawn = AT_FIRST
        self.looks = self.settled = self.tested = self.total = self.widened = 0
        self.known: list[tuple[float, Point]] = []  # what has survived all that it was asked, the fastest first
        self.last_lost: tuple[Point, int] | None = None
        self.agenda = _Agenda(self.judge, list(self.judge.space.dimensions))

    def whole(self) -> Found:
        try:
            self.agenda.add([dimension.values for dimension in self.agenda.dimensions])
            self.probe()
            return self.go()
        except _Cancelled:
            examples = tuple(self.examples)
            for _, point in self.known:  # others have lost something since it was asked
                if not any(self.run(self.task, [Job(point, examples)])):
                    check = Check(0, 0, len(self.task.corners), 0, max(self.looks, 1), len(examples))
                    return self.found(point, check, whole=False)
            raise Stopped("stopped before any setting without loss was known") from None

    def go(self) -> Found:
        expanded: set[Point] = set()
        while (survivor := self.survivor()) is not None:
            time, point = survivor
            if point not in expanded:
                if losers := self.screened(point):
                    self.learn(point, losers)
                    continue
                self.note(time, point)
                expanded.add(point)
                self.expand(point)
                self.agenda.back(time, point)
                continue
            lost = self.final(point)
            if not lost:
                check = Check(self.task.final, 0, len(self.task.corners), 0, self.looks, len(self.examples))
                return self.found(point, check, whole=True)
            self.learn(point, lost)
        raise TunerError(self.why_none())

    def survivor(self) -> tuple[float, Point] | None:
        """The next point that no counter-example loses; those before it are settled."""
        while True:
            batch: list[tuple[float, Point]] = []
            while len(batch) < self.ahead and (entry := self.agenda.next()) is not None:
                batch.append(entry)
            if not batch:
                return None
            examples = tuple(self.examples)
            answers = self.answers([Job(point, examples) for _, point in batch])
            found = None
            for (time, point), lost in zip(batch, answers, strict=True):
                if lost:
                    self.settle(point, lost[0])
                    if found is None:  # what loses often is asked first: it saves time, and changes nothing
                        self.examples.remove(lost[0])
                        self.examples.insert(0, lost[0])
                elif found is None:
                    found = time, point
                else:
                    self.agenda.back(time, point)
            self.tell(batch[-1][0])
            if found is not None:
                return found

    def screened(self, point: Point) -> Lost:
        """The first losers among fresh variants, none if it makes all of them."""
        left = self.task.screened
        while left > 0:
            count = min(BLOCK, left)
            variants = self.fresh(count)
            left -= count
            (lost,) = self.answers([Job(point, variants, to_the_end=True)])
            if lost:
                return lost
        return ()

    def final(self, point: Point) -> Lost:
        """The losers of the look that counts: fresh variants and all corners, with the finer substep."""
        self.looks += 1
        variants = (*self.task.corners, *self.fresh(self.task.final))
        jobs = [Job(point, variants[k : k + SLICE], to_the_end=True, fine=True)
                for k in range(0, len(variants), SLICE)]  # fmt: skip
        return tuple(loser for lost in self.answers(jobs) for loser in lost)

    def expand(self, point: Point) -> None:
        """Widen the grid where the point is at its end; look between the grid's points about it."""
        dimensions = self.agenda.dimensions
        if not self.task.refined:
            return
        for k, value in enumerate(point):
            if self.widened >= MOST_WIDENED:
                break
            dimensions[k], added = dimensions[k].wider(value)
            if added:
                self.widened += 1
                parts = [dimension.values for dimension in dimensions]
                parts[k] = added
                self.agenda.add(parts)
        self.agenda.add([dimension.near(value) for dimension, value in zip(dimensions, point, strict=True)])

    def probe(self) -> None:
        """A bisection that guesses how many points will be asked, and finds a lossless one; it decides nothing."""
        order = sorted(self.agenda.heap)
        low, high = 0, len(order)
        for _ in range(PROBES):
            if low >= high:
                break
            middle = (low + high) // 2 if self.known else (low + 3 * high) // 4
            point = order[middle][2]
            time = self.judge.time(point)
            if time is not None and not self.answers([Job(point, tuple(self.examples))])[0]:
                self.note(time, point)
                high = middle
            else:
                low = middle + 1
            self.total = high
            self.tell(None)

    def answers(self, jobs: Sequence[Job]) -> list[Lost]:
        if self.cancelled():
            raise _Cancelled
        self.tested += len(jobs)
        found = []
        for lost in self.run(self.task, jobs):
            found.append(lost)
            if self.cancelled():
                raise _Cancelled
        return found

    def learn(self, point: Point, losers: Lost) -> None:
        """The point is lost; what lost it joins the counter-examples."""
        self.settle(point, losers[0])
        self.examples += [loser for loser in losers if loser not in set(self.examples)][:ADDED]

    def settle(self, point: Point, loser: int) -> None:
        """The point is lost."""
        self.settled += 1
        self.last_lost = point, loser
        self.known = [entry for entry in self.known if entry[1] != point]

    def note(self, time: float, point: Point) -> None:
        self.known = sorted({*self.known, (time, point)})

    def fresh(self, count: int) -> tuple[int, ...]:
        """Draws that nobody has met."""
        self.drawn += count
        return self.task.drawn(self.drawn - count, count)

    def tell(self, at: float | None) -> None:
        self.total = max(self.total, self.settled)
        doing = "looking about" if at is None else f"at {at:.4g} s"
        self.watch(Progress(self.settled, self.total, self.known[0][0] if self.known else None, doing))

    def found(self, point: Point, check: Check, *, whole: bool) -> Found:
        trains, times = self.judge.trains(point), self.judge.times(point)
        time = self.judge.time(point)
        assert trains is not None
        assert times is not None
        assert time is not None
        return Found(point, trains[0], times, time, check, whole, self.tested, tuple(self.examples))

    def why_none(self) -> str:
        words = "no settings on the grid make these moves without losing a step in some variant"
        if self.last_lost is None:
            return "there are no settings within what these commands take"
        from detent.motors.diagnosis import diagnose
        from detent.motors.variants import QUANTITIES, changed

        point, variant = self.last_lost
        found = self.judge.trains(point)
        assert found is not None
        factors = dict(zip(QUANTITIES, map(float, self.task.factors((variant,))[0]), strict=True))
        shown = ", ".join(f"{name} x{factor:.2f}" for name, factor in factors.items() if abs(factor - 1) > 5e-3)
        with suppress(MotorError):  # of a variant whose supply no longer drives the current there is no closer look
            rig = changed(self.task.rig_with(found[0].winding), **factors)
            for train in found[1]:
                if (loss := diagnose(train, rig)) is not None:
                    return f"{words}; the slowest, {found[0]}, with {shown or 'the rig as given'}: {loss}"
        return f"{words}; the slowest, {found[0]}, is lost with {shown or 'the rig as given'}"


def grid_points(judge: Judge) -> Iterator[tuple[float, Point]]:
    """All points of the grid with their times, the fastest first: what a search that tries everything goes through."""
    agenda = _Agenda(judge, list(judge.space.dimensions))
    agenda.add([dimension.values for dimension in agenda.dimensions])
    while (entry := agenda.next()) is not None:
        yield entry
