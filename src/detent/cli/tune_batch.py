"""`detent tune MODEL --batch FILE`: a machine a row, over processes and machines if asked for."""

import csv
import json as json_text
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, get_args, get_type_hints

from detent.cli.rig import RigOptions

if TYPE_CHECKING:
    from detent.tuner.batch import Answer
    from detent.tuner.search import Progress, Watch
    from detent.tuner.task import Task

MOST_ROWS = 100_000
NAMED = ("motor", "moves")  # columns that are no options of the rig
FOUND = ("settings", "seconds", "lost", "of", "below", "problem")  # the first fields of an `Answer`, by other names
PARTS = 1000  # of a row, in the bar


def tune_batch(
    path: Path, model: str, motor: str | None, moves: str | None, rig: RigOptions, options: dict[str, object],
    axis: str, vary: list[str] | None, seed: int, variants: int, at_corners: bool,
    workers: int | None, scheduler: str | None, json: bool,
) -> None:  # fmt: skip
    """Tune each row, and print the table with what was found as it comes; with `json` a line of JSON each."""
    from detent.cli.endings import asked_wrongly
    from detent.cli.rig import made, spread_of, step_of
    from detent.moves.law import winding_of
    from detent.moves.laws import law
    from detent.tuner.task import Task, check_rig, moves_of

    try:
        rows = _rows(path)
        made_of = law(model, options, axis)
        tasks: list[Task] = []
        for number, row in enumerate(rows, 2):
            try:
                name, distances = row.get("motor") or motor, row.get("moves") or moves
                if name is None or distances is None:
                    raise ValueError("there must be a motor and moves, in a column or as --motor and --moves")
                given = _options(rig, row)
                found = made(name, given, winding_of(made_of, step_of(given, model)))
                tasks.append(Task(model, check_rig(found.rig, name), moves_of(distances), options, axis,
                                  spread_of(vary), seed, at_corners, final=variants))  # fmt: skip
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: {error}") from None
    except ValueError as error:
        asked_wrongly(error)
    out = sys.stdout
    with _bar(len(tasks)) as bar:
        # a terminal that shows the bar shows the rows above it
        table = _Table(sys.stdout if out.isatty() else out, list(rows[0]), json=json)
        for row, answer in zip(rows, _answers(tasks, workers, scheduler, bar), strict=True):
            table.add(row, answer)


class _Table:
    """What is printed: a CSV table, or a line of JSON for each row."""

    def __init__(self, out: TextIO, columns: list[str], *, json: bool) -> None:
        self._out, self._columns, self._json = out, columns, json
        self._write = csv.writer(out, lineterminator="\n")
        if not json:
            self._write.writerow([*columns, *FOUND, "options", "looks"])

    def add(self, row: dict[str, str], answer: "Answer") -> None:
        """What was found for a row."""
        if self._json:
            found = {**dict(zip(FOUND, answer, strict=False)), "options": dict(answer.options),
                     "commands": list(answer.commands), "looks": answer.looks}  # fmt: skip
            self._out.write(json_text.dumps({"given": row, **found}) + "\n")
        else:
            options = " ".join(f"{name}={value}" for name, value in answer.options.items())
            self._write.writerow([*(row[name] for name in self._columns), *answer[: len(FOUND)], options, answer.looks])
        self._out.flush()


@contextmanager
def _bar(rows: int) -> "Iterator[Watch]":
    """Told how far row `done` is (`best`: which part of it), it shows how far all are."""
    from detent.cli.unit import progress
    from detent.hosts.exchange import Progress as Step

    with progress("tuning") as bar:

        def watch(step: "Progress") -> None:
            bar(Step(int(PARTS * (step.done + (step.best or 0.0))), PARTS * rows, step.doing))

        yield watch


def _answers(tasks: "Sequence[Task]", workers: int | None, scheduler: str | None, watch: "Watch") -> "Iterator[Answer]":
    """What was found for each, in order, as it comes."""
    from detent.cli.endings import asked_wrongly, failed
    from detent.tuner.batch import answer, answers
    from detent.tuner.search import Progress

    total = len(tasks)
    if workers is None and scheduler is None:
        for number, task in enumerate(tasks):

            def inside(step: Progress, number: int = number) -> None:
                part = min(step.done / max(step.total, 1), 1.0)
                watch(Progress(number, total, part, f"row {number + 1} of {total}, {step.doing}"))

            yield answer(task, inside)
        return
    from detent.realtime.workers import Workers, WorkersLost

    with ExitStack() as stack:
        try:
            found = stack.enter_context(Workers(workers, scheduler))
            watch(Progress(0, total, None, f"{total} rows, {found.count()} workers"))
            for number, one in enumerate(found.map(answers, None, tasks, chunk=1)):  # each takes longer than a chunk
                watch(Progress(number + 1, total, None, f"{total} rows, {found.count()} workers"))
                yield one
        except ValueError as error:
            asked_wrongly(error)
        except WorkersLost as error:
            failed(error)


def _rows(path: Path) -> list[dict[str, str]]:
    from detent.realtime.texts import read_text

    try:
        table = list(csv.reader(read_text(path).splitlines(), skipinitialspace=True))
    except (OSError, csv.Error) as error:
        raise ValueError(f"{path}: cannot read it: {getattr(error, 'strerror', None) or error}") from None
    table = [row for row in table if any(cell.strip() for cell in row)]
    if len(table) < 2:
        raise ValueError(
            f"{path}: there must be a line of names, like motor,supply,inertia,moves, and a line a machine"
        )
    if len(table) > MOST_ROWS:
        raise ValueError(f"{path}: {len(table) - 1} rows are more than {MOST_ROWS}: divide it")
    from detent.controllers.catalogue import unknown

    names = [cell.strip().lower().replace("-", "_") for cell in table[0]]
    known = (*NAMED, *(field.name for field in fields(RigOptions)))
    for name in names:
        if name not in known:
            raise ValueError(f"{path}: {unknown('column', name, known)}")
    if len(set(names)) < len(names):
        raise ValueError(f"{path}: a column is there twice")
    for number, row in enumerate(table[1:], 2):
        if len(row) != len(names):
            raise ValueError(f"{path}, line {number}: {len(row)} cells under {len(names)} names")
    return [dict(zip(names, (cell.strip() for cell in row), strict=True)) for row in table[1:]]


def _options(rig: RigOptions, row: dict[str, str]) -> RigOptions:
    """The options of a row in place of those given; an empty cell leaves them."""
    hints = get_type_hints(RigOptions)
    changed: dict[str, Any] = {}
    for name, text in row.items():
        if name in NAMED or not text:
            continue
        kinds = get_args(hints[name]) or (hints[name],)
        try:
            if bool in kinds:
                changed[name] = text.lower() in ("1", "yes", "true")
            else:
                changed[name] = float(text) if float in kinds else Path(text) if Path in kinds else text
        except ValueError:
            raise ValueError(f"{name}: {text!r} is no number") from None
    return replace(rig, **changed)
