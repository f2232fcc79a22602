"""One device on a bench: told the time, with contacts that follow its axes, and a record of what its axes did.

The bench believes nothing but the outputs: where a shaft is follows from the trains that the device told of, and the
edges of a contact from where the shaft is. So a law can be held against the device without asking it.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.mechanics import Mechanics
from detent.controllers.device import Controller, DriveSet, Output, Powered, StageSet, StoreImage
from detent.pins import HIGH, LOW, Level, PinSet
from detent.ticks import NEVER, Ns
from detent.uart import Char, Sent


class Say(NamedTuple):
    """The host sends a command line; the model's adapter makes bytes of it."""

    text: str


class Raw(NamedTuple):
    """Bytes as they are; the one at `damaged` (none: -1) has lost its stop bit."""

    data: bytes
    damaged: int = -1


class Put(NamedTuple):
    """An input is held at a level."""

    pin: str
    level: Level


class Power(NamedTuple):
    """The supply is switched."""

    on: bool


class Wait(NamedTuple):
    """Time passes."""

    time: Ns


class Store(NamedTuple):
    """Whether what is written to non-volatile memory from now on is kept: a memory breaks, and is well again."""

    works: bool


Action: TypeAlias = Say | Raw | Put | Power | Wait | Store


class Contact(NamedTuple):
    """A contact on an axis: `pin` has `level` while the shaft is from `low` to `high`, both included.

    One with low == high is momentary: the axis drives over it.
    """

    pin: str
    axis: str
    low: int
    high: int
    level: Level = LOW

    def at(self, shaft: int) -> Level:
        """What the pin reads with the shaft there."""
        return self.level if self.low <= shaft <= self.high else HIGH + LOW - self.level


class Travel:
    """One axis, as its outputs tell it."""

    def __init__(self) -> None:
        self.motion: MotionStarted | None = None
        self.ends = 0  # motions that came to their own end
        self._rest = 0  # the shaft at rest, or at pulse 0 of the motion under way
        self._pulses = 0  # given before pulse 1 of the motion under way

    def take(self, item: MotionStarted | MotionCut | MotionEnded) -> None:
        """The next thing it did: nothing may be lost or made between two of them."""
        if isinstance(item, MotionStarted):
            before, given = self.shaft(item.at), item.first - 1
            place = item.shaft + item.direction * given
            assert place == before, f"a motion begins at {place}, and the axis is at {before}"
            assert item.train.steps_by(item.at) <= item.first, "a motion begins with pulses that are in the past"
            self._pulses = self.count(item.at) - given
            self._rest, self.motion = item.shaft, item
        else:
            assert self.motion is not None, "what does not move cannot end"
            self.ends += isinstance(item, MotionEnded)
            due = self.motion.train.steps_by(item.at)  # the last of them may have been held
            assert item.last in (due, due - 1), f"a motion ends with pulse {item.last}, and {due} were due"
            self._rest += self.motion.direction * item.last
            self._pulses += item.last
            self.motion = None

    @property
    def moving(self) -> bool:
        """Whether a train is under way."""
        return self.motion is not None

    @property
    def direction(self) -> int:
        """+1 or -1; 0 at rest."""
        return 0 if self.motion is None else self.motion.direction

    def given(self, now: Ns) -> int:
        """Pulses of the motion under way."""
        return 0 if self.motion is None else self.motion.train.steps_by(now)

    def shaft(self, now: Ns) -> int:
        """Steps from where it was made."""
        return self._rest + self.direction * self.given(now)

    def count(self, now: Ns) -> int:
        """All pulses so far."""
        return self._pulses + self.given(now)

    def rate(self, now: Ns) -> float:
        """Pulses a second by the train; 0 at rest and before the first interval."""
        return 0.0 if self.motion is None else self.motion.train.state_at(now).rate

    def interval(self, now: Ns) -> Ns:
        """From the pulse before `now` (or the start) to the next; 0 at rest."""
        if self.motion is None:
            return 0
        train, given = self.motion.train, self.given(now)
        return 0 if given == train.steps else train.time_of(given + 1) - train.time_of(given)

    def next(self, shaft: int, now: Ns) -> Ns:
        """When it will be at `shaft`, as things are; NEVER if it will not."""
        if self.motion is None:
            return NEVER
        pulse = (shaft - self._rest) * self.motion.direction
        train = self.motion.train
        if pulse <= self.given(now) or (train.steps is not None and pulse > train.steps):
            return NEVER
        return train.time_of(pulse)


class Watch:
    """Somebody who looks after every event. See `Bench.watches`."""

    def before(self, bench: "Bench") -> None:
        """Something is about to reach the device, at `bench.now`."""

    def look(self, bench: "Bench") -> None:
        """Something has happened, at `bench.now`."""


class Bench:
    """A device, its contacts and its axes. It is off until `Power(True)` is played.

    `motor`: one that sits on one of its axes, whose contacts (`moved`, by their places) are moved by its rotor.
    """

    def __init__(
        self, device: Controller, contacts: Sequence[Contact] = (), motor: Mechanics | None = None,
        moved: Sequence[Contact] = (),
    ) -> None:  # fmt: skip
        self.device, self.motor, self.moved = device, motor, moved
        self.port = device.serial_port.receives
        self.contacts = contacts
        self.now: Ns = 0
        self.travels = {axis: Travel() for axis in device.axes}
        self.held: dict[str, Level] = {}  # inputs that somebody holds
        self.actions: list[Action] = []  # what was done so far
        self.out: list[Output] = []
        self.watches: list[Watch] = []
        self._edges: list[tuple[Ns, Contact]] = []
        self._levels: dict[Contact, Level] = {}
        self._stores = True
        if motor is not None:
            motor.power(True, 0)

    # -- doing -------------------------------------------------------------------------------------------

    def play(self, actions: Iterable[Action]) -> None:
        """Do one thing after another."""
        for action in actions:
            self.do(action)

    def do(self, action: Action) -> None:
        """Do one thing, now."""
        self.actions.append(action)
        self._about_to()
        match action:
            case Wait(time):
                self.go_to(self.now + time)
                return
            case Say(text):
                self.receive([Char(value) for value in self.device.frame(text)])
            case Raw(data, damaged):
                self.receive([Char(value, framing_ok=n != damaged) for n, value in enumerate(data)])
            case Put(pin, level):
                self.held[pin] = level
                self.device.set_pin(pin, level, self.now)
            case Power(on):
                self.device.power(on, self.now)
                if on:  # a contact has its level from the beginning
                    for contact in self.contacts:
                        self._touch(contact)
            case Store(works):
                self._stores = works
        self.collect()

    def receive(self, chars: Sequence[Char]) -> None:
        """Characters arrive, all in one instant, one call each."""
        for char in chars:
            self.device.receive(self.port, [char], self.now)
            self.collect()

    def go_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`: pulses and deadlines before the contacts they move."""
        while True:
            deadline = self.device.next_deadline()
            at = min(NEVER if deadline is None else deadline, self._edges[0][0] if self._edges else NEVER,
                     NEVER if self.motor is None else self.motor.deadline)  # fmt: skip
            if at > until:
                break
            self.now = at
            if deadline is not None and deadline <= at:
                self.device.advance(at)
                self.collect()
            if self.motor is not None and self.motor.deadline <= at:
                self.motor.advance(at)
                self._hear_motor()
            due = [contact for when, contact in self._edges if when <= at]
            for contact in due:
                self._touch(contact)
            if due:
                self._plan()
        self.now = until
        for watch in self.watches:
            watch.look(self)

    def collect(self) -> None:
        """Take what the device did."""
        moved = False
        while out := self.device.drain():
            for item in out:
                if isinstance(item, StoreImage):
                    self.device.stored(self._stores, self.now)
                elif isinstance(item, MotionStarted | MotionCut | MotionEnded):
                    self.travels[item.axis].take(item)
                    moved = True
                    if self.motor is not None:
                        self.motor.follow(item)
                elif isinstance(item, DriveSet | StageSet | Powered) and self.motor is not None:
                    self.motor.heed(item)
            self.out += out
        if moved:
            self._plan()
        for watch in self.watches:
            watch.look(self)

        if self.motor is not None:
            self._hear_motor()

    def _hear_motor(self) -> None:
        """The contacts that the rotor moves."""
        assert self.motor is not None
        for item in self.motor.drain():
            if isinstance(item, PinSet) and item.pin.isdigit():
                self._give(self.moved[int(item.pin)].pin, item.level)

    def _give(self, pin: str, level: Level) -> None:
        self._about_to()
        self.held[pin] = level
        self.device.set_pin(pin, level, self.now)
        self.collect()

    def _touch(self, contact: Contact) -> None:
        """The contact shows what the shaft makes of it."""
        level = contact.at(self.travels[contact.axis].shaft(self.now))
        if self._levels.get(contact) != level:
            self._levels[contact] = level
            self._give(contact.pin, level)

    def _about_to(self) -> None:
        for watch in self.watches:
            watch.before(self)

    def _plan(self) -> None:
        """When the contacts change next."""
        self._edges = sorted(
            (at, contact)
            for contact in self.contacts
            for edge in (contact.low - 1, contact.low, contact.high, contact.high + 1)
            if (at := self.travels[contact.axis].next(edge, self.now)) < NEVER
        )

    # -- looking -----------------------------------------------------------------------------------------

    def level(self, pin: str) -> Level:
        """What is held at an input; HIGH where nobody holds anything."""
        return self.held.get(pin, HIGH)

    @property
    def moving(self) -> tuple[str, ...]:
        """The axes with a train under way."""
        return tuple(axis for axis, travel in self.travels.items() if travel.moving)

    def counts(self) -> dict[str, int]:
        """All pulses so far, by axis."""
        return {axis: travel.count(self.now) for axis, travel in self.travels.items()}

    def heard(self, since: int = 0) -> str:
        """What the device sent, from this place of `out` on."""
        return "".join(chr(item.char.value) for item in self.out[since:] if isinstance(item, Sent))

    def pin(self, name: str) -> Level:
        """The level of an output."""
        told = (item.level for item in reversed(self.out) if isinstance(item, PinSet) and item.pin == name)
        return next(told, HIGH)
