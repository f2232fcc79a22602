"""What calls of windows are answered with, where that is more than a text: the keys, and what stands at each.

The scripts are checked against these (``tests/workbench/test_page_types.py``).
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias, TypedDict

Point: TypeAlias = tuple[float, float]

# -- the page Begin --


class Places(TypedDict):
    """What can be opened: pairs of a name and a title; `open` is what is shown now, `folder` where `cells` are."""

    open: str
    models: Sequence[tuple[str, str]]
    examples: Sequence[tuple[str, str]]
    folder: str
    cells: Sequence[tuple[str, str]]


class Fittings(TypedDict):
    """What units of a new cell can have; `supplies` and `direct` in V by motor, `axes` by model."""

    motors: Sequence[str]
    supplies: Mapping[str, float]
    direct: Mapping[str, float]
    uncontrolled: Sequence[str]
    axes: Mapping[str, Sequence[str]]
    programs: Sequence[str]


class Command(TypedDict):
    """A row of a command table."""

    command: str
    argument: str
    what: str
    section: str


class DraftText(TypedDict):
    """A text that was not saved yet, and the file that it is for."""

    text: str
    file: str


class Written(TypedDict, total=False):
    """The file that was `saved`; or what is asked before it is, and then it is not."""

    saved: str
    asks: str


# -- the page Program --


class CommandRow(TypedDict):
    """What the command table says of a spelling."""

    form: str
    takes: str
    bytes: int
    when: str
    what: str
    section: str
    stored: bool


class Spelling(TypedDict):
    """A command as it is spelt. `whole`: no letter may follow."""

    spelling: str
    whole: bool
    rows: Sequence[CommandRow]


class ProgramFacts(TypedDict):
    """What the editor must know of a unit; `source` is what it begins with where there is no draft."""

    unit: str
    model: str
    title: str
    language: bool
    comment: str
    capacity: int
    nonvolatile: bool
    words: Sequence[Spelling]
    file: str
    source: str
    line: str | None


class CheckedProgram(TypedDict):
    """Errors (line, column, length, words), places (line, address, bytes) and labels of a text."""

    errors: Sequence[tuple[int, int, int, str]]
    places: Sequence[tuple[int, int, int]]
    labels: Mapping[str, int]
    used: int
    capacity: int
    loaded: bool


class ComparedProgram(TypedDict):
    """The lines that differ from program memory, and words for it."""

    lines: Sequence[int]
    words: str
    same: bool


# -- the page Terminal, and the line of the page Unit --


class SaidRow(TypedDict):
    """A row of what was said: ns; parts are kind, text, meaning, bytes as hexadecimal."""

    number: int
    begin: int
    sender: str
    note: str
    wrong: bool
    parts: Sequence[tuple[str, str, str, str]]


class LineRow(SaidRow):
    """A row of a line of the cell; not `whole`: more may be added to it."""

    whole: bool


class LineTalk(TypedDict):
    """Rows of a line: the numbers of the first and the next one; `cut` counts how often its past was taken back."""

    first: int
    next: int
    cut: int
    rows: Sequence[LineRow]


class UnitRow(SaidRow):
    """A row of a real unit; a `question` was asked by the page itself."""

    question: bool


class UnitTalk(TypedDict):
    """Rows of what was said with a real unit."""

    first: int
    next: int
    rows: Sequence[UnitRow]


class LineSaid(TypedDict):
    """What came of a line that was typed; `ms` until the answer was whole."""

    unit: str
    answers: Sequence[str]
    meaning: str
    refused: bool
    meanings: Sequence[str]
    ms: float | None


# -- the page Unit --


class UnitPlaces(TypedDict):
    """Ports with what is at them; units of the cell: name, model, address, options."""

    ports: Sequence[tuple[str, str]]
    cell: Sequence[tuple[str, str, str, str]]


class BackupDifferences(TypedDict):
    """What restoring changes; `seen` goes with `unit_restore`."""

    lines: Sequence[str]
    seen: str


# -- the page Motion --


class SettingFacts(TypedDict):
    """A setting of a law, with its range and what it begins with."""

    name: str
    title: str
    unit: str
    low: int
    high: int
    value: int
    scale: float


class MotorFacts(TypedDict):
    """The form for a motor by name: V, A, kg cm2, Nm."""

    name: str
    title: str
    supply: float
    current: float
    inertia: float
    torque: float
    damping: float
    steps: int
    curve: bool
    wiring: str
    wirings: Sequence[str]


class FittedMotor(TypedDict):
    """The form for the motor that the cell file has on an axis, by its `name` there; `travel` in mm a turn."""

    name: str
    motor: str
    stepping: str
    supply: float
    current: float
    inertia: float
    friction: float
    damping: float
    travel: float | None
    steps: int
    wirings: Sequence[str]


class AxisFacts(TypedDict):
    """An axis: its law and settings, what is in force, the motors to choose from and the one that is fitted."""

    unit: str
    axis: str
    real: bool
    options: Mapping[str, str]
    model: str
    law: str
    units: str
    most: int
    steps: int
    settings: Sequence[SettingFacts]
    values: Mapping[str, int]
    steppings: Sequence[str]
    per_step: Mapping[str, float]
    stepping: str
    drives: Sequence[str]
    motors: Sequence[MotorFacts]
    fitted: FittedMotor | None


class DrawnMove(TypedDict):
    """A move drawn: at `times` in s the speed and the position; accelerations are (at, value); `duration` in ns."""

    values: Mapping[str, int]
    steps: int
    times: Sequence[float]
    speeds: Sequence[float]
    positions: Sequence[float]
    accelerations: Sequence[Point]
    duration: int
    peak: float
    mean: float
    up: float
    down: float
    reached: bool
    remark: str
    settings: Sequence[str]
    go: str


class MoveVerdict(TypedDict):
    """What a motor makes of a move: lost it, or with what margin; how many variants of how many lost it."""

    lost: bool
    margin: float
    angle: float
    error: float
    often: int
    of: int


class JudgedMove(TypedDict):
    """Torque (Nm) over speed (units/s): what there is, what the move asks; the verdict, if it could be simulated."""

    curve: Sequence[Point]
    asked: Sequence[Point]
    travel: float | None
    turn: int
    verdict: MoveVerdict | None
    words: str


class PickedSettings(TypedDict):
    """The settings at a place of the map: what would be sent, and how long the moves take (s)."""

    settings: Mapping[str, int]
    options: Mapping[str, str]
    part: tuple[int, int]
    commands: Sequence[str]
    go: Sequence[str]
    times: Sequence[float]
    time: float | None
    settings_words: str
    option_lines: Sequence[str]
    resets: Sequence[str]
