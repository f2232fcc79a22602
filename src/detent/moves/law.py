"""What the law of a controller is: its settings with their ranges, the train of a move, the commands that make it."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from detent.motors.motor import MotorError
from detent.motors.winding import Winding
from detent.pulses import Train

Values = Mapping[str, int]


class Setting(NamedTuple):
    """One number of a move, counted as its command counts (tens of steps a second for S and T of a GS-C200).

    Ranges, units and spellings come from the controllers' own tables.
    """

    name: str  # the command's letter
    title: str
    unit: str
    low: int
    high: int
    value: int  # to begin with
    scale: int = 1  # units a count


class Commands(NamedTuple):
    """The command lines that set a move up, and the one that makes it."""

    settings: tuple[str, ...]
    go: str


def _nothing(_: Values) -> str:
    return ""


class Law(NamedTuple):
    """How one controller makes moves. `train` and `commands` take the settings by name, and steps (1 to `most`).

    `remark` says what it makes of settings that contradict each other, which none of them refuses; "" where none do.
    """

    model: str
    title: str
    unit: str  # of position: "steps"
    most: int
    settings: tuple[Setting, ...]
    train: Callable[[Values, int], Train]
    commands: Callable[[Values, int], Commands]
    windings: tuple[Winding, ...]  # what one pulse may turn the field by; the first is the usual one. None: unknown
    remark: Callable[[Values], str] = _nothing

    @property
    def values(self) -> dict[str, int]:
        """The settings to begin with."""
        return {setting.name: setting.value for setting in self.settings}


def in_force(law: Law, registers: Mapping[str, str], axis: str = "") -> dict[str, int]:
    """The settings that a unit has now, by its registers (`Controller.registers`); where it has none, `law.values`."""
    found: dict[str, int] = {}
    for setting in law.settings:
        letter, _, which = setting.name.partition(" ")
        text = registers.get(f"{axis} {letter}".strip(), "")
        part = text.split("/")[-1 if which == "down" else 0]
        if part.isdigit():
            found[setting.name] = int(part)
    return clipped(law, found)


def stepping(law: Law, registers: Mapping[str, str], axis: str = "") -> str:
    """What a pulse does to the windings, if registers tell; else what is usual; "" if unknown.

    They do by H of a DCB-274, and by O of a GenStepper board.
    """
    names = [winding.name for winding in law.windings]
    told = {registers.get("H", "").lower(), f"O{registers.get(f'{axis} O')}"}
    return next((name for name in names if name in told), names[0] if names else "")


def clipped(law: Law, values: Values) -> dict[str, int]:
    """The settings with what is missing put in, and what is out of range brought into it."""
    return {
        setting.name: min(max(round(values.get(setting.name, setting.value)), setting.low), setting.high)
        for setting in law.settings
    }


def winding_of(law: Law, step: str | None) -> Winding:
    """What a pulse turns the field by: as is usual with this law, or as named if it can. MotorError."""
    windings = {winding.name: winding for winding in law.windings}
    if not windings:
        raise MotorError("the size of these microsteps divides no full step: no motor can be judged with it")
    if step is None:
        return next(iter(windings.values()))
    if step not in windings:
        raise MotorError(f"a {law.model} does no {step!r}; there are: {', '.join(windings)}")
    return windings[step]
