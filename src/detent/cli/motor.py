"""The verb `motor`: torque against speed, one move judged, how often its variants lose it, and where and why."""

import json as json_text
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from cyclopts import Parameter

from detent.cli.rig import Made, Options, RigOptions

if TYPE_CHECKING:
    from detent.motors.curve import PullOut
    from detent.motors.move import Verdict
    from detent.motors.named import Measured
    from detent.motors.rotor import Rig
    from detent.motors.variants import LossRate
    from detent.motors.winding import Winding
    from detent.pulses import Train

FACTORS = (0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.5, 2.0, 3.0)
RATES = (25, 50, 100, 250, 500, 750, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 7500, 10000)
SLEW, RAMP = 1000.0, 50  # of a move, unless given
VARIANTS = 512
MOST_STEPS = 100_000_000
LONGEST = 3_600.0  # s of a move
SIMULATED = 300.0  # s of one rotor a second, about
MOST_SIMULATED = 60_000.0  # s of rotors, that nobody asked for: about a quarter of a minute


def motor(
    name: str | None = None,
    *,
    rig: Options = RigOptions(),  # noqa: B008 (never changes)
    move: float | None = None,
    start: float | None = None,
    slew: float | None = None,
    ramp: float | None = None,
    as_: Annotated[list[str] | None, Parameter(name="--as", consume_multiple=True)] = None,
    vary: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    variants: int | None = None,
    seed: int = 1,
    sensitivity: bool = False,
    pull_in: bool = False,
    plot: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> None:
    """Say what a motor makes of its pulses: torque against speed, a move judged.

    Without a name: the motors there are. Speeds are in steps/s of the stepping in use, as a controller counts them.

    For example: `detent motor qsh4218-41-10-035 --supply 24 --move 1000 --start 400 --slew 4000 --ramp 300`

    Parameters
    ----------
    name
        A motor by name, like qsh4218-41-10-035, or a TOML file of your own.
    rig
        Motor, drive and load.
    move
        Judge a move of so many steps: with --start, --slew and --ramp, constant acceleration; or by --as.
    start
        Start-stop speed, steps/s; unless given one that the motor starts into, away from its resonance.
    slew
        Slew speed, steps/s; 1000 unless given.
    ramp
        Steps of each ramp; 50 unless given.
    as_
        A controller and its settings, whose own law makes the move: --as dcb-274 I=800 V=6000 K=7,5.
    vary
        What variants differ in: inertia=0.2 (a part either way) or friction=0.3-2 (factors).
    variants
        How many of them are drawn, beside all corners (512 unless given; 0: none, and no corners).
    seed
        Seed of the draws: the same one draws the same variants.
    sensitivity
        The same move with more and less inertia, friction and voltage, one at a time.
    pull_in
        The highest speed that this motor starts into without a ramp.
    plot
        Draw it: a .png, .svg or .pdf file.
    overwrite
        Write over a file that no run has drawn.
    json
        Print everything as one line of JSON.
    """
    from detent.cli.endings import asked_wrongly
    from detent.cli.rig import made, read_by, spread_of
    from detent.motors.motor import MotorError

    try:
        if name is None:
            _list(json)
            return
        if plot is not None:
            from detent.outputs import figures
            from detent.outputs.files import check_outputs

            figures.check(plot)
            check_outputs([plot], read_by(name, rig), asked=overwrite)
        of_a_move = {
            "--as": as_, "--vary": vary, "--sensitivity": sensitivity or None, "--start": start, "--slew": slew,
            "--ramp": ramp, "--variants": variants,
        }  # fmt: skip
        for option, given in of_a_move.items():
            if given is not None and move is None:
                raise MotorError(f"{option} is of a move: add --move STEPS")
        many = _Variants(spread_of(vary), variants, seed)  # before a start is looked for, which takes its time
        many.check()
        law = None if as_ is None else _Law.of(as_)
        found = made(name, rig, None if law is None else law.winding(rig.step))
        facts = _facts_of(found)
        if move is None:
            _curve(name, found, facts, pull_in, plot, json)
            return
        asked = _Move.of(found, move, start, slew, ramp, law)
        _judge(asked, many, facts, sensitivity, pull_in, plot, json)
    except ValueError as error:  # MotorError, SettingError, CatalogueError
        asked_wrongly(error)


def _facts_of(found: Made) -> dict[str, Any]:
    drive, load, damping = found.drive, found.load, None if found.rig is None else found.rig.damping
    facts: dict[str, Any] = {
        "motor": found.motor.name, "source": found.motor.source,
        "supply": drive.supply, "current": drive.current, "step": drive.winding.name, "decay": drive.decay,
        "inertia": None if found.motor.inertia is None else found.motor.rotor + load.inertia,
        "friction": load.friction, "viscous": load.viscous, "torque": load.torque,
        "damping": None if damping is None else {"ratio": damping.ratio, "source": damping.source},
        "assumed": list(found.words),
    }  # fmt: skip
    if drive.name:
        facts["drive"] = drive.name
    if found.fit is not None:
        fit = found.fit
        facts["fit"] = {
            "inductance_factor": found.motor.inductance_factor, "viscous": found.motor.viscous, "rms": fit.rms,
            "from": fit.low, "to": fit.high, "factors": list(fit.factors), "ambiguous": fit.ambiguous,
        }  # fmt: skip
    return facts


def _list(json: bool) -> None:
    from detent.motors.named import CURVES, MOTORS

    if json:
        rows = [
            {
                "name": motor.name, "title": motor.title, "source": motor.source, "current": motor.current,
                "resistance": motor.resistance, "inductance": motor.inductance, "holding_torque": motor.holding_torque,
                "inertia": motor.inertia, "wiring": motor.wiring, "curve": motor.name in CURVES,
            }
            for motor in MOTORS.values()
        ]  # fmt: skip
        print(json_text.dumps({"motors": rows}))
        return
    table = table_of("motor", "", "A", "ohm", "mH", "Nm", "g cm2", "maker")
    for motor in MOTORS.values():
        inertia = "-" if motor.inertia is None else f"{motor.inertia * 1e7:g}"
        values = (motor.current, motor.resistance, motor.inductance * 1e3, motor.holding_torque)
        table.add_row(
            motor.name,
            motor.title.split(",")[0],
            *(f"{value:g}" for value in values),
            inertia,
            motor.source.split()[0].split("-")[0],
        )
    print_table(table)
    print("\ndetent motor NAME  shows torque against speed;  detent motor NAME --move 1000 --slew 2000  judges a move.")


# -- torque against speed ------------------------------------------------------------------------------------


def _curve(name: str, found: Made, facts: dict[str, Any], pull_in: bool, plot: Path | None, json: bool) -> None:
    from detent.motors.curve import torque_curve

    per_step, fit = found.drive.winding.steps, found.fit
    points = _useful(torque_curve(found.motor, found.drive, RATES))
    facts["curve"] = [
        {
            "rate": point.rate * per_step,
            "full_steps_per_s": point.rate,
            "torque": point.torque,
            "load_angle": point.angle,
        }
        for point in points
    ]
    if pull_in:
        facts |= _pull_in(found)
    if plot is not None:
        from detent.outputs import motor_figures

        motor_figures.write_curve(plot, found.motor, found.drive, points, _measured(name))
    if json:
        print(json_text.dumps(facts))
        return
    _print_head(found, facts)
    table = table_of(f"{found.drive.winding.name} steps/s", "full steps/s", "turns/min", "Nm", "W", "load angle", " ")
    for point in points:
        turns = point.rate / found.motor.steps
        beyond = fit is not None and not fit.low <= point.rate <= fit.high
        table.add_row(f"{point.rate * per_step:g}", f"{point.rate:g}", f"{turns * 60:g}", f"{point.torque:.3f}",
                      f"{point.torque * turns * 6.283185307:.1f}", f"{point.angle:.0f}\N{DEGREE SIGN}",
                      "not measured" if beyond else "")  # fmt: skip
    print_table(table)
    if pull_in:
        _print_pull_in(found, facts)
    if plot is not None:
        print(f"Wrote {plot}")


def _measured(name: str) -> "Measured | None":
    from detent.motors.named import CURVES

    return CURVES.get(name)


def _useful(points: "list[PullOut]") -> "list[PullOut]":
    """The curve to where nothing is left, with the first such point."""
    for k, point in enumerate(points):
        if point.torque <= 0:
            return points[: k + 1]
    return points


def _rig(found: Made) -> "Rig":
    """The rig. MotorError where nobody has said what turns."""
    from detent.motors.motor import MotorError

    if found.rig is None:
        raise MotorError(
            f"--inertia: the maker of {found.motor.name} gives no rotor inertia: give rotor and load together, kg m2"
        )
    return found.rig


def _pull_in(found: Made) -> dict[str, Any]:
    from detent.motors.curve import pull_in_rate

    rig, per_step = _rig(found), found.drive.winding.steps
    starts = pull_in_rate(rig.motor, rig.drive, rig.load, damping=rig.damping)
    return {
        "pull_in": starts.pull_in * per_step,
        "holes": [[low * per_step, high * per_step] for low, high in starts.holes],
        "highest_start": starts.highest * per_step,
    }


def _print_pull_in(found: Made, facts: dict[str, Any]) -> None:
    from detent.motors.curve import SLOWEST_START

    if not facts["highest_start"]:
        lowest = SLOWEST_START * found.drive.winding.steps
        print(f"\nStarts without a ramp into no speed of {lowest:g} steps/s or more: too heavy a load for it, or too "
              f"much friction; a ramp may do it (resonance at {_resonance(_rig(found)):.3g} steps/s).")  # fmt: skip
    else:
        print(f"\nStarts without a ramp into up to {facts['highest_start']:.0f} steps/s; a common rule takes half of "
              "it.")  # fmt: skip
    if facts["holes"]:
        bands = ", ".join(f"{low:.0f}-{high:.0f}" for low, high in facts["holes"])
        print(f"Resonance loses steps at {bands} steps/s: friction damps it, and so does a finer step.")
    if "move" not in facts:
        print("Assumed: " + "; ".join(found.words) + ".")


# -- one move ------------------------------------------------------------------------------------------------


class _Law(NamedTuple):
    """The law of a controller, and its settings."""

    law: Any
    values: Any

    @classmethod
    def of(cls, words: list[str]) -> "_Law":
        from detent.moves.spelling import SettingError, read

        if not words:
            raise SettingError("--as: name a controller, and its settings: --as gs-c200 S=20 T=300 R=80")
        return cls(*read(words[0], words[1:]))

    def winding(self, step: str | None) -> "Winding":
        """The stepping of the controller: the usual one, or the one asked for if it can."""
        from detent.moves.law import winding_of

        return winding_of(self.law, step)


class _Move(NamedTuple):
    """The move that is asked for, with the rig that shall make it."""

    found: Made
    rig: "Rig"
    train: "Train"
    steps: int
    words: str
    remark: str = ""  # what the controller makes of settings that contradict each other

    @classmethod
    def of(
        cls, found: Made, move: float, start: float | None, slew: float | None, ramp: float | None, law: _Law | None
    ) -> "_Move":
        from detent.motors.motor import MotorError
        from detent.ramps.constant_acceleration import move as ramped

        rig, steps = _rig(found), _whole("--move", move, MOST_STEPS)
        if law is not None:
            if not (start is slew is ramp is None):
                raise MotorError(
                    "--start, --slew and --ramp are of constant acceleration: --as has settings of its own"
                )
            if steps > law.law.most:
                raise MotorError(f"--move {steps}: a {law.law.model} moves at most {law.law.most} steps at once")
            from detent.moves.spelling import spelled

            train = law.law.train(law.values, steps)
            words = f"as {law.law.model} {spelled(law.law, law.values)}{_way(rig)}"
            return cls(found, rig, train, steps, words, law.law.remark(law.values))
        top = _rate("--slew", SLEW if slew is None else slew)
        first = _default_start(rig, top) if start is None else _rate("--start", start)
        if first > top:
            raise MotorError(f"--slew {top} is below --start {first}: the slew speed is the higher one")
        long = RAMP if ramp is None else _whole("--ramp", ramp, MOST_STEPS)
        words = f"{first} to {top} steps/s in ramps of {long}"
        if start is None:
            words += f" (start chosen away from the resonance at {_resonance(rig):.0f} steps/s)"
        return cls(found, rig, ramped(first, top, long, steps).train, steps, words + _way(rig))


def _way(rig: "Rig") -> str:
    """A move goes plus; where the load pulls to one side, that makes a difference."""
    pull = rig.load.at_rest()
    return "" if not pull else f", {'against' if pull > 0 else 'with'} the load"


def _whole(option: str, value: float, most: int) -> int:
    if not isfinite(value) or value != int(value) or not 1 <= value <= most:
        raise ValueError(f"{option} {value:g}: give a whole number, 1 to {most}")
    return int(value)


def _rate(option: str, value: float) -> int:
    if not isfinite(value) or value != int(value) or not 1 <= value <= 10_000_000:
        raise ValueError(f"{option} {value:g}: give whole steps/s, 1 to 10000000")
    return int(value)


def _resonance(rig: "Rig") -> float:
    """Steps/s at which each full step comes a swing after the one before."""
    return rig.motor.natural_frequency(rig.load.inertia) * rig.drive.winding.steps


def _default_start(rig: "Rig", slew: int) -> int:
    """Above the resonance where the motor starts into that at once, else well below it."""
    from detent.motors.curve import starts

    resonance, per_step = _resonance(rig), rig.drive.winding.steps
    for part in (2.0, 1.5):
        rate = round(part * resonance)
        if 1 <= rate < slew and starts(rig, [rate / per_step], steps=20).started[0]:
            return rate
    return max(min(round(resonance / 8), slew), 1)


class _Variants(NamedTuple):
    """How many variants, and what they differ in."""

    spread: Any
    tried: int | None
    seed: int

    def check(self) -> None:
        """Raise MotorError for a number that is none of variants."""
        from detent.motors.motor import MotorError

        if self.tried is not None and not 0 <= self.tried <= 1_000_000:
            raise MotorError(f"--variants {self.tried}: give 0 to 1000000")

    def judge(self, move: _Move) -> "tuple[LossRate | None, str]":
        """The loss rate, or why there is none."""
        from detent.motors import engine
        from detent.motors.variants import corners, loss_rate

        if self.tried == 0:
            return None, "variants: none asked for"
        tried = VARIANTS if self.tried is None else self.tried
        seconds = ((move.train.duration or 0) + move.rig.settle) * 1e-9
        work = seconds * (tried + len(corners(self.spread.of(move.rig))))
        most = MOST_SIMULATED if move.rig.load.is_steady else MOST_SIMULATED / 10
        if self.tried is None and (work > most or not engine.fast()):
            return None, f"variants: not judged, as that takes long here; --variants {VARIANTS} does it"
        return loss_rate(move.train, move.rig, spread=self.spread, tried=tried, seed=self.seed), ""


def _judge(
    move: _Move, many: _Variants, facts: dict[str, Any], sensitivity: bool, pull_in: bool, plot: Path | None,
    json: bool,
) -> None:  # fmt: skip
    from detent.motors.diagnosis import diagnose
    from detent.motors.move import simulate

    duration = move.train.duration
    assert duration is not None
    _warn_of_waiting((duration + move.rig.settle) * 1e-9)
    run = simulate(move.train, move.rig, sample=max(duration // 20_000, 1) if plot is not None else None)
    verdict = run.verdict
    loss = diagnose(move.train, move.rig) if verdict.lost else None
    rate, why_not = many.judge(move)
    if move.remark:
        facts["remark"] = move.remark
    facts |= {"move": move.words, "pulses": run.pulses, "duration_s": duration * 1e-9, "verdict": _facts(verdict)}
    if loss is not None:
        facts["loss"] = loss._asdict()
    if rate is not None:
        spread = many.spread.of(move.rig)
        facts["variants"] = {
            **rate._asdict(), "bound": rate.bound, "ranges": {k: list(v) for k, v in spread._asdict().items()}
        }  # fmt: skip
    if sensitivity:
        facts["sensitivity"] = _sensitivity(move.rig, move.train)
    if pull_in:
        facts |= _pull_in(move.found)
    if plot is not None:
        from detent.outputs import motor_figures

        about = _line(verdict, move.rig) if loss is None else f"steps {loss}"
        motor_figures.write_move(plot, run, f"{move.steps} steps: {move.words.partition(' (')[0]}", about)
    if json:
        print(json_text.dumps(facts))
        return
    _print_head(move.found, facts)
    print(f"{move.steps} steps in {duration * 1e-9:.4g} s, {move.words}:")
    if move.remark:
        print(f"  {move.remark}")
    print(f"  {_line(verdict, move.rig)}" if loss is None else f"  steps {loss}")
    print(f"  {rate}" if rate is not None else f"  {why_not}")
    if rate is not None:
        print(f"  variants: {ranges_of(many.spread.of(move.rig))}")
    print(f"  assumed: {'; '.join(move.found.words)}")
    if sensitivity:
        print()
        _print_sensitivity(facts["sensitivity"])
    if pull_in:
        _print_pull_in(move.found, facts)
    if plot is not None:
        print(f"Wrote {plot}")


def _warn_of_waiting(seconds: float) -> None:
    """Say how long it takes, where that is long. MotorError where nobody would wait."""
    import sys

    from detent.motors import engine
    from detent.motors.motor import MotorError

    if seconds > LONGEST:
        raise MotorError(
            f"a move of {seconds:.0f} s, with its time to settle, takes too long to compute, and at constant speed "
            f"nothing new happens: judge a shorter one, of at most {LONGEST:.0f} s"
        )
    wait = seconds / SIMULATED
    if wait > 4 and engine.fast() and sys.stderr.isatty():
        print(f"Computing {seconds:.0f} s of motion: about {wait:.0f} s ...", file=sys.stderr)


def _line(verdict: "Verdict", rig: "Rig") -> str:
    words = f"{verdict}; {verdict.where_it_rests}"
    if rig.motor.accuracy:
        words += f" (its maker lets microsteps be {rig.motor.accuracy:g} of a step off: that is in it)"
    return words


def ranges_of(spread: Any) -> str:
    """What variants differ in, in words."""
    names = {"torque_constant": "torque"}
    return ", ".join(
        f"{names.get(name, name)} x{low:g}-{high:g}" for name, (low, high) in spread._asdict().items() if low != high
    )


def _facts(verdict: "Verdict") -> dict[str, Any]:
    return {**verdict._asdict(), "steps_lost": verdict.steps_lost, "resting": verdict.resting}


def _sensitivity(rig: "Rig", train: Any) -> dict[str, list[dict[str, Any]]]:
    """The margin of the same move, one number changed at a time."""
    from detent.motors.motor import MotorError
    from detent.motors.variants import changed, judge

    quantities = ["inertia", "voltage", "damping"]
    if rig.load.friction or rig.load.viscous or rig.motor.viscous:
        quantities.insert(1, "friction")
    if rig.load.torque or not rig.load.is_steady:
        quantities.append("load")
    rows, rigs = [], []
    for quantity in quantities:
        for factor in FACTORS:
            try:
                rigs.append(changed(rig, **{quantity: factor}))
                rows.append((quantity, factor))
            except MotorError:
                continue  # a supply too low for the current at all
    result: dict[str, list[dict[str, Any]]] = {quantity: [] for quantity in quantities}
    if rig.load.is_steady:
        verdicts = judge(train, rigs)
    else:
        verdicts = [judge(train, [one])[0] for one in rigs]
    for (quantity, factor), verdict in zip(rows, verdicts, strict=True):
        result[quantity].append({"factor": factor, "lost": verdict.lost, "margin": verdict.margin})
    return result


def _print_sensitivity(found: dict[str, list[dict[str, Any]]]) -> None:
    table = table_of("margin with", *(f"x{factor:g}" for factor in FACTORS))
    for quantity, rows in found.items():
        cells = {row["factor"]: "[red]lost[/red]" if row["lost"] else f"{row['margin']:.0%}" for row in rows}
        table.add_row(quantity, *(cells.get(factor, "-") for factor in FACTORS))
    print_table(table)


# -- printing ------------------------------------------------------------------------------------------------


def _print_head(found: Made, facts: dict[str, Any]) -> None:
    motor, drive = found.motor, found.drive
    what = f" ({motor.title})" if motor.title else ""
    print(f"{motor.name}{what}: {motor.current:g} A, {motor.resistance:g} ohm, {motor.inductance * 1e3:g} "
          f"mH, {motor.holding_torque:g} Nm")  # fmt: skip
    decay = f"{drive.name} ({drive.decay} decay)" if drive.name else f"{drive.decay} decay"
    print(f"{drive.supply:g} V, {drive.current:g} A, {drive.winding.name} step, {decay}")
    if found.fit is not None:
        fit = facts["fit"]
        print(f"fitted to a measured curve: inductance x{fit['inductance_factor']:.2f}, {fit['viscous']:.2g} Nm s/rad "
              "of friction")  # fmt: skip
        print(found.fit.reach)
    print()


def table_of(*columns: str) -> Any:
    """A table without a frame; numbers stand at the right, and whole: where it is narrow, words are folded."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in columns:
        left = column in ("motor", "", "maker", "margin with", " ")
        table.add_column(column, no_wrap=not left, overflow="fold", justify="left" if left else "right")
    return table


def print_table(table: Any) -> None:
    """Print it as wide as the terminal is."""
    from rich.console import Console

    Console(highlight=False).print(table)
