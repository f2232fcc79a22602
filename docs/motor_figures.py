"""Draw the pictures of docs/how-to/motors.md: python docs/motor_figures.py [FOLDER]. Each run draws the same."""

import sys
from dataclasses import replace
from math import asin, pi, sqrt
from pathlib import Path

import numpy as np

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.motors.damping import UNDAMPED, Damping
from detent.motors.drive import Drive
from detent.motors.fit import fitted
from detent.motors.load import Load
from detent.motors.move import Run, simulate
from detent.motors.named import CURVES, motor
from detent.motors.rotor import Rig
from detent.motors.variants import SPREAD, Ensemble, draws
from detent.motors.winding import FULL, HALF
from detent.outputs import motor_figures, rotors
from detent.outputs.figures import COLOURS, GREY, style
from detent.pulses import Train
from detent.ramps.constant_acceleration import move
from detent.ramps.curves import sine_squared
from detent.ramps.differences import compiled
from detent.ramps.table_movement import ramped
from detent.ticks import MS

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
OPEN_LOOP = ('to = "axis.ENABLE"', 'to = "axis.UI3"')


def example(name: str, *replaced: tuple[str, str]) -> Cell:
    """An example cell, run to its end, with texts replaced."""
    folder = EXAMPLES / name
    text = (folder / "cell.toml").read_text()
    for old, new in replaced:
        text = text.replace(old, new)
    cell = build(parse(text, name), lambda file: (folder / file).read_text())
    while cell.step() is not None:
        pass
    return cell


def supersigma(top: float, steps: int) -> Train:
    """The SUPERSIGMA ramp, V = top sin^2(...), from 650 half steps/s in 0.3 s, and back."""
    phase = asin(sqrt(650 / top))
    table = compiled(sine_squared(top, (pi / 2 - phase) / 0.3, phase), 0.3)
    return ramped(table, table.first, len(table.differences), steps, 10).train


def big_rig(supply: float) -> Rig:
    """What is assumed of the paper's 34-frame motor: see the page."""
    found = motor("as1060").changed(inductance_factor=1.8).in_parallel()
    return Rig(found, Drive(supply, found.current, HALF), Load(viscous=5e-4))


def torque_curve(folder: Path) -> None:
    """The published curve, the sheet alone, and the fit."""
    from detent.motors.curve import torque_curve as solve

    fit = fitted("qsh4218-41-10-035").motor
    rig = Rig(fit, Drive(24, 1.0, HALF))
    points = solve(fit, rig.drive, [50, *range(250, 5250, 250)])
    motor_figures.write_curve(folder / "motor-torque.png", fit, rig.drive, points, CURVES[fit.name])


def closed_loop(folder: Path) -> None:
    """Rotor against command, open loop and closed."""
    with style():
        figure, panels = motor_figures.blank(
            "Closed loop: a step detector on ENABLE", "2000 half steps, a ramp too short", 2
        )
        for axes, title, cell in (
            (panels[0], "open loop: the rotor is left behind", example("closed-loop-motor", OPEN_LOOP)),
            (panels[1], "closed loop: each pulse waits for the step before", example("closed-loop-motor")),
        ):
            trace = rotors.of_cell(cell)[0]
            axes.plot(trace.times * 1e-6, trace.commands, color=GREY, label="command")
            axes.plot(trace.times * 1e-6, trace.places, color=COLOURS[0], label="rotor")
            axes.set_title(title, loc="left", fontsize=10)
            axes.set_xlim(0, 720)
            axes.legend(frameon=False, loc="upper left")
            motor_figures.label_axes(axes, "time (ms)", "half steps")
        motor_figures.save(figure, folder / "motor-closed-loop.png")


def damping(folder: Path) -> None:
    """A single step with and without the phase reversal."""
    with style():
        figure, panels = motor_figures.blank(
            "Electronic damping by phase reversal", "one full step; brake 1.1 ms, release 2 ms", 1
        )
        axes = panels[0]
        for trace, colour, words in zip(
            rotors.of_cell(example("damping")), (COLOURS[1], COLOURS[0]), ("plain", "damped"), strict=True
        ):
            axes.plot(trace.times * 1e-6 - 12, trace.places, color=colour, label=words, linewidth=1.1)
        axes.set_xlim(-2, 60)
        axes.set_ylim(-0.2, 2.2)
        axes.legend(frameon=False)
        motor_figures.label_axes(axes, "time (ms)", "rotor (full steps)")
        motor_figures.save(figure, folder / "motor-damping.png")


def damping_of_pulses(folder: Path) -> None:
    """What the assumed damping changes: a slow move, and the resonance of middle speeds."""
    large = motor("qsh4218-41-10-035")
    kinds = ((None, COLOURS[0], "0.12, falling with the speed (assumed)"), (UNDAMPED, COLOURS[1], "none"),
             (Damping(0.12, roll_off=1e6), COLOURS[2], "0.12 at all speeds"))  # fmt: skip
    with style():
        figure, panels = motor_figures.blank("Damping about the speed of the pulses", "qsh4218-41-10-035, 24 V", 2)
        for kind, colour, words in reversed(kinds[:2]):
            rig = Rig(large, Drive(24, 1.0, FULL), Load(large.rotor), damping=kind)
            run = simulate(move(100, 400, 50, 300).train, rig, sample=MS // 5)
            panels[0].plot(run.times * 1e3, run.rotor, color=colour, label=words, linewidth=1.2)
        panels[0].plot(run.times * 1e3, run.command, color=GREY, linewidth=0.8, label="command")
        panels[0].set_title("300 full steps, 100 to 400 steps/s", loc="left", fontsize=10)
        panels[0].legend(frameon=False)
        motor_figures.label_axes(panels[0], "time (ms)", "full steps")
        slews = range(2000, 10_001, 500)
        for kind, colour, words in kinds:
            rig = Rig(large, Drive(24, 1.0, HALF, "slow"), Load(large.rotor), damping=kind)
            some = Ensemble(rig, draws(SPREAD.of(rig), 64))
            lost = [100 * some.judge(move(1000, top, 600, 6000).train).lost.mean() for top in slews]
            panels[1].plot(slews, lost, "o-", color=colour, markersize=3.5, label=words)
        panels[1].set_title("6000 half steps, slow decay: how many of 64 variants lose steps", loc="left", fontsize=10)
        panels[1].legend(frameon=False, loc="center right")
        motor_figures.label_axes(panels[1], "slew speed (half steps/s)", "lost (%)")
        motor_figures.save(figure, folder / "motor-pulse-damping.png")


def critical_region(folder: Path) -> None:
    """Speed and load angle of the SUPERSIGMA ramp, the corner shaded."""
    loaded = replace(big_rig(160), load=Load(inertia=1e-3, viscous=5e-3))
    run: Run = simulate(supersigma(15_000, 10_000), loaded, sample=MS // 50)
    with style():
        figure, panels = motor_figures.blank(
            "The critical region (the paper's figure 5)", f"15 000 half steps/s in 0.3 s: {run.verdict}", 2
        )
        times = run.times * 1e3
        corners = [300.0, float(times[np.flatnonzero(run.speed * 2 > 14_800)[-1]])]
        for axes in panels:
            for corner in corners:
                axes.axvspan(corner - 35, corner + 35, color=COLOURS[4], alpha=0.25, linewidth=0)
            axes.set_xlim(0, float(times[-1]))
        panels[0].plot(times, run.speed * 2, color=COLOURS[0])
        motor_figures.label_axes(panels[0], "", "rotor (half steps/s)")
        panels[1].plot(times, run.load_angles, color=COLOURS[0], linewidth=0.5)
        motor_figures.label_axes(panels[1], "time (ms)", "load angle (el. degrees)")
        motor_figures.save(figure, folder / "motor-critical-region.png")


def main(folder: Path) -> None:
    """All pictures."""
    for draw in (torque_curve, closed_loop, damping, damping_of_pulses, critical_region):
        draw(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "pictures")
