"""Inputs: up to eight pins in a group that the firmware polls, and reports when two polls agree.

What a stop watches for is told by the stop, exactly: its report is kept back until nothing is armed for it any more. A
stop comes into force with the pulses that it guards, a lead after the cell began them. An input that comes and goes in
between is told as any other (decision 49).
"""

from collections.abc import Callable, Mapping, Sequence

from detent.realtime.boards.core import MASK, Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import InputChanged
from detent.realtime.boards.setup import InputSetup
from detent.realtime.boards.stops import Stop
from detent.realtime.pace import WallNs
from detent.ticks import MS, Ns

GROUP = 8  # pins that the firmware polls together
POLL: Ns = 1 * MS
POLLS_TO_REPEAT = 30  # a report that is not acknowledged comes again


class Buttons:
    """A group of inputs. `changed` is told the input and its logical level, and when the report came."""

    def __init__(
        self, core: Core, inputs: Sequence[InputSetup], oid: int, changed: Callable[[str, bool, WallNs], None]
    ) -> None:
        self.oid = oid
        self._core, self._inputs, self._changed = core, tuple(inputs), changed
        self._acknowledged = 0
        self._state = 0

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it; pins by name."""
        made: list[tuple[str, dict[str, Value | str]]]
        made = [("config_buttons", {"oid": self.oid, "button_count": len(self._inputs)})]
        for i, entry in enumerate(self._inputs):
            made.append(("buttons_add", {
                "oid": self.oid, "pos": i, "pin": entry.pin.name, "pull_up": entry.pin.pull & 0xFF,
            }))  # fmt: skip
        return made

    def start(self, raw: Sequence[bool], wall: WallNs) -> None:
        """Poll from now on; `raw` are the levels of the pins themselves, as they were just read."""
        core = self._core
        self._state = sum(1 << i for i, level in enumerate(raw) if level)
        self._acknowledged = 0
        core.command("buttons_query", oid=self.oid, clock=core.after_lead(wall) & MASK, rest_ticks=core.ticks(POLL),
                     retransmit_count=POLLS_TO_REPEAT, invert=self._state)  # fmt: skip

    def reported(self, message: Message, wall: WallNs) -> None:
        """A buttons_state came: what is new in it, in order."""
        states = message.data("state")
        new = states[(self._acknowledged - message.number("ack_count")) & 0xFF :]
        if not new:
            return
        self._acknowledged = self._acknowledged + len(new) & 0xFF
        self._core.command("buttons_ack", oid=self.oid, count=len(new))
        for state in new:
            changed, self._state = state ^ self._state, state
            for i, entry in enumerate(self._inputs):
                if changed >> i & 1:
                    self._changed(entry.name, bool(state >> i & 1) is not entry.pin.active_low, wall)


class Inputs:
    """The inputs of one board. `levels` are logical, as last reported.

    `readers` are the endstops by which each is asked for its level, `own` those of them that no stop has.
    """

    def __init__(
        self, core: Core, setups: Sequence[InputSetup], stoppers: Mapping[str, int], stops: Mapping[str, Stop],
        oid: Callable[[], int],
    ) -> None:  # fmt: skip
        """`stoppers`: an endstop that a stop has for an input already, by name; `oid` gives another object."""
        self.levels: dict[str, bool] = {}
        self.readers: dict[int, InputSetup] = {}
        self._core, self._setups, self._stops = core, tuple(setups), stops
        self._own: list[tuple[InputSetup, int]] = []
        for entry in setups:
            if entry.name not in stoppers:
                self._own.append((entry, oid()))
                self.readers[self._own[-1][1]] = entry
            else:
                self.readers[stoppers[entry.name]] = entry
        self._groups = [
            Buttons(core, setups[i : i + GROUP], oid(), self._changed) for i in range(0, len(setups), GROUP)
        ]
        self._by_oid = {group.oid: group for group in self._groups}
        self._kept_back: dict[str, bool] = {}

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make them; pins by name."""
        commands: list[tuple[str, dict[str, Value | str]]] = [
            ("config_endstop", {"oid": oid, "pin": entry.pin.name, "pull_up": entry.pin.pull & 0xFF})
            for entry, oid in self._own
        ]
        for group in self._groups:
            commands += group.config()
        return commands

    def begin(self, raw: Mapping[str, bool], wall: WallNs) -> None:
        """Poll from now on; `raw` are the levels of the pins themselves, as they were just read."""
        self.levels = {entry.name: raw[entry.name] is not entry.pin.active_low for entry in self._setups}
        self._kept_back.clear()
        for number, group in enumerate(self._groups):
            group.start([raw[entry.name] for entry in self._setups[number * GROUP : (number + 1) * GROUP]], wall)

    def reported(self, message: Message, wall: WallNs) -> None:
        """A buttons_state came."""
        group = self._by_oid.get(message.number("oid"))
        if group is not None:
            group.reported(message, wall)

    def heard(self, name: str, level: bool, _: WallNs) -> None:
        """An input was asked behind a trigger: its event tells the level itself."""
        self.levels[name] = level
        self._kept_back.pop(name, None)

    def release(self, wall: WallNs) -> None:
        """Tell what was kept back because a stop was armed for it, where no stop is armed any more."""
        for name, level in list(self._kept_back.items()):
            if not any(stop.armed.get(name) is level or stop.firing for stop in self._stops.values()):
                del self._kept_back[name]
                self._tell(name, level, wall)

    def _changed(self, name: str, level: bool, wall: WallNs) -> None:
        kept = self._kept_back.pop(name, None)
        if any(stop.watches(name, level, wall) for stop in self._stops.values()):
            self._kept_back[name] = level
            return
        if kept is not None:
            self._tell(name, kept, wall)  # it came and went, and has stopped nothing
        self._tell(name, level, wall)

    def _tell(self, name: str, level: bool, wall: WallNs) -> None:
        if self.levels.get(name) is not level:
            self.levels[name] = level
            core = self._core
            core.events.append(InputChanged(core.setup.name, name, level, core.clock.ns_at(wall)))
