"""The verb `tune`: the fastest settings of a controller with which a motor and its load lose no step."""

import json as json_text
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from detent.cli.rig import Made, Options, RigOptions
from detent.cli.tune_on import NO_MACHINE, MachineOptions

if TYPE_CHECKING:
    from detent.tuner.into import Changed
    from detent.tuner.search import Cancelled, Watch
    from detent.tuner.spaces import Profile
    from detent.tuner.task import Move, Task
    from detent.tuner.tune import Tuned

INTERRUPTED = 130
Machine = Annotated[MachineOptions, Parameter(name="*")]


def tune(
    model: str,
    *,
    motor: str | None = None,
    moves: str | None = None,
    machine: Machine = NO_MACHINE,
    rig: Options = RigOptions(),  # noqa: B008 (never changes)
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    axis: str = "",
    vary: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    no_corners: bool = False,
    variants: int = 2048,
    seed: int = 1,
    each_move: bool = False,
    map_: Annotated[list[Path] | None, Parameter(name="--map")] = None,
    into: Path | None = None,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    overwrite: bool = False,
    batch: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    gpu: Annotated[bool | None, Parameter(negative="--no-gpu")] = None,
    json: bool = False,
) -> None:
    """Find the fastest settings with which a motor and its load lose no step.

    The settings are the controller's own: S, T, R of a GS-C200; I, V, K of a DCB-274; K, R, P and the step size of a
    BS0610 or BS0710; the table of a SUPERSIGMA. The pulses that are judged are those that it gives for the commands
    printed. Ctrl-C prints the best so far.

    For example:
    `detent tune gs-c200 --motor qsh4218-41-10-035 --fit --inertia 1.5e-5 --friction 0.02 --moves 200,1000`

    Or: `detent tune gs-c200s --on /dev/ttyUSB0 --witness UI1 --travel 1200 --moves 1000 --begin S=60 T=400 R=300`

    Parameters
    ----------
    model
        The controller: gs-c200, dcb-274, supersigma, bs0610, ...
    motor
        A motor by name, like qsh4218-41-10-035, or a TOML file of your own; not needed with --on.
    moves
        What is to be fast: 200,1000x3,5000 is 200 steps, 1000 three times as often, and 5000.
    machine
        Trials on the machine itself, in place of a model of the motor.
    rig
        Drive and load.
    set_
        An option of the model: --set step_size=4 keeps the microstep of a BS0610.
    axis
        Which motor of a board that has several: X or Y.
    vary
        What machines differ in: inertia=0.2 (a part either way) or friction=0.3-2 (factors).
    no_corners
        Do not ask that every corner of these ranges makes the moves.
    variants
        How many fresh variants must make them in the end.
    seed
        Seed of the draws: the same one gives the same answer.
    each_move
        Settings for each move alone, to be sent before it.
    map_
        Draw how many variants lose over slew speed and ramp: a .png, .svg or .pdf file; or a .csv file of the numbers.
    into
        Write the settings to this file: a program, or what --from names with these settings in place of its own.
    from_
        A program, a backup or a cell file that sets such settings; it is left as it is.
    overwrite
        Write over files that are there.
    batch
        A CSV file with a row for each machine; its columns are options like motor, supply, inertia, friction and moves,
        in place of those here. Prints it with the settings found, a row as soon as it is known; --json: a line each.
    workers
        Divide the work over so many processes of this computer.
    scheduler
        Divide it over the workers of this dask scheduler: tcp://HOST:8786.
    gpu
        Judge many variants on a GPU: where there is one, unless --no-gpu; --gpu asks that there is.
    json
        Print everything as one line of JSON.
    """
    from detent.cli.endings import asked_wrongly, tell
    from detent.cli.rig import made, read_by, spread_of, step_of
    from detent.moves.law import winding_of
    from detent.tuner import tune as tuning
    from detent.tuner.judge import judge_of
    from detent.tuner.search import Stopped
    from detent.tuner.task import Task, check_installed, check_rig, moves_of

    try:
        if machine.on is not None:
            _on_the_machine(model, motor, moves, rig, machine, axis, json)
            return
        divided_up = workers is not None or scheduler is not None
        _take_gpu(gpu, divided=divided_up)
        if batch is not None:
            from detent.cli.tune_batch import tune_batch

            if not divided_up:  # else Workers says first what it needs itself
                check_installed()
            tune_batch(batch, model, motor, moves, rig, _options(set_), axis, vary, seed, variants, not no_corners,
                       workers, scheduler, json)  # fmt: skip
            return
        if moves is None:
            raise ValueError("--moves: say what is to be fast: --moves 200,1000x3")
        if motor is None:
            raise ValueError("--motor: name one (detent motor lists them), or a TOML file of your own; or --on PORT")
        if machine != NO_MACHINE:
            raise ValueError("--witness, --travel and the like are of trials on a machine: say where it is: --on PORT")
        outputs = [*(map_ or []), *([into] if into is not None else [])]
        read = [*read_by(motor, rig), *([from_] if from_ is not None else [])]
        _check(outputs, read, map_ or [], from_, into, overwrite, each_move)
        if not divided_up:
            check_installed()  # before a fit, which takes its time
        asked, options = moves_of(moves), _options(set_)
        found = made(motor, rig, winding_of(_law(model, options, axis), step_of(rig, model)))
        task = Task(model, check_rig(found.rig, found.motor.name), asked, options, axis, spread_of(vary), seed,
                    not no_corners, final=variants)  # fmt: skip
        if into is not None:
            first = judge_of(task).space
            _changed(task, first.profile(first.hand), from_)  # what cannot be written is told before the work
        with _interruptible() as cancelled, _divided(workers, scheduler) as divided:
            do: Any = tuning.each_move if each_move else tuning.tune
            with _watch() as watch:
                done = do(task, watch=watch, cancelled=cancelled, **divided)
            answers: list[Tuned] = done if each_move else [done]
            if json:
                facts = [_facts(one, found) for one in answers]
                print(json_text.dumps({"each_move": facts} if each_move else facts[0]), flush=True)
            else:
                _print(answers, found)  # before files are written: whatever becomes of these, it is told
            left = list(outputs)
            if answers[0].found.whole:  # what nothing has proved goes into no file
                if into is not None:
                    _into(answers[0], into, from_)
                    left.remove(into)
                if map_ and not cancelled() and _map(answers[0], map_, cancelled, divided):
                    left = []
            stopped = cancelled()
    except Stopped as error:
        tell(error)
        raise SystemExit(INTERRUPTED) from None
    except ValueError as error:  # TunerError, MotorError, SettingError, CatalogueError
        asked_wrongly(error)
    for path in outputs if not json else ():
        if path not in left:
            print(f"Wrote {path}")
    if stopped:
        _say_what_is_missing(answers, asked, left)
        raise SystemExit(INTERRUPTED)


def _on_the_machine(
    model: str, motor: str | None, moves: str | None, rig: RigOptions, machine: MachineOptions, axis: str, json: bool
) -> None:
    from dataclasses import replace

    from detent.cli.tune_on import tune_on
    from detent.tuner.task import moves_of

    if moves is None:
        raise ValueError("--moves: say which moves are to be tried: --moves 1000")
    if motor is not None or replace(rig, step=None) != RigOptions():
        raise ValueError("--on: trials on a machine need no model: leave --motor and the load out")
    tune_on(model, [move.steps for move in moves_of(moves)], rig.step, machine, axis=axis, json=json)


@contextmanager
def _divided(workers: int | None, scheduler: str | None) -> "Iterator[dict[str, Any]]":
    """What a search is told so that others do its work; nothing where this process does."""
    if workers is None and scheduler is None:
        yield {}
        return
    from detent.cli.endings import failed
    from detent.realtime.workers import Workers, WorkersLost

    try:
        with Workers(workers, scheduler) as found:
            yield {"run": found.run, "ahead": 4 * found.count()}
    except WorkersLost as error:
        failed(error)


def _take_gpu(wanted: bool | None, *, divided: bool) -> None:
    """Judge on a GPU where there is one, or as asked; processes that share the work judge on their processors."""
    from detent.motors import gpu

    if wanted and divided:
        raise ValueError("--gpu: --workers and --scheduler judge on processors, so that all answers are one: leave "
                         "one of them out")  # fmt: skip
    if wanted or (wanted is None and not divided):
        gpu.use(where_there_is_one=wanted is None)


def _options(words: list[str] | None) -> dict[str, object]:
    options: dict[str, object] = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not equals or not name.strip():
            raise ValueError(f"--set {word}: write OPTION=VALUE, like step_size=4")
        options[name.strip().replace("-", "_")] = value.strip()
    return options


def _law(model: str, options: dict[str, object], axis: str) -> Any:
    from detent.moves.laws import law

    return law(model, options, axis)


def _check(
    outputs: list[Path],
    read: list[Path],
    maps: list[Path],
    from_: Path | None,
    into: Path | None,
    overwrite: bool,
    each: bool,
) -> None:
    from detent.cli.rig import text_of
    from detent.outputs import figures
    from detent.outputs.files import check_outputs

    if from_ is not None and into is None:
        raise ValueError("--from: where to? Name another file with --into")
    if each and (maps or into is not None):
        raise ValueError("--each-move gives several settings: --map and --into are for one")
    for path in maps:
        if path.suffix.lower() != ".csv":
            figures.check(path)
    check_outputs(outputs, read, asked=overwrite)
    if from_ is not None and not from_.is_file():
        raise ValueError(f"--from {from_}: there is no such file")
    if from_ is not None:
        text_of(from_)  # before the work and not behind it


@contextmanager
def _interruptible() -> "Iterator[Cancelled]":
    """Ctrl-C stops at the next judgement; a second one at once."""
    pressed: list[int] = []

    def press(number: int, frame: object) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(number)

    before = signal.signal(signal.SIGINT, press)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _watch() -> "Iterator[Watch]":
    from detent.cli.unit import progress
    from detent.hosts.exchange import Progress as Step

    with progress("tuning") as bar:

        def watch(step: Any) -> None:
            best = "" if step.best is None else f", lossless at {step.best:.4g} s"
            bar(Step(step.done, max(step.total, 1), f"{step.doing}{best}"))

        yield watch


def _map(tuned: "Tuned", paths: list[Path], cancelled: "Cancelled", divided: dict[str, Any]) -> bool:
    """Draw it; whether it was not stopped."""
    from detent.outputs import tuning_figures
    from detent.outputs.files import write_whole
    from detent.tuner.map import loss_map
    from detent.tuner.search import Stopped

    more = {"run": divided["run"], "together": 16 * divided["ahead"]} if divided else {}
    try:
        with _watch() as watch:
            found = loss_map(tuned.task, tuned.found.point, watch=watch, cancelled=cancelled, **more)
    except Stopped:
        return False
    for path in paths:
        if path.suffix.lower() == ".csv":
            write_whole(path, found.csv().encode())
            continue
        moves = ", ".join(str(move.steps) for move in tuned.task.moves)
        title = f"{tuned.task.model}: where {tuned.task.rig.motor.name} loses steps"
        about = f"moves of {moves} steps  \N{MIDDLE DOT}  {found.variants} variants a point  \N{MIDDLE DOT}  "
        tuning_figures.write_map(path, found.x, found.y, found.lost, found.times, found.chosen, names=found.names,
                                 labels=found.labels, title=title, about=about + str(tuned.found.profile))  # fmt: skip
    return True


def _changed(task: "Task", profile: "Profile | None", from_: Path | None) -> "Changed":
    """The text to write: a program, or that of a file with the settings in it. TunerError."""
    from detent.cli.rig import text_of
    from detent.tuner.into import Changed, program, put_into
    from detent.tuner.task import TunerError

    if profile is None:
        return Changed("", ())
    if from_ is None:
        return Changed(program(task, profile), ())
    try:
        return put_into(text_of(from_), profile, task.axis)
    except TunerError as error:
        raise TunerError(f"{from_}: {error}") from None


def _into(tuned: "Tuned", into: Path, from_: Path | None) -> None:
    from detent.outputs.files import write_whole

    changed = _changed(tuned.task, tuned.found.profile, from_)
    write_whole(into, changed.text.encode())
    if changed.replaced:
        print(f"{into}: {', '.join(changed.replaced)}", file=sys.stderr)


def _say_what_is_missing(answers: "list[Tuned]", moves: "Sequence[Move]", files: Sequence[Path]) -> None:
    """What a Ctrl-C has left out, in one line."""
    from detent.cli.endings import tell

    words = []
    behind = moves[len(answers) :] if len(answers[0].task.moves) < len(moves) else ()  # of --each-move
    if behind:
        words.append(f"nothing is known of moves of {', '.join(str(move.steps) for move in behind)} steps")
    if files:
        words.append(f"{', '.join(map(str, files))} not written")
    tell("; ".join(["stopped", *words]))


# -- what is printed ----------------------------------------------------------------------------------------


def _facts(tuned: "Tuned", made: Made) -> dict[str, Any]:
    from detent.motors import gpu
    from detent.tuner.report import facts

    return {**facts(tuned), "assumed": list(made.words), "gpu": gpu.used()}


def _print(answers: "list[Tuned]", made: Made) -> None:
    from detent.cli.motor import ranges_of
    from detent.motors import gpu

    drive, first = made.drive, answers[0]
    print(f"{first.task.model} with {made.motor.name}: {drive.supply:g} V, {drive.current:g} A, "
          f"{first.found.profile.winding.name} step, {drive.name or drive.decay}")  # fmt: skip
    for tuned in answers:
        print()
        _print_one(tuned)
    print(f"\nvariants: {ranges_of(first.task.ranges)}")
    print("assumed: " + "; ".join(made.words))
    if gpu.used():
        print("judged on the GPU where many variants were asked at once")
    sys.stdout.flush()


def _print_one(tuned: "Tuned") -> None:
    from detent.cli.motor import print_table, table_of
    from detent.tuner.report import fails_words, models_words, option_lines

    task, found, profile = tuned.task, tuned.found, tuned.found.profile
    if not found.whole:
        print("stopped: the best so far, which nothing has proved yet")
    for line in profile.settings:
        print(f"  {line}")
    for line in option_lines(profile):
        print(f"  option {line}")
    columns = ["move", "sent as", "found"]
    rivals = [("by hand", tuned.hand)] if tuned.hand is not None else []
    if tuned.safe_hand is not None and tuned.safe_hand != tuned.hand:
        rivals.append(("by hand, made safe", tuned.safe_hand))
    table = table_of(*columns, *(name for name, _ in rivals), "bound")
    shown = range(len(task.moves))
    for k in shown:
        move = task.moves[k]
        often = "" if move.weight == 1 else f" x{move.weight:g}"
        table.add_row(f"{move.steps}{often}", profile.go(move.steps), f"{found.times[k]:.4f} s",
                      *(f"{rival.times[k]:.4f} s" for _, rival in rivals), f"{tuned.bound.worst[k]:.4f} s")  # fmt: skip
    if len(task.moves) > 1 or task.moves[0].weight != 1:
        table.add_row("all", "", f"{found.time:.4f} s", *(f"{rival.time:.4f} s" for _, rival in rivals),
                      f"{tuned.bound_time:.4f} s")  # fmt: skip
    print()
    print_table(table)
    print()
    print(f"found:   {found.check}")
    if tuned.hand is not None:
        print(f"by hand: {tuned.hand.profile} by the manual's rule, {tuned.hand.lost} of {tuned.hand.tried} lost")
        if tuned.safe_hand is None:
            print("         no longer ramp makes it safe")
        elif tuned.safe_hand != tuned.hand:
            print(f"         made safe: {tuned.safe_hand.profile}")
    beside = f"found takes {tuned.ratio:.2f} times that"
    if tuned.ratio < 1:  # a bound is of rotors that never lag, and a step or two are made by lagging
        beside = "so short a move has had its last pulse before that, with the rotor still on its way"
    print(f"bound:   what torque allows at its worst corner, from and to standstill; {beside}")
    if task.both_ways:
        print("judged in both directions, as the load pulls")
    if tuned.fails:
        print(f"fails first, one at a time: {fails_words(tuned)}")
    if tuned.models:
        print(f"in other models, lost of {tuned.models[0].tried}: {models_words(tuned)}")
