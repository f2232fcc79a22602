"""What the parts of one board share: its link and dictionary, ticks of cell time, the move queue, questions, events."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from detent.outputs.steps import Scale
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.dictionary import BARE, Dictionary, Message, Value
from detent.realtime.boards.events import Event
from detent.realtime.boards.link import Link
from detent.realtime.boards.setup import BoardSetup
from detent.realtime.boards.undo import Undo, together
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

MASK = 0xFFFFFFFF
ASK_AGAIN: WallNs = 40 * MS  # an answer that was lost on the way is asked for again
AHEAD: Ns = 1000 * MS  # nothing is said for later, however late its unit is: 32 bits are no more than 4 s at 520 MHz
UNSURE: Ns = 1 * MS  # how far the clock's estimate may be off, generously


class MoveQueue:
    """The entries of a board's move queue, shared by steppers and outputs, as the host has to count them.

    An entry is free again when it is loaded; `take` says by which tick that is at the latest.
    """

    def __init__(self) -> None:
        self.size = 0
        self._held: dict[int, deque[int]] = {}  # of each oid: the ticks at which its entries are free

    def clear(self, size: int) -> None:
        """A queue of `size` entries, all free."""
        self.size = size
        self._held = {}

    def room(self, tick: int) -> int:
        """How many entries are certainly free at `tick`."""
        taken = 0
        for held in self._held.values():
            while held and held[0] < tick:
                held.popleft()
            taken += len(held)
        return self.size - taken

    def take(self, oid: int, until: int) -> None:
        """An entry of `oid` is taken until that tick."""
        self._held.setdefault(oid, deque()).append(until)

    def forget(self, oid: int) -> None:
        """The firmware has dropped what `oid` had queued."""
        self._held.pop(oid, None)

    def kept(self) -> Undo:
        """As it is now, again."""
        held = {oid: ticks.copy() for oid, ticks in self._held.items()}

        def undo() -> None:
            self._held = held

        return undo


@dataclass
class _Question:
    message: bytes
    then: Callable[[Message, WallNs], None]
    again_at: WallNs
    left: int  # times that it is asked again
    said: int  # messages up to it: an answer of a board that did not know them is to an earlier one
    again: int  # the same, as it was said last


class Core:
    """One board's common ground. Parts send `command`s, `ask` questions and append to `events`."""

    def __init__(self, setup: BoardSetup) -> None:
        self.setup = setup
        self.link = Link()
        self.dictionary: Dictionary = BARE
        self.clock = Clock(1)
        self.queue = MoveQueue()
        self.events: list[Event] = []
        self.scale = Scale(1)  # cell time to ticks at the pins: the lead is in it
        self.slips = 0
        self.known = 0  # so many messages of ours had come when the board said what is looked at now
        self.earliest: int | None = None  # of the ticks for which something was said since this was None
        self.look_at_clock: Callable[[WallNs], None] = lambda wall: None  # ask the board what its clock says, now
        self._questions: dict[tuple[str, int], _Question] = {}

    @property
    def frequency(self) -> int:
        """Nominal ticks a second."""
        return self.clock.frequency

    def ticks(self, ns: Ns) -> int:
        """A duration in ticks, rounded up."""
        return -(-ns * self.clock.frequency // SECOND)

    def soonest(self, wall: WallNs) -> int:
        """The first tick for which something may still be sent at `wall`."""
        return self.clock.tick_at(wall) + self.ticks(self.setup.margin)

    def reach(self, wall: WallNs) -> int:
        """The last tick for which something may be sent at `wall` already."""
        return self.clock.tick_at(wall) + self.ticks(AHEAD)

    def after_lead(self, wall: WallNs) -> int:
        """The tick a lead from now, for what has no time of its own: a host that is kept away is not late with it."""
        return self.clock.tick_at(wall) + self.ticks(self.setup.lead)

    def comes(self, tick: int) -> None:
        """What is said now is for that tick, and has to be there before."""
        if self.earliest is None or tick < self.earliest:
            self.earliest = tick

    def stale(self, wall: WallNs) -> bool:
        """Whether something of what was said, and has not left, would be too late if it left at `wall`."""
        least = self.clock.tick_at(wall) + self.ticks(self.setup.margin // 2)
        return self.earliest is not None and self.earliest < least

    def command(self, name: str, **values: Value) -> None:
        """Queue a command."""
        self.link.send(self.dictionary.encode(name, **values))

    def ask(
        self, name: str, answer: str, then: Callable[[Message, WallNs], None], wall: WallNs, *, times: int = 25,
        **values: Value,
    ) -> None:  # fmt: skip
        """Send the command `name` until the response `answer` (of the same oid, if it has one) has come, then tell it.

        A question that is open already is asked anew, and its answer goes to the new asker. What comes as an answer to
        one before, which was asked again as the wire was slow, is none to this.
        """
        message = self.dictionary.encode(name, **values)
        oid = values.get("oid", -1)
        assert isinstance(oid, int)
        self.link.send(message)
        self._questions[answer, oid] = _Question(message, then, wall + ASK_AGAIN, times, self.link.said, self.link.said)

    def asking(self, answer: str, oid: int) -> bool:
        """Whether that answer is awaited."""
        return (answer, oid) in self._questions

    def answered(self, message: Message, wall: WallNs) -> bool:
        """Give a response to who asked; whether somebody had."""
        oid = message.values.get("oid", -1)
        assert isinstance(oid, int)
        question = self._questions.get((message.name, oid))
        if question is None or self.known < question.said:
            return False
        del self._questions[message.name, oid]
        question.then(message, wall)
        return True

    def kept(self) -> Undo:
        """As it is now, again: nothing of what is said from now on has been said."""
        undo = together((self.link.kept(), self.queue.kept()))
        count, questions, slips = len(self.events), self._questions.copy(), self.slips

        def back() -> None:
            undo()
            del self.events[count:]
            self._questions, self.slips = questions, slips

        return back

    def forget_questions(self) -> None:
        """Nobody wants to know any more."""
        self._questions.clear()

    def deadline(self) -> WallNs | None:
        """When a question is to be asked again."""
        return min((question.again_at for question in self._questions.values()), default=None)

    def due(self, wall: WallNs) -> str | None:
        """Ask again what has waited long enough; the name of an answer that never came.

        A question that was not taken yet is still on its way, however slow that is: what it needs the link does.
        """
        for key, question in list(self._questions.items()):
            if wall < question.again_at:
                continue
            if not question.left:
                del self._questions[key]
                return key[0]
            question.left -= 1
            question.again_at = wall + ASK_AGAIN
            if self.link.acknowledged >= question.again:
                self.link.send(question.message)
                question.again = self.link.said
        return None
