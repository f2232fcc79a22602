"""One DCB-274 on its line: signing on, lines to it, its turn for an action, resets, names, what a SIN-10 does."""

from collections.abc import Iterable
from typing import Final, TypeVar

from detent.hosts.axis import Axis
from detent.hosts.dcb274.adapter import Adapter
from detent.hosts.dcb274.answers import Settings
from detent.hosts.dcb274.handshake import CTRL_C, CTRL_N, CTRL_P, RESET, TRIES, Handshake, NotListening
from detent.hosts.dcb274.names import is_name
from detent.hosts.dcb274.party_line import DaisyChain, PartyLine
from detent.hosts.dcb274.ranges import FASTEST, SLOWEST, name_of_axis, ramp_seconds
from detent.hosts.dcb274.single_mode import SingleMode
from detent.hosts.errors import BadAnswer, Busy, MotionFailed, NoAnswer, Refused, Spoken
from detent.hosts.exchange import Rest, Steps, operation, until

MODES: Final = ("single", "party", "daisy", "sin10")
PATIENCE: Final = 0.25  # seconds for an echo; a character takes 1 ms at 9600 baud
REST, INDEXING, CONSTANT = 0, 1, 3  # what ^ answers
# Seconds that commands execute (page 29), twice as long as it says; the others take less than a millisecond.
SAVING, CLEARING, QUICK, INDEX = 0.12, 3.0, 0.02, 0.02

T = TypeVar("T")


class Unit(Axis):
    """One axis on its line, and what the driver knows of it.

    `mode` is how the host talks to it: ``single`` (one axis, SPACE signs on), ``party`` (RS-422 party line, also
    behind a SIN-8), ``daisy`` (daisy chain, whose first axis is `first`), ``sin10`` (behind a SIN-10). On all but the
    first the axis has a `name`. Several drivers, one an axis, may share a port.
    """

    def __init__(self, name: str = "", *, mode: str = "single", first: str = "", patience: float = PATIENCE) -> None:
        """Raises ValueError. `patience`: seconds to wait for an echo beyond what characters take at 9600 baud."""
        if mode not in MODES:
            raise ValueError(f"mode {mode!r}: choose from {', '.join(MODES)}")
        if mode != "single" and not is_name(name):
            raise ValueError(f"in mode {mode} an axis has a name of one character, not {name!r}; store_name() gives it")
        self.mode = mode
        self._way: Handshake
        match mode:
            case "single":
                self._way = SingleMode(patience)
            case "party":
                self._way = PartyLine(name, patience)
            case "daisy":
                self._way = DaisyChain(name, first or name, patience)
            case _:
                self._way = Adapter(name, patience)
        self.name = name
        self.title = self._way.title
        self.version = ""  # as the sign-on line tells
        self.programming = False  # `command` has begun program mode: whatever it is sent is stored
        self.left_over = ""  # where the last look at all programs found what is left of older ones, like "7-20, 300"
        self._connected = False
        self._broken = False  # an operation was broken off: something may stand in the line, or be under way
        self._storing = False  # lines were being stored, and the end of that was not seen
        self._stops = 0  # how often the axis was stopped
        self._times_told = 0  # how often it was told to do something else
        self._target: int | None = None  # where the index under way should end, if that is known
        self._search = 0  # direction of the search for home under way
        self._cut_short = False  # the unit was reset before that was seen to end
        self._divide: int | None = None
        self._slope: tuple[int, int] | None = None

    def forget(self) -> None:
        """The connection was lost, or the unit was reset: sign on again, and know nothing of its settings."""
        self._connected = False
        self._divide = self._slope = None

    @property
    def in_program_mode(self) -> bool:
        """Whether lines are stored, as far as is known: `command` has begun that, or it was found so (page 47)."""
        return self.programming or self._way.programming

    def _takes_lines(self) -> None:
        """It is in no program mode."""
        self._storing = self.programming = self._way.programming = False

    # -- the line ----------------------------------------------------------------------------------------

    @operation
    def connect(self) -> Steps[str]:
        """See that the unit is there: sign on, ask for its presence, name a daisy chain, have a SIN-10 look for axes.

        The first call of any operation does this by itself, and again after the port was lost. Returned is the
        version if the unit tells. A SIN-10 that does not know the axis yet resets all axes to look for them (page 19).
        """
        try:
            version = yield from self._way.connect()
        except NoAnswer as error:  # it was reset meanwhile: then again
            heard = error.spoken is not None and error.spoken.received
            if not (heard and (yield from self._way.signs_on())):
                raise
            version = yield from self._way.connect()
        self.version = version or self.version
        self._cut_short = bool(version) and (self._target is not None or self._search != 0)
        self._connected, self._broken = True, False
        self._takes_lines()  # X was answered
        if isinstance(self._way, SingleMode):
            self.name = self._settings(self._way.examined).name
            self.title = self._way.title = f"DCB-274 {self.name}"
        return self.version

    @operation
    def command(self, text: str, seconds: float = CLEARING) -> Steps[str]:
        """Any line as it is typed, without its end: what stands behind the echo. It may take so many `seconds`.

        For what has no call of its own: other firmware, the retired ``E n``. It knows nothing of pending periods. A
        unit that was left in program mode takes it all the same, and stores it; ``P`` ends that mode (page 47).
        """
        self._fits(text)
        if not self._connected:
            try:
                yield from self.connect()
            except Refused:
                if not self._way.programming:
                    raise
                return (yield from self._enter(text, seconds))
        return (yield from self._line(text, seconds, typed=True))

    def _line(self, text: str, seconds: float = QUICK, *, typed: bool = False) -> Steps[str]:
        """One line to a unit that is ready for it. Raises Busy where it would be stored, unless somebody typed it."""
        self._fits(text)
        if self.programming and not typed:
            raise Busy(self.title, "is in program mode, where what it is sent is stored", advice="P ends that mode")
        if self._storing and not typed:
            self._connected = False  # it is to be seen whether that is over
        if not self._connected:
            yield from self.connect()
        if self._way.running:
            yield from self._see_it_over()
        return (yield from self._enter(text, seconds))

    def _fits(self, text: str) -> None:
        longest = self._way.longest
        if len(text) > longest:
            behind = "behind the name " if longest != SingleMode.longest else ""
            raise ValueError(f"{text!r} has {len(text)} characters; a line has {longest} {behind}(pages 22 and 25)")
        if self.mode == "sin10" and ";" in text:
            raise ValueError(f"{text!r}: a SIN-10 takes ; for the end of a command (page 19); spool() takes several")

    def _enter(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """One line. If it breaks off, what stands in the line is not known: the next call clears it by connecting."""
        try:
            return (yield from self._unbroken(self._way.line(text, seconds, tries)))
        except NoAnswer as error:
            self._connected = isinstance(error, NotListening) and self._way.running
            if not self._connected and (yield from self._way.signs_on()):
                self._leave(None)
                self.forget()
                raise NoAnswer(self.title, RESET, error.spoken) from None
            raise
        except BadAnswer:  # of a unit that came back in the middle of the line, say
            self._connected = False
            raise

    def _unbroken(self, steps: Steps[T]) -> Steps[T]:
        """`steps` behind which the line is clear. If they are broken off the next call clears it by connecting."""
        try:
            return (yield from steps)
        except GeneratorExit:  # the caller was cancelled
            self._connected, self._broken = False, True
            raise

    def _see_it_over(self) -> Steps[None]:
        """Raises Busy if the program that was started still runs."""
        if not (yield from self._unbroken(self._way.over())):
            raise Busy(self.title, "runs a program and takes no line", advice="wait() for its end, stop() or halt() it")
        self._way.running = False

    def _number(self, text: str, seconds: float = QUICK) -> Steps[int]:
        """A line whose answer is a number."""
        result = yield from self._line(text, seconds)
        try:
            return int(result)
        except ValueError:
            what = f"answers {text!r} with {result.strip()!r}, which is no number"
            raise BadAnswer(self.title, what, Spoken(text.encode(), result.encode("latin-1"))) from None

    def _act(self, text: str, seconds: float = INDEX) -> Steps[None]:
        """Begin an action as soon as the one before is complete; waiting for that leaves the port to others."""
        stops = self._stops
        while (yield from self._number("^")) & 3 == INDEXING:
            yield Rest(self.poll)
            if self._stops != stops:
                raise MotionFailed(self.title, f"gave up {text!r}: the axis was stopped before its turn came")
        # Only M may be under way now. What follows it waits for its ramp, and an index for the one to rest besides.
        up, down = self._slope or (255, 255)
        ramp = ramp_seconds(SLOWEST, FASTEST, self._divide or 1) * max(up, down)
        yield from self._line(text, seconds + 2 * ramp)

    def _settings(self, text: str) -> Settings:
        try:
            settings = Settings.parse(text)
        except ValueError as error:
            raise BadAnswer(self.title, f"answers X with something else: {error}") from None
        self._divide, self._slope = settings.divide, (settings.up, settings.down)
        return settings

    def _leave(self, target: int | None) -> None:
        """Another motion begins, or the one under way is ended: it should end at `target`, if that is known."""
        self._target, self._search, self._cut_short = target, 0, False
        self._times_told += 1

    # -- resets ------------------------------------------------------------------------------------------

    @operation
    def reset(self) -> Steps[None]:
        """^C: every axis on the line is as after power-on: outputs off, position 0, settings from NV memory (page 34).

        The next call signs on again.
        """
        yield from self._restart(CTRL_C)

    @operation
    def party_line(self) -> Steps[None]:
        """^P: every axis is reset, and listens in party line mode (page 58): drive it with ``mode="party"`` then."""
        if self.mode == "sin10":
            raise ValueError("the adapter sends ^P itself: scan()")
        yield from self._restart(CTRL_P)

    def _restart(self, character: bytes) -> Steps[None]:
        self._stops += 1
        self._leave(None)
        yield from self._way.restart(character)
        self._way.running = False
        self._takes_lines()
        self.forget()

    # -- names and adapters ------------------------------------------------------------------------------

    @operation
    def sign_on(self, name: str = "") -> Steps[str]:
        """Reset, then sign on, as `name` if one is given; the version (page 23). Single mode. `save` keeps the name."""
        if self.mode != "single":
            raise ValueError("units sign on in single mode only: connect()")
        if name:
            name_of_axis(name)
        yield from self._restart(CTRL_C)
        if name:
            yield from self.ask(name.encode(), until(name.encode()), self._way.patience)
        return (yield from self.connect())

    @operation
    def store_name(self, name: str) -> Steps[None]:
        """^N: the axis has this name, at once and for good (page 57). Single mode, with one axis on the line."""
        if not isinstance(self._way, SingleMode):
            raise ValueError("a name is given in single mode, with one axis on the line (page 57)")
        name_of_axis(name)
        if not self._connected:
            yield from self.connect()
        answer = yield from self._unbroken(self._named(name.encode()))
        if answer != name.encode() + b"\r\n":
            raise BadAnswer(self.title, f"does not take the name {name!r}", Spoken(name.encode(), answer))
        self.name = name
        self.title = self._way.title = f"DCB-274 {name}"

    def _named(self, name: bytes) -> Steps[bytes]:
        yield from self.ask(CTRL_N, until(b"name?"), self._way.patience)
        return (yield from self.ask(name, until(b"\r\n"), self._way.patience + SAVING))

    @operation
    def name_chain(self) -> Steps[tuple[str, ...]]:
        """Reset a daisy chain and name its axes, from `first` on; the names in their order (page 24)."""
        if not isinstance(self._way, DaisyChain):
            raise ValueError("only a daisy chain is named by the host: store_name()")
        yield from self._restart(CTRL_C)
        return (yield from self._way.assign())

    @operation
    def scan(self) -> Steps[str]:
        """&: the SIN-10 resets all axes into party line mode and looks who is there; their names (page 19)."""
        adapter = self._adapter()
        names = yield from adapter.scan()
        self.forget()
        return names

    @operation
    def spool(self, commands: Iterable[str], seconds: float = 60.0) -> Steps[list[str]]:
        """Several commands with their names in one line to a SIN-10, like ``X+1000``; one reply each (page 19).

        ``9W*`` waits until all axes stand, ``9WX`` for X. All of it may take so many `seconds`.
        """
        lines = list(commands)
        if not lines or any(not line or ";" in line or "\r" in line for line in lines):
            raise ValueError("give one command or more, each of them alone")
        if not self._connected:
            yield from self.connect()
        return (yield from self._adapter().spool(lines, seconds))

    def _adapter(self) -> Adapter:
        if not isinstance(self._way, Adapter):
            raise ValueError('only a SIN-10 does that: drive it with mode="sin10"')
        return self._way
