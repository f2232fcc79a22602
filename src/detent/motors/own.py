"""A motor of your own: its data as TOML, its maker's curve as CSV. Text in, `Motor` out; who reads files is above.

name = "my-23"                  # SI units throughout
resistance = 1.1                # ohm, of a phase
inductance = 3.6e-3             # H, of a phase
current = 2.8                   # A in each phase, both on
torque = 1.26                   # Nm, holding, at that current
inertia = 3.0e-5                # kg m2, rotor; without it no motion is computed
steps = 200                     # a turn
detent_torque = 0.04            # Nm
wiring = "parallel"             # series, parallel or unipolar: how these numbers were measured
damping = 0.1                   # ratio of the bare rotor, if it is known
accuracy = 0.05                 # of a step's place, as a part of a full step
source = "sheet of 2019"        # where the numbers are from

[curve]                         # optional: what the maker measured, or the CSV file beside it
file = "my-23.csv"
supply = 48                     # V
current = 2.8                   # A
step = "half"
"""

from collections.abc import Sequence
from math import inf, isfinite, pi
from typing import Any, NamedTuple

from detent import toml
from detent.motors import columns
from detent.motors.drive import Drive
from detent.motors.fit import Fit, Point, fit_from_curve
from detent.motors.motor import Motor, MotorError
from detent.motors.winding import winding
from detent.nearest import did_you_mean

NUMBERS = ("resistance", "inductance", "current", "torque", "inertia", "detent_torque", "steps", "inductance_factor",
           "viscous", "damping", "accuracy")  # fmt: skip
WORDS = ("name", "title", "source", "wiring")
NEEDED = ("resistance", "inductance", "current", "torque")
CURVE = ("file", "points", "supply", "current", "step", "source")
MOST_POINTS = 1000


class Curve(NamedTuple):
    """How a published curve was measured: its points (full steps/s, Nm), or the file that has them."""

    supply: float
    current: float
    step: str
    points: tuple[Point, ...] = ()
    file: str = ""
    source: str = ""

    def fit(self, motor: Motor, points: Sequence[Point] = ()) -> Fit:
        """The motor fitted to it; `points` are those of the file."""
        return fit_from_curve(motor, Drive(self.supply, self.current, winding(self.step)), points or self.points)


def read(text: str, file: str) -> tuple[Motor, Curve | None]:
    """The motor in the TOML `text`, and its curve if it names one. MotorError says which key, and what to do."""
    try:
        data = toml.loads(text)
    except toml.NoToml as error:
        raise MotorError(f"{file}: {error}") from None
    curve = data.pop("curve", None)
    _check_keys(file, "", data, (*NUMBERS, *WORDS, "curve"))
    missing = [key for key in NEEDED if key not in data]
    if missing:
        raise MotorError(f"{file}: {', '.join(missing)} missing: a motor needs {', '.join(NEEDED)} (ohm, H, A, Nm)")
    values: dict[str, Any] = {}
    for key, value in data.items():
        values["holding_torque" if key == "torque" else key] = _value(file, key, value)
    if isinstance(values.get("steps"), float):
        if values["steps"] != int(values["steps"]):
            raise MotorError(f"{file}: steps: {values['steps']!r} is no whole number")
        values["steps"] = int(values["steps"])
    values.setdefault("name", file.rsplit("/", 1)[-1].removesuffix(".toml"))
    values.setdefault("source", file)
    try:
        motor = Motor(**values)
        return motor, None if curve is None else _curve(file, curve, motor)
    except MotorError as error:
        raise MotorError(f"{file}: {error}") from None


def _value(file: str, key: str, value: object) -> object:
    if key in WORDS:
        if not isinstance(value, str) or len(value) > 200:
            raise MotorError(f"{file}: {key}: give a word, not {value!r}")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MotorError(f"{file}: {key}: give a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise MotorError(f"{file}: {key}: give a number, not {value!r}")
    return number


def _check_keys(file: str, where: str, data: dict[str, Any], known: Sequence[str]) -> None:
    for key in data:
        if key not in known:
            what = f"{file}: {where}{key}: there is no such key"
            raise MotorError(f"{what}; {did_you_mean(key, known)}there are: {', '.join(known)}")


def _curve(file: str, data: object, motor: Motor) -> Curve:
    if not isinstance(data, dict):
        raise MotorError("curve is a table: [curve] with file (or points), supply, current, step")
    _check_keys(file, "curve.", data, CURVE)
    if "supply" not in data or ("file" in data) == ("points" in data):
        raise MotorError("[curve] needs supply (V), and either file or points")
    step, supply = str(data.get("step", "half")), float(_value(file, "supply", data["supply"]))  # type: ignore[arg-type]
    current = float(_value(file, "current", data.get("current", motor.current)))  # type: ignore[arg-type]
    per_step = winding(step).steps
    points = []
    listed = data.get("points", [])
    if not isinstance(listed, list) or len(listed) > MOST_POINTS:
        raise MotorError(f"curve.points: give a list of at most {MOST_POINTS} points [{step} steps/s, Nm]")
    for point in listed:
        if not isinstance(point, list) or len(point) != 2:
            raise MotorError(f"curve.points: a point is [{step} steps/s, Nm], not {point!r}")
        rate, torque = (float(_value(file, "curve.points", value)) for value in point)  # type: ignore[arg-type]
        points.append((rate / per_step, torque))
    return Curve(supply, current, step, tuple(points), str(data.get("file", "")), str(data.get("source", file)))


_SPEEDS = {"full steps/s": 1.0, "half steps/s": 0.5}
_TURNS = {"rpm": 1 / 60, "1/min": 1 / 60, "turns/min": 1 / 60, "rev/min": 1 / 60, "turns/s": 1.0, "rev/s": 1.0,
          "rps": 1.0, "rad/s": 1 / (2 * pi)}  # fmt: skip
_STEPS = ("steps/s", "pps", "hz")
_TORQUES = {"nm": 1.0, "n m": 1.0, "mnm": 1e-3, "ncm": 1e-2, "n cm": 1e-2, "kgcm": 0.0980665, "kg cm": 0.0980665,
            "oz-in": 7.0615518e-3, "oz in": 7.0615518e-3, "ozin": 7.0615518e-3}  # fmt: skip


def read_curve(text: str, file: str, *, step: str = "half", steps: int = 200) -> tuple[Point, ...]:
    """The points (full steps/s, Nm) of a CSV text whose first line names the units of its two columns.

    Speeds: full steps/s, half steps/s, steps/s (of `step`), rpm, turns/s, rad/s. Torques: Nm, mNm, Ncm, kg cm, oz-in.
    Columns as in `columns`. MotorError names the line.
    """
    found = columns.lines(text)
    none = f"{file}: no points: write a line 'half steps/s, Nm', and a point a line below"
    if not found:
        raise MotorError(none)
    if len(found) > MOST_POINTS:
        raise MotorError(f"{file}: {len(found)} points: give at most {MOST_POINTS}")
    first, head = found[0]
    units = columns.parted(head)
    if len(units) != 2:
        raise MotorError(f"{file}, line {first}: {head!r}: a line has two columns, speed and torque")
    speed, torque = map(_unit, units)
    factors = {**_SPEEDS, **{unit: value * steps for unit, value in _TURNS.items()}}
    factors |= dict.fromkeys(_STEPS, 1 / winding(step).steps)
    if speed not in factors or torque not in _TORQUES:
        raise MotorError(
            f"{file}, line {first}: {head!r} names no units: begin with a line like 'half steps/s, Nm'; speeds: "
            f"{', '.join(factors)}; torques: Nm, mNm, Ncm, kg cm, oz-in"
        )
    if len(found) == 1:
        raise MotorError(none)
    points = []
    for k, line in found[1:]:
        try:
            rate, value = columns.numbers(line)
        except ValueError:
            raise MotorError(f"{file}, line {k}: {line!r}: {columns.WANTED}") from None
        points.append((rate * factors[speed], value * _TORQUES[torque]))
    return tuple(points)


def _unit(word: str) -> str:
    """What is in brackets, or the word itself: 'speed (rpm)', 'torque [Nm]', 'half_steps_per_s'."""
    low = word.lower().replace("_per_", "/").replace("_", " ").strip()
    for left, right in (("(", ")"), ("[", "]")):
        if left in low and right in low:
            return low[low.index(left) + 1 : low.index(right)].strip()
    return low
