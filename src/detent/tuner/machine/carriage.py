"""Where the carriage is, and how far it may go: references at the witness, and the way there and back.

Places are steps from where the witness closes, plus leads into the travel. The carriage is where the count says, or,
after a loss in a fast move out, nearer to the witness: so the way back is made in pieces that are shorter than the
room behind the witness, and the witness is looked at after each. No motion is begun whose pulses would lead out of the
room from `-behind` to `travel`.
"""

from collections.abc import Callable
from typing import NamedTuple

from detent.hosts.exchange import Steps
from detent.moves.law import Values
from detent.tuner.machine.bench import Bench

REFERENCES = 3  # approaches that must agree
PATIENCE = 3.0  # seconds beyond what a motion should take


class MachineError(RuntimeError):
    """The machine does not do what it should; nothing moves any more. The text says what was seen, and what to do."""


class Room(NamedTuple):
    """The axis in steps. `travel` is how far it may go from the witness, `behind` how far past where that closes.

    `turn` is an electrical turn (four full steps): steps are lost in whole ones of these. `rate` is a speed (steps/s)
    at which the motor surely starts and stops without a ramp. `approach` is how far from the witness the carriage may
    stand at the start, if it may stand clear of it.
    """

    travel: int
    behind: int
    turn: int
    rate: int
    approach: int = 0

    @property
    def clearance(self) -> int:
        """From where the witness opens to where trials begin."""
        return 3 * self.turn

    @property
    def fine(self) -> int:
        """Steps at once where a place is measured."""
        return max(self.turn // 8, 1)

    @property
    def coarse(self) -> int:
        """Steps at once on the way back: half of the room behind the witness."""
        return max(self.behind // 2, 1)

    @property
    def tolerance(self) -> int:
        """A difference beyond this is a loss: half of the least there is."""
        return max(self.turn // 2, 1)

    def problem(self, moves: tuple[int, ...]) -> str:
        """Why these moves cannot be tried in this room; nothing if they can."""
        need = max(moves) + self.clearance + 3 * self.turn
        if self.turn < 1 or self.rate < 1 or min(moves) < 1:
            return "moves, rates and turns are one or more"
        if self.behind < 2 * self.turn:
            return (
                f"{self.behind} steps of room behind the witness are too few: the switch must stay closed, and the "
                f"carriage be free, for {2 * self.turn} steps or more behind the place where it closes"
            )
        if self.travel < need:
            return (
                f"a move of {max(moves)} steps needs a travel of {need}, with what is kept free at both ends, and "
                f"there are {self.travel}: give a shorter move, or all of the travel there is"
            )
        return ""


class Carriage:
    """The carriage of a bench. Every generator leaves it standing, or raises MachineError or DriverError."""

    def __init__(self, bench: Bench, room: Room, told: Callable[[tuple[int, ...]], object] = lambda _: None) -> None:
        """`told` is given the counts of each reference."""
        self.bench, self.room, self._told = bench, room, told
        self._zero: int | None = None  # the count where the witness closes
        self._at = 0  # the count now

    # -- places ------------------------------------------------------------------------------------------

    @property
    def place(self) -> int:
        """Where it is by the count. Only with a reference."""
        assert self._zero is not None
        return self.bench.away * self.bench.between(self._zero, self._at)

    def _go(self, steps: int, timeout: float | None = None) -> Steps[int]:
        """Go by `steps` (plus: away from the witness) and what was made; less than asked only at a closed witness."""
        if self._zero is not None and not -self.room.behind <= self.place + steps <= self.room.travel:
            raise MachineError(
                f"{steps:+d} steps from {self.place} would lead out of the room from {-self.room.behind} to "
                f"{self.room.travel} steps: nothing was moved"
            )
        wait = abs(steps) / self.room.rate + PATIENCE if timeout is None else timeout
        asked = self.bench.away * steps
        counted = yield from self.bench.move(asked, wait)
        self._at += counted
        made = self.bench.away * counted
        if made * steps < 0 or abs(made) > abs(steps):
            raise MachineError(
                f"{self.bench.title} counted {counted:+d} steps where it was told {asked:+d}: somebody else moves it, "
                "or it was switched off. Put the carriage on the witness and begin again"
            )
        if made != steps and not (steps < 0 and (yield from self.bench.closed())):
            raise MachineError(
                f"{self.bench.title} made {counted:+d} of {asked:+d} steps: a limit switch or a stop ended the motion. "
                "The travel ends nearer than was said, or somebody has stopped it"
            )
        return made

    def _countable(self) -> int:
        """Steps back that the unit can count. Raises MachineError if there are none."""
        lowest = self.bench.lowest
        if lowest is None or self.bench.away < 0:
            return self.room.travel
        if self._at <= lowest:
            raise MachineError(
                f"the witness is open where {self.bench.title} counts {lowest}, and it goes no farther back. Switch it "
                "off, push the carriage farther onto the witness, switch it on, and begin again"
            )
        return self._at - lowest

    # -- the witness -------------------------------------------------------------------------------------

    def begin(self) -> Steps[None]:
        """The first reference. The carriage must stand on the witness: so it is known that the witness can close.

        Or at most `approach` steps from it: then it goes there, and not farther.
        """
        yield from self.bench.prepare()
        self._zero = None
        self._at = yield from self.bench.count()
        yield from self.bench.slowly(self.room.rate)
        gone, most = 0, self.room.approach
        while self.bench.sees_opening and not (yield from self.bench.closed()):
            if not most:
                raise MachineError(
                    "the witness is open: put the carriage on it, so that it is closed, and begin again. Nothing was "
                    "moved yet, as a switch that never closes would let the carriage run into the end. If you have "
                    "seen it work, and know how far the carriage is from it at most, say --approach STEPS"
                )
            if gone >= most:
                raise MachineError(f"the witness is still open after the {most} steps of --approach")
            gone -= yield from self._go(-min(self.room.coarse, most - gone))
        yield from self._approach((yield from self._clear(self.room.behind)))
        yield from self.reference()

    def _clear(self, deep: int) -> Steps[int]:
        """Away from the witness, which is at most `deep` steps back, and some more, to where trials begin.

        Returned is within how many steps back it must close again.
        """
        room, gone = self.room, 0
        if not self.bench.sees_opening:
            yield from self._go(deep + room.clearance)
            return deep + room.clearance + room.tolerance
        while (yield from self.bench.closed()):
            if gone >= deep + 2 * room.turn:
                raise MachineError(
                    f"the witness is still closed after {gone} steps away from it. It is stuck or tied to ground, the "
                    "carriage does not move, --away is the other way round, or this is another switch on the same wire"
                )
            gone += yield from self._go(room.turn)
        yield from self._go(room.clearance)
        return room.clearance + 2 * room.turn

    def _approach(self, most: int) -> Steps[None]:
        """Towards the witness in fine steps until it closes; there is the new zero."""
        gone = 0
        while not (yield from self.bench.closed()):
            piece = min(self.room.fine, most - gone, self._countable())
            if piece <= 0:
                raise MachineError(
                    f"the witness did not close within {gone} steps, where it should. It is stuck open or its wire is "
                    "broken, the carriage does not move, or it stands behind the witness"
                )
            gone -= yield from self._go(-piece)
        self._zero = self._at

    def reference(self) -> Steps[None]:
        """From the witness, three approaches to it that agree. It is left standing there."""
        zeros: list[int] = []
        deep = self.room.turn
        for _ in range(REFERENCES):
            yield from self._approach((yield from self._clear(deep)))
            assert self._zero is not None
            zeros.append(self._zero)
        self._told(tuple(zeros))
        spread, allowed = max(zeros) - min(zeros), max(self.room.turn // 4, self.room.fine)
        if spread > allowed:
            raise MachineError(
                f"three approaches found the witness at counts {', '.join(map(str, zeros))}: {spread} steps apart, "
                f"where {allowed} are allowed. The switch is not repeatable, or steps are lost at {self.room.rate} "
                "steps/s: take a better switch, or another --safe-rate"
            )

    # -- out and back ------------------------------------------------------------------------------------

    def out_and_back(self, steps: int, values: Values | None = None, seconds: float = 0.0) -> Steps[int]:
        """From the witness, one way out by `steps` with the settings, and back slowly until it has closed again.

        Without settings it goes out slowly, too; with them it takes `seconds`. Returned is by how many steps the
        witness closed early, against the reference: those that were lost on the way out. Less than none: those that
        were lost on the way back, or by which the carriage ran ahead. After a difference the reference is a new one,
        which `reference` must prove.
        """
        room, zero = self.room, self._zero
        assert zero is not None
        yield from self._clear(room.turn)
        if values is not None:
            yield from self.bench.settings(values)
        yield from self._go(steps, seconds + PATIENCE if values is not None else None)
        yield from self.bench.slowly(room.rate)
        yield from self._back()
        yield from self._approach((yield from self._clear(room.coarse)))
        early = self.bench.away * self.bench.between(zero, self._at)
        if abs(early) <= room.tolerance:
            self._zero = zero  # so that what drifts is noticed
        return early

    def _back(self) -> Steps[None]:
        """Back until the witness closes, with a look after each piece, and no farther than the count allows."""
        room = self.room
        while not (yield from self.bench.closed()):
            # it swings, and closes with some play
            piece = min(room.coarse, self.place + room.behind - room.turn, self._countable())
            if piece <= 0:
                raise MachineError(
                    f"the witness is still open {-self.place} steps behind where it should have closed. Steps were "
                    f"lost on the way back at {room.rate} steps/s, the witness is stuck open, or the carriage is "
                    "stuck. Where it stands is not known. Look, put it on the witness, and begin again; slower, if it "
                    "had moved"
                )
            yield from self._go(-piece)
        self._zero = self._at  # nearly: the approach that follows finds the place

    def recover(self) -> Steps[None]:
        """After a trial that was broken off: stand, come back to the witness, and take a new reference."""
        yield from self.bench.end()
        before, self._at = self._at, (yield from self.bench.count())
        if self._zero is None or not -self.room.behind <= self.place <= self.room.travel:
            raise MachineError(
                f"{self.bench.title} counts {self._at} where it counted {before} before: it was switched off, or "
                "somebody else has moved it. Put the carriage on the witness and begin again"
            )
        yield from self.bench.slowly(self.room.rate)
        yield from self._back()
        yield from self._approach((yield from self._clear(self.room.coarse)))
        yield from self.reference()
