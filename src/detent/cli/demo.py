"""The verb `demo`: an example cell, run in virtual time, told and drawn."""

import json as json_text
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from detent.cli.overwrite import Overwrite

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cell.description import Description
    from detent.outputs.figures import Pin

TOLD = "drilling"  # the example whose story is told
LONGEST = 20  # seconds of the others: some of them run for ever


def demo(
    name: str = "drilling", *, output: Path = Path("detent-demo"), overwrite: Overwrite = False, json: bool = False
) -> None:
    """Run an example cell, tell what happens, and draw it.

    `detent examples` lists them.

    For example: `detent demo menu --output pictures`

    Parameters
    ----------
    name
        Which example.
    output
        The folder for the figure and the waveforms; made if it is not there.
    overwrite
        Write over files there that no run has made.
    json
        Print the timeline and the result as JSON.
    """
    from detent.cell.build import build
    from detent.cli import outcome
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.examples import place as example
    from detent.outputs.figures import check
    from detent.outputs.files import InTheWay, check_outputs
    from detent.realtime.cell_source import find_cell
    from detent.ticks import SECOND

    place = example(name) / "cell.toml"
    check(output / f"{name}.png")
    try:
        if output.is_dir():
            check_outputs([output / f"{name}.png", output / f"{name}.vcd"], asked=overwrite)
    except InTheWay as error:
        asked_wrongly(error)
    found = find_cell(str(place))
    cell = build(found.description, found.read)
    until = LONGEST * SECOND
    while (at := cell.next_event()) is not None and (name == TOLD or at <= until):
        cell.step()
    if name != TOLD:
        cell.run_to(max(cell.now, min(until, cell.now + SECOND // 10)))
    told = list(_story(cell, found.description, _comments(found.description, found.read))) if name == TOLD else []
    try:
        files = _draw(cell, found.description, output, name)
    except OSError as error:
        failed(f"{output}: cannot write there: {error.strerror}; choose another folder with --output")
    if json:
        story = [line._asdict() for line in told]
        facts = {**outcome.facts(outcome.quiet(cell)), "files": {kind: str(path) for kind, path in files.items()}}
        print(json_text.dumps({"demo": name, **facts, "timeline": story}))
        return
    if name == TOLD:
        _print_story(found.description, told)
    else:
        print(found.description.title)
    _print_end(cell, told, files, place)


class StoryLine(NamedTuple):
    """One line of the timeline. Without a unit it is the script's."""

    at_ns: int
    unit: str
    instruction: str
    comment: str
    took_ns: int


def _comments(description: "Description", read: Callable[[str], str]) -> dict[str, dict[int, str]]:
    """What the sources of the units' programs say of each instruction, by unit and address."""
    from detent.assembler import assemble
    from detent.controllers.catalogue import language

    comments: dict[str, dict[int, str]] = {}
    for name, unit in description.units.items():
        if unit.program is None:
            continue
        assembly = assemble(language(unit.model), read(unit.program), unit.program)
        mark = assembly.language.comment
        comments[name] = {
            placed.address: assembly.lines[placed.line - 1].partition(mark)[2].strip() for placed in assembly.placed
        }
    return comments


def _story(cell: "Cell", description: "Description", comments: Mapping[str, Mapping[int, str]]) -> Iterator[StoryLine]:
    """Who moved, who waited, who switched what, in order of time."""
    from detent.controllers.device import Executing
    from detent.ticks import MS

    lines = [
        StoryLine(entry.at, "", "", f"{switch} switch set to {level}", 0)
        for entry in description.script
        for switch, level in entry.set.items()
    ]
    assert cell.recording is not None
    for unit in comments:
        steps = [entry for entry in cell.recording.of(unit) if isinstance(entry, Executing)]
        ends = [*(step.at for step in steps[1:]), cell.now]
        for step, end in zip(steps, ends, strict=True):
            # Settings, loops, delays and cleared outputs happen, too; the story is of who moves, waits and calls.
            waits_or_moves = step.instruction[0] in "W+-G" and end - step.at > MS
            if waits_or_moves or step.instruction[0] == "A":
                comment = comments[unit].get(step.address, "")
                lines.append(StoryLine(step.at, unit, step.instruction, comment, end - step.at))
    return iter(sorted(lines, key=lambda line: line.at_ns))


def _draw(cell: "Cell", description: "Description", folder: Path, name: str) -> dict[str, Path]:
    from detent.outputs import figures, signals, vcd

    folder.mkdir(parents=True, exist_ok=True)
    files = {"figure": folder / f"{name}.png", "waveforms": folder / f"{name}.vcd"}
    seen = signals.of_cell(cell)
    vcd.write(files["waveforms"], seen)
    lanes: list[figures.Pin | figures.Strip] | None = None
    if name == TOLD:
        lanes = [*(lane for lane in figures.chosen_lanes(seen) if isinstance(lane, figures.Strip)), *_handshake()]
    figures.write(files["figure"], seen, title=description.title, lanes=lanes)
    return files


def _handshake() -> "list[Pin]":
    """The wires between the two modules, and the switches."""
    from detent.outputs.figures import Pin

    return [
        Pin("bar", "UI1", "start", "maintained switch on both UI1"),
        Pin("bar", "UI3", "stop", "0 ends the programs behind this bar"),
        Pin("bar", "UO2", "drill a hole", "bar.UO2 to drill.UI2"),
        Pin("drill", "UO2", "drill motor", "drill.UO2"),
        Pin("drill", "UO1", "hole is drilled", "drill.UO1 to bar.UI2"),
        Pin("bar", "UO1", "cutting blade", "bar.UO1"),
    ]


def _print_story(description: "Description", told: list[StoryLine]) -> None:
    from rich.console import Console
    from rich.table import Table

    from detent.ticks import SECOND

    console = Console(highlight=False)
    console.print(f"[bold]{description.title}[/bold]\n")
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("time s", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("command", no_wrap=True)
    table.add_column("what happens")
    table.add_column("takes s", justify="right", no_wrap=True)
    colours = dict(zip(description.units, ("blue", "red", "green", "magenta"), strict=False))
    for line in told:
        took = f"{line.took_ns / SECOND:.3f}" if line.unit and line.instruction[0] != "A" else ""
        style = colours.get(line.unit, "yellow")
        row = (line.unit or "panel", line.instruction, line.comment, took)
        table.add_row(f"{line.at_ns / SECOND:.3f}", *row, style=style)
    console.print(table)


def _print_end(cell: "Cell", told: list[StoryLine], files: Mapping[str, Path], place: Path) -> None:
    from detent.cli import outcome
    from detent.ticks import SECOND

    print()
    if told:
        holes = sum(line.unit == "drill" and line.instruction == "G0" for line in told)
        cut = next(line.at_ns for line in told if line.unit == "bar" and line.instruction == "A1")
        print(f"{holes} holes drilled, the bar cut off at {cut / SECOND:.3f} s.\n")
    outcome.show(outcome.quiet(cell), [])
    shown = place.relative_to(Path.cwd()) if place.is_relative_to(Path.cwd()) else place
    print()
    print(f"Look at   {files['figure']}   with any viewer of pictures: positions, speeds, handshake")
    print(f"     and  {files['waveforms']}   with gtkwave or PulseView: every pin, every pulse, to the nanosecond")
    print("Watch it run in a browser, or serve it to host programs, with a serial port for each unit:")
    print(f"    {_called()} workbench" + ("" if told else f" {shown}"))
    print(f"    {_called()} serve {shown}")


def _called() -> str:
    """How this command was called, to be typed again."""
    name = Path(sys.argv[0]).name
    if name != "detent":
        return "python -m detent"
    return name if shutil.which(name) == sys.argv[0] else sys.argv[0]
