"""The verb `compare-moves`: settings of a controller beside each other."""

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from detent.cli.rig import Options, RigOptions

if TYPE_CHECKING:
    from detent.tuner.compare import Compared
    from detent.tuner.task import Task

FEWEST, MOST = 2, 6


def compare_moves(
    model: str,
    *settings: str,
    motor: str,
    moves: str,
    rig: Options = RigOptions(),  # noqa: B008 (never changes)
    vary: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    variants: int = 512,
    seed: int = 1,
    plot: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> None:
    """Compare settings: times, loss rates, torque used.

    Each of the settings is a word in quotes, like "S=48 T=604 R=202". They are judged with the same variants.

    For example:
    `detent compare-moves gs-c200 "S=48 T=604 R=201" "S=102 T=405 R=36" --motor qsh4218-41-10-035 --moves 1000`

    Parameters
    ----------
    model
        The controller: gs-c200, dcb-274, ...
    settings
        Two to six of them; what one does not name is as at first.
    motor
        A motor by name, or a TOML file of your own.
    moves
        Steps of each move: 200,1000,5000.
    rig
        Drive and load.
    vary
        What variants differ in: inertia=0.2 (a part either way) or friction=0.3-2 (factors).
    variants
        How many are drawn, beside all corners.
    seed
        Seed of the draws: the same one draws the same variants.
    plot
        Draw speed and torque used: a .png, .svg or .pdf file.
    overwrite
        Write over a file that no run has drawn.
    json
        Print everything as one line of JSON.
    """
    from detent.cli.endings import asked_wrongly
    from detent.cli.rig import made, read_by, spread_of
    from detent.moves.law import winding_of
    from detent.moves.spelling import read
    from detent.outputs import figures
    from detent.outputs.files import check_outputs
    from detent.tuner.compare import compare
    from detent.tuner.task import Task, check_installed, check_rig, moves_of

    try:
        if not FEWEST <= len(settings) <= MOST:
            raise ValueError(f'{len(settings)} settings: give two to {MOST}, each in quotes: "S=48 T=604 R=202"')
        if plot is not None:
            figures.check(plot)
            check_outputs([plot], read_by(motor, rig), asked=overwrite)
        check_installed()  # before a fit, which takes its time
        laws = [(text, *read(model, text.replace(";", " ").split())) for text in settings]
        windings = {winding_of(law, rig.step).name for _, law, _ in laws}
        if len(windings) > 1:
            raise ValueError(f"these settings step by {', '.join(sorted(windings))}: compare those of one step size")
        found = made(motor, rig, winding_of(laws[0][1], rig.step))
        task = Task(model, check_rig(found.rig, found.motor.name), moves_of(moves), {}, "", spread_of(vary), seed,
                    final=variants)  # fmt: skip
        rows = compare(task, laws)
        if plot is not None:
            _plot(plot, task, rows)
    except ValueError as error:
        asked_wrongly(error)
    if json:
        facts = [_facts(task, row) for row in rows]
        about = {"model": model, "motor": found.motor.name, "assumed": list(found.words), "seed": seed}
        print(json_text.dumps({**about, "settings": facts}))
        return
    _print(task, rows)
    for row in rows:
        if row.remark:
            print(f"\n{row.name}: {row.remark}", end="")
    if task.both_ways:
        print("\njudged in both directions, as the load pulls", end="")
    print("\nassumed: " + "; ".join(found.words))
    if plot is not None:
        print(f"Wrote {plot}")


def _facts(task: "Task", row: "Compared") -> dict[str, Any]:
    check = row.check
    return {
        "settings": row.name,
        "moves": [{"steps": move.steps, "time_s": time} for move, time in zip(task.moves, row.times, strict=True)],
        "check": {"variants": check.variants, "lost": check.lost, "corners": check.corners,
                  "corners_lost": check.corners_lost, "looks": check.looks,
                  "rate_below": check.bound},
        "torque_used": row.most_used, **({"remark": row.remark} if row.remark else {}),
    }  # fmt: skip


def _print(task: "Task", rows: "list[Compared]") -> None:
    from detent.cli.motor import print_table, table_of
    from detent.motors.variants import percent

    table = table_of("", *(row.name for row in rows))
    for k, move in enumerate(task.moves):
        table.add_row(f"{move.steps} steps", *(f"{row.times[k]:.4f} s" for row in rows))
    table.add_row("lost", *(f"{row.check.lost} of {row.check.variants}" for row in rows))
    table.add_row(f"rate, at 95 %, {len(rows)} looks counted", *(f"below {percent(row.check.bound)}" for row in rows))
    table.add_row("corners lost", *(f"{row.check.corners_lost} of {row.check.corners}" for row in rows))
    table.add_row("torque used, at most", *(f"{row.most_used:.0%}" for row in rows))
    print_table(table)


def _plot(path: Path, task: "Task", rows: "list[Compared]") -> None:
    from detent.outputs.tuning_figures import Line, write_comparison

    longest = max(move.steps for move in task.moves)
    lines = [
        Line(f"{row.name}: lost by {row.check.lost} of {row.check.variants}", row.at, row.speeds, row.used)
        for row in rows
    ]
    about = f"{task.rig.motor.name}, {task.rig.drive.supply:g} V  \N{MIDDLE DOT}  {longest} steps"
    write_comparison(path, lines, title=f"{task.model}: settings compared", about=about)
