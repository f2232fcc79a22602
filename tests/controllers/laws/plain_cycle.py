"""Slow, plain models of the cycles in which the manuals let a program run: instruction by instruction, no scheduler.

They are told when the motor stepped and how the inputs were, and say when each instruction is reached. The times are
those of the manuals' pages; nothing here looks at the controllers.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from detent.pins import HIGH, LOW, Level
from detent.ticks import MS, US, Ns

NEVER = 1 << 62


class Steps(NamedTuple):
    """What the motor did: the time and place of each step, and the motions, each from its begin to its last step."""

    times: Sequence[Ns]
    places: Sequence[int]
    motions: Sequence[tuple[Ns, Ns]]

    def rest(self, now: Ns) -> Ns:
        """When the motion that is under way at `now` is over; `now` at rest."""
        return next((end for begin, end in self.motions if begin <= now < end), now)


class Input(NamedTuple):
    """How an input was: the times at which it changed, beginning with HIGH."""

    changes: Sequence[Ns]

    def at(self, now: Ns) -> Level:
        """Its level just before `now`."""
        return LOW if (bisect_right(self.changes, now - 1)) % 2 else HIGH

    def next(self, now: Ns, level: Level) -> Ns:
        """When it is at `level`, from `now` on."""
        if self.at(now + 1) == level:
            return now
        return next((change for change in self.changes if change > now), NEVER)


class Line(NamedTuple):
    """An instruction: where it stands, its letter and numbers."""

    address: int
    letter: str
    numbers: tuple[int, ...]


class Smc:
    """The program of a DCB-274 (pages 27, 29, 32, 44, 49, 51): fetch, wait for the action before, execute.

    A trip is a step that makes the position that T names. Its routine is called between instructions and in waits, and
    not again before it has returned.
    """

    LENGTHS: Mapping[str, int] = {
        "+": 4,
        "-": 4,
        "W": 3,
        "A": 2,
        "T": 5,
        "L": 4,
        "J": 4,
        "K": 3,
        "I": 3,
        "k": 5,
        "i": 5,
    }
    TIMES: Mapping[str, Ns] = {"+": 7500 * US, "-": 7500 * US, "L": 2500 * US, "I": 3500 * US}
    OTHERS: Ns = 500 * US

    def __init__(self, lines: Mapping[int, Line], steps: Steps, port: Input, until: Ns) -> None:
        self.lines, self.steps, self.port, self.until = lines, steps, port, until
        self.reached: list[tuple[Ns, int]] = []
        self.done: list[tuple[Ns, Line]] = []  # when the time of each was over
        self._trip: int | None = None
        self._vector = 0
        self._looked: Ns = 0
        self._called = 0
        self._in_routine = False
        self._rounds: int | None = None

    def run(self, start: Ns) -> list[tuple[Ns, int]]:
        """When each instruction is reached, from the fetch at `start` on."""
        now = self._program(0, start)
        if now < self.until:
            self._wait(now, self.steps.rest(now))
        return [(at, address) for at, address in self.reached if at <= self.until]

    def _program(self, address: int, now: Ns) -> Ns:
        """From `address` to FFh; when that has been fetched."""
        fetched = False
        while now <= self.until:
            line = self.lines.get(address)
            if not fetched:
                now += self._fetching(address, 1 if line is None else self.LENGTHS[line.letter])
            if line is None:
                return now
            self.reached.append((now, address))
            if line.letter in "+-" and self.steps.rest(now) > now:
                now = self._wait(now, self.steps.rest(now))
            now += self.TIMES.get(line.letter, self.OTHERS)
            now, after, fetched = self._do(line, now)
            served = self._serve(now)
            fetched = fetched and served == now
            address, now = after, served
        return now

    def _fetching(self, address: int, length: int) -> Ns:
        """1 ms for each byte in NV memory, none in RAM; the end mark takes its time there as well."""
        nv = sum(not 128 <= byte < 192 for byte in range(address, address + length))
        return nv * MS if nv or address in self.lines else self.OTHERS

    def _do(self, line: Line, now: Ns) -> tuple[Ns, int, bool]:
        """What an instruction does when its time is over; the time, the next address, whether that is in hand."""
        behind = line.address + self.LENGTHS[line.letter]
        self.done.append((now, line))
        match line.letter:
            case "W":
                now = self._wait(now, self.steps.rest(now))
                now = self._wait(now, now + 10 * MS * line.numbers[0])
            case "T":
                self._look(now)
                self._trip, self._vector = line.numbers
            case "J":
                self._rounds = line.numbers[1] if self._rounds is None else self._rounds
                if self._rounds:
                    self._rounds -= 1
                    return now, line.numbers[0], False
                self._rounds = None
            case "L":
                target, condition = line.numbers
                wanted = LOW if condition % 2 == 0 else HIGH
                if target == 2048:
                    if self.port.at(now) != wanted:
                        now = self._wait_for(now, wanted)
                elif self.port.at(now) != wanted:
                    return now, target, target == line.address
        return now, behind, False

    # -- waits and trips ---------------------------------------------------------------------------------

    def _look(self, now: Ns) -> None:
        """A step up to `now` may have made the position."""
        if self._trip is not None and self._vector and self._next_trip(now) <= now:
            self._called = self._vector
        self._looked = max(self._looked, now)

    def _next_trip(self, until: Ns) -> Ns:
        """The next step that makes the position, behind what has been looked at."""
        if self._trip is None or not self._vector:
            return NEVER
        first = bisect_right(self.steps.times, self._looked)
        last = bisect_right(self.steps.times, until)
        return next((self.steps.times[n] for n in range(first, last) if self.steps.places[n] == self._trip), NEVER)

    def _serve(self, now: Ns) -> Ns:
        """Call the routine if a trip has come; when it has returned."""
        self._look(now)
        while self._called and not self._in_routine and now <= self.until:
            vector, self._called = self._called, 0
            self._in_routine = True
            now = self._program(vector, now)
            self._in_routine = False
            self._look(now)
        return now

    def _wait(self, now: Ns, end: Ns) -> Ns:
        """Nothing to do until `end`, but for trips."""
        now = self._serve(now)
        while now < end and not self._in_routine:
            trip = self._next_trip(end)
            if trip > end:
                break
            now = self._serve(trip)
        return max(now, end)

    def _wait_for(self, now: Ns, level: Level) -> Ns:
        """A tight loop at one instruction: it sees every change of the port."""
        now = self._serve(now)
        while now <= self.until:
            met = self.port.next(now, level)
            trip = self._next_trip(met)
            if trip >= met:
                return met
            now = self._serve(trip)
        return now


def outputs(done: Sequence[tuple[Ns, Line]], chain: Mapping[int, Line], steps: Steps) -> list[tuple[Ns, int]]:
    """What a DCB-274 writes to its ports: by A, k and i that were executed, and by what stands at 128 (pages 42, 43).

    "k 200 8": the ports now, a trip at 200, and the special program counter at 128. When the position matches, the
    command there is carried out at that very step if it is a k, which advances the counter by its 5 bytes, or an i,
    which makes the position zero and begins at 128 again; anything else ends it.
    """
    written: list[tuple[Ns, int]] = []
    origin, trip, counter = 0, None, 128
    begun = [(at, 1, line, 0) for at, line in done if line.letter in "Aki"]
    made = [(at, 0, None, place) for at, place in zip(steps.times, steps.places, strict=True)]
    place = 0
    for at, _, line, there in sorted(begun + made, key=lambda event: event[:2]):
        if line is None:
            place = there
            if trip is None or place - origin != trip:
                continue
            line, counter = chain.get(counter), counter + 5
            if line is None or line.letter not in "ki":
                trip = None
                continue
        elif line.letter in "ki":
            counter = 128
        written.append((at, line.numbers[-1]))
        if line.letter == "i":
            origin, counter = place, 128
        if line.letter in "ki":
            trip = line.numbers[0]
    return written


class Simple:
    """The program of a GS-C200 (datasheet, commands A to jc): each instruction takes its time and a millisecond."""

    LENGTHS: Mapping[str, int] = {"+": 4, "-": 4, "A": 2, "C": 2, "D": 2, "L": 2, "U": 2, "W": 2, "j": 2, "jc": 2}

    def __init__(self, lines: Mapping[int, Line], steps: Steps, inputs: Mapping[int, Input], until: Ns) -> None:
        self.lines, self.steps, self.inputs, self.until = lines, steps, inputs, until

    def run(self, now: Ns) -> list[tuple[Ns, int]]:
        """When each instruction is reached, from E at `now` on."""
        reached: list[tuple[Ns, int]] = []
        address, mark, rounds = 0, 0, 1
        while now <= self.until and (line := self.lines.get(address)) is not None:
            reached.append((now, address))
            address += self.LENGTHS[line.letter]
            match line.letter, *line.numbers:
                case "D", tenths:
                    now += tenths * 100 * MS
                case "W", pin:
                    now = self.inputs[pin].next(now, HIGH) if self.inputs[pin].at(now) == LOW else now
                case "U", pin:
                    address = 0 if self.inputs[pin].at(now) == HIGH and line.address else address
                case "L", 0:
                    mark, rounds = address, 1
                case "L", times:
                    address, rounds = (mark, rounds + 1) if rounds < times else (address, 1)
                case (("+" | "-"), _):
                    now = self.steps.rest(now)
                case "j", target:
                    address = target
                case "jc", value, target:
                    weights = sum(self.inputs[pin].at(now) << pin - 1 for pin in (1, 2, 3))
                    address = target if weights == value else address
            now += 1 * MS
        return [(at, place) for at, place in reached if at <= self.until]
