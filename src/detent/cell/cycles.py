"""A cell in production does the same again and again: whole rounds of that are passed over.

Where everything the cell is made of is, relative to the time, what it was one round ago (`cell.later`), whatever
follows is the same again, until something comes from outside. So the cell is put on by whole rounds, and the recording
is told one of them (`cell.rounds`). What is left of the last round is run through.

An axis may have come some way in a round, as long as nothing depends on where it stands (`detent.axis.Leeway`).

Which instants to compare is told by the longest time in which nothing happens: it comes back once in a round, or a few
times. For a while the longest is looked for, then a copy is kept behind the next such time, and those that follow are
held against it. The while is longer each time, so that a cell without rounds takes but a little more time. Where a
round is over, the next is listened to, and only then more of them are passed over.
"""

from collections.abc import Sequence
from typing import Any, Final

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.circuit import Circuit
from detent.cell.copying import duplicate
from detent.cell.later import Later
from detent.cell.recording import Entry, InputSet, Recording
from detent.cell.rounds import Rounds
from detent.controllers.device import DriveSet, Executing, Finished, StageSet
from detent.pins import PinSet
from detent.ticks import NEVER, Ns

FIRST, GROWS, MOST = 128, 4, 1 << 13  # instants in which the longest time is looked for, how much more, and at most
HOLDS = 4  # times as many may follow until the round is over
GLANCES, LOOKS = 32, 6  # how often a copy is held against the cell: at its deadlines and registers; at all of it
WORTH = 3  # rounds that are worth it

_PASSES: Final = frozenset((PinSet, InputSet, Executing, Finished, MotionStarted, MotionCut, MotionEnded))
_STANDS: Final = frozenset((StageSet, DriveSet))  # these as well, where the axis has come nowhere


class _Tap:
    """Stands in the place of a recording and keeps what it is told, which it passes on."""

    def __init__(self, recording: Recording | None) -> None:
        self.told: list[tuple[int, Sequence[Entry]]] = []
        self.recording = recording
        self.units = () if recording is None else recording.units

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Take note of what one unit did."""
        self.told.append((unit, entries))
        if self.recording is not None:
            self.recording.extend(unit, entries)


class _Kept:
    """The circuit as it was at `now`: what can be otherwise later, in copies; something was to come at `script`."""

    def __init__(self, circuit: Circuit, script: Ns) -> None:
        for part in circuit.parts:
            if hasattr(part, "leeway"):
                part.leeway.anew()
        self.now, self.script = circuit.now, script
        self.glance = _glance(circuit)
        self.made_of = duplicate(_made_of(circuit))


def _made_of(circuit: Circuit) -> list[Any]:
    """Everything in a circuit, but for what happens within an instant, and for when its parts are due."""
    return [
        circuit.parts, circuit.nets, circuit.lines, circuit.wiring, circuit.forced, circuit.stuck,
        circuit.failing_writes, circuit.inside,
    ]  # fmt: skip


def _glance(circuit: Circuit) -> list[Any]:
    """What is soon looked at, and often tells a cell from what it was."""
    now = circuit.now
    due = [NEVER if at >= NEVER else at - now for at in (*circuit.deadlines, circuit.line_deadline)]
    shown = [part.registers(now) for part in circuit.parts if hasattr(part, "registers")]
    return [due, shown]


class Cycles:
    """Looks for the round of a circuit that is run through, and passes over all that come before an end."""

    def __init__(self, circuit: Circuit) -> None:
        self._circuit = circuit
        # whoever runs the circuit lets `meet` know of times in which nothing happens, from that on
        self.longest: Ns = 0
        self._most: Ns = 0  # the longest that was met
        self._measures = FIRST
        self._left = FIRST  # instants until the while is over
        self._holds = False  # a copy is kept behind the next such time, or is held against the circuit
        self._kept: _Kept | None = None
        self._tap: _Tap | None = None  # while it is run through a round that is known for one
        self._glances = self._looks = 0
        if not all(hasattr(type(part), "INSTANTS") for part in circuit.parts):
            self.longest, self._left = NEVER, NEVER

    def passed(self, instants: int) -> None:
        """So many more instants were run through: take the next step, if it is time."""
        self._left -= instants
        if self._left > 0:
            return
        if self._holds:
            self.close()
            self._measures = min(GROWS * self._measures, MOST)
            self._holds, self._left = False, self._measures
            self.longest = self._most = 0
        else:  # the longest time is known: wait for it
            self._holds, self._left = True, HOLDS * self._measures
            self.longest = self._most
            self._glances, self._looks = GLANCES, LOOKS

    def again(self) -> None:
        """Something has come from outside, or time has leapt: begin anew."""
        if self._left >= NEVER:
            return
        self.close()
        self._holds = False
        self._measures = self._left = FIRST
        self.longest = self._most = 0

    def close(self) -> None:
        """Nothing is kept any more: the recording stands in its place again."""
        if self._tap is not None:
            self._circuit.recording, self._tap = self._tap.recording, None
        self._kept = None

    def meet(self, gap: Ns, until: Ns, script: Ns) -> bool:
        """Nothing happens for so long, from now on. Whether whole rounds were passed over, all before `until`.

        `script` is when something comes from outside.
        """
        circuit, kept = self._circuit, self._kept
        if not self._holds:
            self._most = gap
            self.longest = gap + 1
            return False
        if kept is None:
            self._kept = _Kept(circuit, script)
            return False
        if script != kept.script:
            self.again()  # something came from outside, which is part of no round
            return False
        until = min(until, script)
        period = circuit.now - kept.now
        rounds = (until - 1 - circuit.now) // period
        self._glances -= 1
        if self._glances < 0 or self._looks <= 0 or rounds < WORTH:
            self.longest = NEVER
        elif _glance(circuit) == kept.glance:
            self._looks -= 1
            return self._look(kept, period, rounds, script)
        return False

    def _look(self, kept: _Kept, period: Ns, rounds: int, script: Ns) -> bool:
        """Hold everything against what it was. If a round is over, the next is listened to, then more passed over."""
        circuit, tap = self._circuit, self._tap
        later = Later(period, circuit.now)
        growth: dict[int, int] = {}
        before, after = kept.made_of, _made_of(circuit)
        for number, (one, other) in enumerate(zip(before[0], after[0], strict=True)):
            if not later.alike(one, other):
                return False
            if any(later.growth):
                growth[number] = later.growth[0]
                rounds = min(rounds, self._room(number, later))
            later.growth.clear()
            later.places.clear()
        if not later.alike(before[1:], after[1:]):
            return False
        if tap is None:
            self._kept = _Kept(circuit, script)
            self._tap = _Tap(circuit.recording)
            circuit.recording = self._tap  # type: ignore[assignment]
            self._left += HOLDS * self._measures  # it may be a long one
            return False
        kinds = {type(entry) for _, entries in tap.told for entry in entries}
        if not kinds <= (_PASSES if growth else _PASSES | _STANDS) or rounds < WORTH:
            self.close()
            self.longest = NEVER
            return False
        later.forward(rounds)
        by = rounds * period
        circuit.deadlines[:] = [at if at >= NEVER else at + by for at in circuit.deadlines]
        if circuit.line_deadline < NEVER:
            circuit.line_deadline += by
        circuit.now += by
        self.again()
        if circuit.recording is not None:
            circuit.recording.turn(Rounds(tap.told, period, rounds, growth))
        return True

    def _room(self, number: int, found: Later) -> int:
        """How many rounds the axis of a part may go on as it has, without a difference to its controller."""
        part = self._circuit.parts[number]
        by = found.growth[0]
        if len(found.growth) > 1 or not hasattr(part, "leeway") or any(moved not in (0, by) for moved in found.places):
            return 0
        if all(moved == by for moved in found.places):
            return NEVER  # what it counts from has come along
        leeway = part.leeway
        room: int = leeway.forth if by > 0 else leeway.back
        return room // abs(by)
