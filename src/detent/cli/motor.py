"""The verb `motor`: torque against speed, one move judged, and how much it takes to lose a step."""

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detent.motors.curve import PullOut
    from detent.motors.move import Run, Verdict
    from detent.motors.rotor import Rig

FACTORS = (0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.5, 2.0, 3.0)
RATES = (25, 50, 100, 250, 500, 750, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 7500, 10000)


def motor(
    name: str | None = None,
    *,
    supply: float = 24.0,
    current: float | None = None,
    step: str = "half",
    decay: str = "fast",
    inertia: float | None = None,
    friction: float = 0.0,
    viscous: float = 0.0,
    torque: float = 0.0,
    fit: bool = False,
    move: int | None = None,
    start: float = 100.0,
    slew: float = 1000.0,
    ramp: int = 50,
    sensitivity: bool = False,
    pull_in: bool = False,
    plot: Path | None = None,
    json: bool = False,
) -> None:
    """Say what a motor makes of its pulses: torque against speed, a move judged.

    Without a name: the motors there are. Speeds are in steps/s of the stepping in use, as a controller counts them.

    Parameters
    ----------
    name
        A motor by name, like qsh4218-41-10-035.
    supply
        Supply of the drive, V.
    current
        Phase current with both phases on, A; the motor's own rating unless given.
    step
        full, wave, half, half-compensated, or 1/2 to 1/64.
    decay
        fast, slow, or voltage (pulse width without current feedback).
    inertia
        Of the load, kg m2; that of the rotor unless given.
    friction
        Coulomb friction of the load, Nm.
    viscous
        Viscous friction of the load, Nm s/rad.
    torque
        Torque that pulls towards minus, Nm.
    fit
        Fit inductance and friction to the curve that the maker published, if there is one.
    move
        Judge a move of so many steps, with --start, --slew and --ramp (the GS-C200's S, T and R).
    start
        Start-stop speed, steps/s.
    slew
        Slew speed, steps/s.
    ramp
        Steps of each ramp.
    sensitivity
        The same move with more and less inertia, friction and voltage.
    pull_in
        The highest speed that this motor starts into without a ramp.
    plot
        Draw it: a .png, .svg or .pdf file.
    json
        Print everything as one line of JSON.
    """
    from detent.cli.target import asked_wrongly, failed
    from detent.motors.motor import MotorError

    try:
        if name is None:
            _list(json)
            return
        if plot is not None:
            from detent.outputs import figures

            figures.check(plot)
        rig, rms = _rig(name, supply, current, step, decay, inertia, friction, viscous, torque, fit)
        facts: dict[str, Any] = {"motor": rig.motor.name, "source": rig.motor.source, **_settings(rig)}
        if rms is not None:
            facts["fit"] = {"inductance_factor": rig.motor.inductance_factor, "viscous": rig.motor.viscous, "rms": rms}
        if sensitivity and move is None:
            asked_wrongly(ValueError("--sensitivity is of a move: add --move STEPS"))
        if move is not None:
            _judge(rig, facts, move, start, slew, ramp, sensitivity, plot, json)
        else:
            _curve(rig, facts, pull_in, plot, json)
    except (MotorError, ValueError) as error:
        asked_wrongly(error)
    except ImportError as error:
        failed(error)
    except OSError as error:
        failed(f"{error.filename}: cannot write it: {error.strerror}")


def _rig(
    name: str, supply: float, current: float | None, step: str, decay: str, inertia: float | None, friction: float,
    viscous: float, torque: float, fit: bool,
) -> "tuple[Rig, float | None]":  # fmt: skip
    from detent.motors.drive import Drive
    from detent.motors.fit import fitted
    from detent.motors.load import Load
    from detent.motors.named import motor as named
    from detent.motors.rotor import FINE, Rig
    from detent.motors.winding import winding

    found, rms = named(name), None
    if fit:
        result = fitted(found.name)
        found, rms = result.motor, result.rms
    drive = Drive(supply, found.current if current is None else current, winding(step), decay)  # type: ignore[arg-type]
    if found.inertia is None:
        # good enough for a curve, which knows no inertia; a move needs a number
        if inertia is None:
            found = found.changed(inertia=1e-5)
        else:
            found, inertia = found.changed(inertia=inertia), 0.0
    load = Load(found.rotor if inertia is None else inertia, friction, viscous, torque)
    return Rig(found, drive, load, FINE), rms


def _settings(rig: "Rig") -> dict[str, Any]:
    drive, load = rig.drive, rig.load
    return {
        "supply": drive.supply, "current": drive.current, "step": drive.winding.name, "decay": drive.decay,
        "inertia": rig.motor.rotor + load.inertia, "friction": load.friction, "viscous": load.viscous,
        "torque": load.torque,
    }  # fmt: skip


def _list(json: bool) -> None:
    from detent.motors.named import CURVES, MOTORS

    if json:
        rows = [
            {
                "name": motor.name, "title": motor.title, "source": motor.source, "current": motor.current,
                "resistance": motor.resistance, "inductance": motor.inductance, "holding_torque": motor.holding_torque,
                "inertia": motor.inertia, "curve": motor.name in CURVES,
            }
            for motor in MOTORS.values()
        ]  # fmt: skip
        print(json_text.dumps({"motors": rows}))
        return
    table = _table("motor", "", "A", "ohm", "mH", "Nm", "g cm2", "maker")
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
    _print(table)
    print("\ndetent motor NAME  shows torque against speed;  detent motor NAME --move 1000 --slew 2000  judges a move.")


# -- torque against speed ------------------------------------------------------------------------------------


def _curve(rig: "Rig", facts: dict[str, Any], pull_in: bool, plot: Path | None, json: bool) -> None:
    from detent.motors.curve import pull_in_rate, torque_curve
    from detent.motors.named import CURVES

    per_step = rig.drive.winding.steps
    points = _useful(torque_curve(rig.motor, rig.drive, RATES))
    facts["curve"] = [
        {
            "rate": point.rate * per_step,
            "full_steps_per_s": point.rate,
            "torque": point.torque,
            "load_angle": point.angle,
        }
        for point in points
    ]
    measured = CURVES.get(rig.motor.name)
    if pull_in:
        found = pull_in_rate(rig.motor, rig.drive, rig.load)
        facts["pull_in"] = found.pull_in * per_step
        facts["holes"] = [[low * per_step, high * per_step] for low, high in found.holes]
        facts["highest_start"] = found.highest * per_step
    if plot is not None:
        from detent.outputs import motor_figures

        motor_figures.write_curve(plot, rig, points, measured)
    if json:
        print(json_text.dumps(facts))
        return
    _print_head(rig, facts)
    table = _table(f"{rig.drive.winding.name} steps/s", "full steps/s", "turns/min", "Nm", "W", "load angle")
    for point in points:
        turns = point.rate / rig.motor.steps
        table.add_row(f"{point.rate * per_step:g}", f"{point.rate:g}", f"{turns * 60:g}", f"{point.torque:.3f}",
                      f"{point.torque * turns * 6.283185307:.1f}", f"{point.angle:.0f}\N{DEGREE SIGN}")  # fmt: skip
    _print(table)
    if pull_in:
        print(
            f"\nStarts without a ramp into up to {facts['highest_start']:.0f} steps/s; a common rule takes half of it."
        )
        if facts["holes"]:
            bands = ", ".join(f"{low:.0f}-{high:.0f}" for low, high in facts["holes"])
            print(f"Resonance loses steps at {bands} steps/s: friction damps it, and so does a finer step.")
    if plot is not None:
        print(f"Wrote {plot}")


def _useful(points: "list[PullOut]") -> "list[PullOut]":
    """The curve to where nothing is left, with the first such point."""
    for k, point in enumerate(points):
        if point.torque <= 0:
            return points[: k + 1]
    return points


# -- one move ------------------------------------------------------------------------------------------------


def _judge(
    rig: "Rig", facts: dict[str, Any], steps: int, start: float, slew: float, ramp: int, sensitivity: bool,
    plot: Path | None, json: bool,
) -> None:  # fmt: skip
    from detent.cli.target import asked_wrongly
    from detent.motors.move import simulate
    from detent.ramps.constant_acceleration import move

    if steps < 1:
        asked_wrongly(ValueError(f"--move {steps}: a move has at least one step"))
    if rig.motor.inertia == 1e-5:
        asked_wrongly(
            ValueError(f"--inertia: the maker of {rig.motor.name} gives no rotor inertia: give rotor and load together")
        )
    train = move(round(start), round(slew), ramp, steps).train
    duration = train.duration
    assert duration is not None
    run = simulate(train, rig, sample=max(duration // 20_000, 1) if plot is not None else None)
    facts |= {"pulses": run.pulses, "duration_s": duration * 1e-9, "verdict": _facts(run.verdict)}
    if sensitivity:
        facts["sensitivity"] = _sensitivity(rig, train)
    if plot is not None:
        from detent.outputs import motor_figures

        motor_figures.write_move(plot, run, f"{steps} steps: {round(start)} to {round(slew)} steps/s in {ramp}")
    if json:
        print(json_text.dumps(facts))
        return
    _print_head(rig, facts)
    print(f"{steps} steps in {duration * 1e-9:.4g} s, {round(start)} to {round(slew)} steps/s in ramps of {ramp}:")
    print(f"  {run.verdict}; at rest {run.verdict.error:+.2f} full steps behind" + _room(run))
    if sensitivity:
        print()
        _print_sensitivity(facts["sensitivity"])
    if plot is not None:
        print(f"Wrote {plot}")


def _room(run: "Run") -> str:
    return f"; margin {run.verdict.margin:.0%}" if not run.verdict.lost else ""


def _facts(verdict: "Verdict") -> dict[str, Any]:
    return {**verdict._asdict(), "steps_lost": verdict.steps_lost}


def _sensitivity(rig: "Rig", train: Any) -> dict[str, list[dict[str, Any]]]:
    """The margin of the same move, one number changed at a time."""
    from detent.motors.motor import MotorError
    from detent.motors.variants import changed, judge

    quantities = ["inertia", "voltage"]
    if rig.load.friction or rig.load.viscous or rig.motor.viscous:
        quantities.insert(1, "friction")
    if rig.load.torque:
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
    for (quantity, factor), verdict in zip(rows, judge(train, rigs), strict=True):
        result[quantity].append({"factor": factor, "lost": verdict.lost, "margin": verdict.margin})
    return result


def _print_sensitivity(found: dict[str, list[dict[str, Any]]]) -> None:
    table = _table("margin with", *(f"x{factor:g}" for factor in FACTORS))
    for quantity, rows in found.items():
        cells = {row["factor"]: "[red]lost[/red]" if row["lost"] else f"{row['margin']:.0%}" for row in rows}
        table.add_row(quantity, *(cells.get(factor, "-") for factor in FACTORS))
    _print(table)


# -- printing ------------------------------------------------------------------------------------------------


def _print_head(rig: "Rig", facts: dict[str, Any]) -> None:
    motor, drive = rig.motor, rig.drive
    print(f"{motor.name} ({motor.title}): {motor.current:g} A, {motor.resistance:g} ohm, {motor.inductance * 1e3:g} "
          f"mH, {motor.holding_torque:g} Nm")  # fmt: skip
    print(f"{drive.supply:g} V, {drive.current:g} A, {drive.winding.name} step, {drive.decay} decay")
    if "fit" in facts:
        fit = facts["fit"]
        print(f"fitted to the maker's curve: inductance x{fit['inductance_factor']:.2f}, {fit['viscous']:.2g} Nm s/rad "
              f"of friction, {fit['rms']:.1%} of the holding torque off (rms)")  # fmt: skip
    print()


def _table(*columns: str) -> Any:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in columns:
        table.add_column(
            column, no_wrap=True, justify="left" if column in ("motor", "", "maker", "margin with") else "right"
        )
    return table


def _print(table: Any) -> None:
    from rich.console import Console

    Console(highlight=False).print(table)
