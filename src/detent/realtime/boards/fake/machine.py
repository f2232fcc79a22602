"""The machine behind a fake board: axes that count steps, switches that follow them, levels of its pins."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

Watcher = Callable[[str, bool, int], None]
"""Told of a pin, its new level, and the tick."""


@dataclass
class MachineAxis:
    """An axis that moves a step with each pulse on `step`: up while `dir` is high, or always on a clock of its own."""

    step: str
    dir: str | None = None
    reverse: bool = False
    minus: str | None = None
    position: int = 0


@dataclass
class MachineSwitch:
    """An input pin that has the level `inside` while its axis is at `low` .. `high`, and the other one elsewhere."""

    axis: str
    pin: str
    low: int
    high: int
    inside: bool = True


@dataclass
class Machine:
    """All axes by name, the switches, and the levels of the board's pins."""

    axes: dict[str, MachineAxis] = field(default_factory=dict)
    switches: list[MachineSwitch] = field(default_factory=list)
    inputs: dict[str, bool] = field(default_factory=dict)
    pulled_up: dict[str, bool] = field(default_factory=dict)
    outputs: dict[str, bool] = field(default_factory=dict)
    edges: list[tuple[int, str, bool]] = field(default_factory=list)  # (tick, pin, level) of every output but steps
    steps: list[tuple[int, str, int]] = field(default_factory=list)  # (tick, axis, position behind it)
    watchers: list[Watcher] = field(default_factory=list)
    kept: bool = True  # whether `edges` and `steps` are

    def __post_init__(self) -> None:
        self._settle(0)

    def level(self, pin: str) -> bool:
        """Of an input pin; where nobody drives it, what its resistor pulls it to."""
        return self.inputs.get(pin, self.pulled_up.get(pin, False))

    def set(self, pin: str, level: bool, tick: int) -> None:
        """Somebody gives an input pin a level."""
        if self.inputs.get(pin) is not level:
            self.inputs[pin] = level
            for watcher in self.watchers:
                watcher(pin, level, tick)

    def drive(self, pin: str, level: bool, tick: int) -> None:
        """The board drives an output."""
        if self.outputs.get(pin) is not level:
            self.outputs[pin] = level
            if self.kept:
                self.edges.append((tick, pin, level))

    def pulse(self, pin: str, direction_pin: str, tick: int) -> None:
        """The active edge of a step pulse."""
        for name, axis in self.axes.items():
            if pin == axis.step:
                up = True if axis.minus is not None else self.outputs.get(axis.dir or direction_pin, False)
            elif pin == axis.minus:
                up = False
            else:
                continue
            axis.position += 1 if up is not axis.reverse else -1
            if self.kept:
                self.steps.append((tick, name, axis.position))
        self._settle(tick)

    def add(self, name: str, axis: MachineAxis, switches: Sequence[MachineSwitch], tick: int) -> None:
        """An axis with switches on it."""
        self.axes[name] = axis
        self.switches += switches
        self._settle(tick)

    def move(self, axis: str, position: int, tick: int) -> None:
        """Somebody moves an axis by hand."""
        self.axes[axis].position = position
        self._settle(tick)

    def _settle(self, tick: int) -> None:
        for switch in self.switches:
            inside = switch.low <= self.axes[switch.axis].position <= switch.high
            self.set(switch.pin, inside is switch.inside, tick)
