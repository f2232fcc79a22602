"""Programs that turn in loops are passed over, and nobody can tell: recordings, journals, memories, copies, deadlines.

A cell that is asked for an instant at a time runs through every turn. Beside it runs one that is asked for its end.
"""

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from random import Random
from typing import Final, NamedTuple

import pytest
from tests.controllers.laws.histories import History, hold
from tests.generated import seeds

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.faults import StuckPin, SupplyDip
from detent.cell.recording import Recording
from detent.cell.turns import Turn, Turns
from detent.controllers.device import Executing
from detent.outputs.curves import instructions
from detent.outputs.signals import of_cell
from detent.pins import HIGH, LOW, PinSet
from detent.realtime.watch import Watch
from detent.ticks import MS, NEVER, SECOND, Ns

YEAR: Final[Ns] = 31_557_600 * SECOND

LOOPS: Final = {
    "an L that polls": ("dcb-274", "L 0 0\n"),
    "a poll, then a jump": ("dcb-274", "a: L a 1\nG a\n"),
    "a G to itself": ("dcb-274", "G 0 0\n"),
    "waits": ("dcb-274", "a: W 3\nW 0\nG a\n"),
    "rounds of a J": ("dcb-274", "a: W 1\nJ a 12\nG a\n"),
    "outputs": ("dcb-274", "a: A 8\nW 7\nA 16\nW 13\nG a\n"),
    "questions in party line": ("dcb-274", "a: Z 0\n] 0\n+ 0\nG a\n"),
    "nothing but jumps": ("gs-c200s", "a: j a\n"),
    "inputs": ("gs-c200s", "a: jc0,b\nj a\nb: D5\nj a\n"),
    "delays and outputs": ("gs-c200s", "a: A1\nD2\nC1\nD1\nj a\n"),
    "loops in a loop": ("gs-c200s", "a: L0\nL0\nD1\nL3\nL2\nj a\n"),
    "a reset of the driver": ("gs-c200s", "a: I1\nD1\nj a\n"),
    "a goto to where it is": ("gs-c200s", "a: G+0\nj a\n"),
    "a guard": ("gs-c200", "U1\nD1\nS20\nA2\nC2\n"),
}  # fmt: skip

BUSY: Final = {
    "to and fro": ("gs-c200s", "T400\na: +5\n-5\nj a\n"),
    "onward": ("dcb-274", "a: + 3\nW 0\nG a\n"),
    "onward without a wait": ("dcb-274", "M 200\na: W 1\nG a\n"),
    "a program that ends": ("gs-c200", "L0\nD1\nL100\n"),
}  # fmt: skip


def one(model: str, program: str, more: str = "") -> Cell:
    return many([(model, program)], more)


def many(units: list[tuple[str, str]], more: str = "") -> Cell:
    text = ""
    for n, (model, _) in enumerate(units):
        straps = "PARTY = 1" if model == "dcb-274" else "CHS = 0"
        text += f'[units.u{n}]\nmodel = "{model}"\nprogram = "{n}"\nstraps = {{ {straps} }}\n'
    return build(parse(text + more, "cell"), lambda name: units[int(name)][1])


def told(cell: Cell) -> Recording:
    assert cell.recording is not None
    return cell.recording


def passed_over(cell: Cell) -> int:
    """Entries that nobody has made one by one."""
    return sum(piece.count for piece in told(cell).pieces() if isinstance(piece, Turns))


def step_to(cell: Cell, until: Ns) -> None:
    """Every instant by itself."""
    while (at := cell.next_event()) is not None and at <= until:
        assert cell.step() == at
    cell.run_to(until)


def state(cell: Cell) -> list[object]:
    found: list[object] = [cell.now, cell.next_event(), list(cell.journal)]
    for unit in cell.controllers().values():
        axes = [unit.status(cell.now, axis) for axis in unit.axes]
        found += [*axes, unit.registers(cell.now), unit.program_memory(), unit.kept_memory(), unit.next_deadline()]
    return found


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_is_passed_over_and_its_recording_says_the_same(name: str) -> None:
    stepped, run = one(*LOOPS[name]), one(*LOOPS[name])
    for until in (9 * SECOND, 9 * SECOND + 1, 40 * SECOND + 123_456_789):
        step_to(stepped, until)
        run.run_to(until)
        assert state(run) == state(stepped)
    assert list(told(run)) == list(told(stepped))
    assert len(told(run)) == len(told(stepped))
    assert passed_over(run) > 0


@pytest.mark.parametrize("name", LOOPS)
def test_a_year_of_a_loop_is_soon_over(name: str) -> None:
    cell = one(*LOOPS[name])
    cell.run_to(YEAR)
    made = sum(1 if isinstance(piece, Turns) else len(piece[1]) for piece in told(cell).pieces())
    assert made < 20_000 < 10_000_000 < len(told(cell))
    following = cell.next_event()
    assert following is not None
    assert YEAR < following < YEAR + 2 * SECOND


@pytest.mark.parametrize(
    ("model", "program", "options"),
    [
        ("gs-c200s", "a: I1\nj a\n", 'instruction_time = "150 us"'),  # RESET is pulsed anew before it has risen
        ("gs-c200s", "a: I1\nj a\n", 'instruction_time = "399 us"'),
        ("gs-c200s", "a: A1\nC1\nj a\n", 'instruction_time = "1 us"'),
        ("dcb-274", "L 0 0\n", 'execution_times = "off"'),
        ("dcb-274", "a: W 0\nA 8\nA 0\nG a\n", 'execution_times = "off"'),
    ],
)
def test_loops_of_units_that_are_quicker(model: str, program: str, options: str) -> None:
    stepped, run = (one(model, program, f"options = {{ {options} }}\n") for _ in range(2))
    step_to(stepped, 60 * MS + 7)
    run.run_to(60 * MS + 7)
    assert list(told(run)) == list(told(stepped))
    assert state(run) == state(stepped)
    assert passed_over(run) > 0
    run.run_to(YEAR)


@pytest.mark.parametrize("name", BUSY)
def test_what_moves_or_ends_is_run_through(name: str) -> None:
    cell = one(*BUSY[name])
    cell.run_to(9 * SECOND)
    stepped = one(*BUSY[name])
    step_to(stepped, 9 * SECOND)
    assert passed_over(cell) == 0 or name == "a program that ends"
    assert list(told(cell)) == list(told(stepped))
    assert state(cell) == state(stepped)


def test_what_leads_to_another_unit_is_run_through() -> None:
    wire = '[[wires]]\nfrom = "u0.UO1"\nto = "u1.UI1"\n'
    units = [LOOPS["delays and outputs"], LOOPS["inputs"]]
    cell, stepped = many(units, wire), many(units, wire)
    cell.run_to(9 * SECOND)
    step_to(stepped, 9 * SECOND)
    assert list(told(cell)) == list(told(stepped))
    apart = many(units)
    apart.run_to(9 * SECOND)
    assert passed_over(apart) > 1000


def test_units_that_turn_by_themselves_are_told_in_order_of_time() -> None:
    units = [LOOPS[name] for name in LOOPS if name not in ("rounds of a J", "loops in a loop")]
    cell, stepped = many(units), many(units)
    cell.run_to(5 * SECOND)
    step_to(stepped, 5 * SECOND)
    assert passed_over(cell) > 5000
    assert list(told(cell)) == list(told(stepped))
    assert state(cell) == state(stepped)


def test_a_cell_without_a_recording_is_passed_over_as_well() -> None:
    text = '[units.u]\nmodel = "gs-c200s"\nprogram = "p"\n'
    cells = [build(parse(text, "cell"), lambda name: "a: j a\n", record=False) for _ in range(2)]
    cells[0].run_to(5 * SECOND)
    step_to(cells[1], 5 * SECOND)
    assert state(cells[0]) == state(cells[1])
    cells[0].run_to(1000 * YEAR)


def test_copies_that_part_within_a_loop_go_on_as_they_would() -> None:
    cell = one(*LOOPS["delays and outputs"])
    cell.run_to(100 * SECOND)
    twin = cell.copy()
    cell.run_to(200 * SECOND)
    twin.run_to(200 * SECOND)
    assert list(told(twin)) == list(told(cell))
    twin.halt("u0")
    twin.run_to(YEAR)
    assert list(told(twin).of("u0"))[-1].at == 200 * SECOND
    cell.run_to(201 * SECOND)
    assert told(cell).of("u0")[-1].at > 200 * SECOND


@pytest.mark.parametrize("name", ["inputs", "delays and outputs", "outputs"])
def test_taken_batches_have_every_turn(name: str) -> None:
    stepped, run = one(*LOOPS[name]), one(*LOOPS[name])
    step_to(stepped, SECOND)
    run.run_to(SECOND)
    taken = [(unit, tuple(entries)) for unit, entries in told(run).take()]
    assert taken == [(unit, tuple(entries)) for unit, entries in told(stepped).take()]
    assert len(told(run)) == 0


def test_turns_are_counted_and_their_last_is_found() -> None:
    blink = Turn(1, 5, 10, (PinSet(5, "UO1", HIGH), Executing(5, 0, "A1"), PinSet(8, "UO1", LOW)))
    poll = Turn(0, 4, 3, (Executing(4, 0, "j0"),))
    turns = Turns([blink, poll], 26)
    everything = list(turns)
    assert len(everything) == turns.count == 8 + 8
    assert [entry.at for _, entry in everything] == sorted(entry.at for _, entry in everything)
    assert [unit for unit, entry in everything if entry.at == 25] == [1, 1, 0]
    assert [entry.at for entry in turns.of(0)] == [4, 7, 10, 13, 16, 19, 22, 25]
    assert list(turns.last())[-1] == (0, Executing(25, 0, "j0"))
    levels = [entry.level for unit, entry in turns.last() if isinstance(entry, PinSet)]
    assert levels[-1] == HIGH  # it is set at 25
    assert turns.kinds == {PinSet, Executing}


# -- the law -------------------------------------------------------------------------------------------------


class Plan(NamedTuple):
    """Programs of units, wires, and what is done to them, each some time behind the one before."""

    units: tuple[tuple[str, str], ...]
    wires: tuple[tuple[int, int], ...]
    acts: tuple[tuple[Ns, int, str, int], ...]  # when, to whom, what, and a number


def smc(draw: Random) -> str:
    """A program of a DCB-274: an endless loop, behind something or nothing."""
    before = draw.choice(("I 800", "W 2", "+ 3", "O 5", "T 2 128", "l 8", "Y 10 20", ""))
    moves = ("- 2", "M 300", "M 0") if draw.random() < 0.2 else ()
    inside = (
        "W 0", "W 1", "W 7", "A 8", "A 16", "A 0", "L a 0", "L a 1", "L a 2", "L 2048 0", "+ 0", "^", "Z 0", "] 1",
        "J a 3", "J a 40", "O 0", "O 7", "K 5 5", *moves,
    )  # fmt: skip
    end = draw.choice(("G a", "G a", "G a 1", "L a 0\nG a"))
    return "\n".join([before, "a:", *draw.choices(inside, k=draw.randint(0, 4)), end]) + "\n"


def gs(draw: Random, model: str) -> str:
    """A program of a GS-C200 or GS-C200S: the same."""
    swift = model == "gs-c200s"
    own = ("j a", "jc7,a", "jc3,a", "G+0", "f+0", "f+5", "I1", "I2", "I3") if swift else ("G0",)
    moves = ("+2", "-2") if draw.random() < 0.2 else ()
    before = draw.choice(("S20", "+3", "D2", "A1", "")) if swift else f"U{draw.choice((1, 1, 2, 3))}"
    inside = (
        "D1", "D3", "A1", "C1", "A2", "C2", "W1", "W2", "S20", "T100", "R10", "L0", "L3", "L9", *own, *moves,
    )  # fmt: skip
    return "\n".join([before, "a:", *draw.choices(inside, k=draw.randint(0, 5)), *["j a"] * swift]) + "\n"


PINS: Final = {
    "dcb-274": ("P1", "P2", "SS", "GO", "JOG1", "LIMIT-A", "STEP"),
    "gs-c200": ("UI1", "UI2", "UI3", "ENABLE", "EOT"),
    "gs-c200s": ("UI1", "UI2", "UI3", "ENABLE"),
}
SAID: Final = {
    "dcb-274": ("@", "|", "Z", "+ 5", "A 8", "G 0", "S"),
    "gs-c200": ("F", "K", "Z", "V2", "E", "M", "+3"),
    "gs-c200s": ("F", "K", "Z", "V1", "E", "I2", "M", "+3"),
}
ACTS: Final = ("pin", "pin", "pin", "say", "say", "off and on", "start", "halt", "displace", "dip", "stuck", "copy")


def plan(draw: Random) -> Plan:
    units = []
    for _ in range(draw.choice((1, 1, 2, 3))):
        model = draw.choice(("dcb-274", "gs-c200", "gs-c200s"))
        units.append((model, smc(draw) if model == "dcb-274" else gs(draw, model)))
    wires = [(draw.randrange(len(units)), draw.randrange(len(units)))] if draw.random() < 0.25 else []
    acts = []
    for _ in range(draw.randint(1, 6)):
        gap = draw.choice((0, 1, 1 * MS, 20 * MS, 300 * MS, SECOND)) + draw.choice((0, draw.randrange(MS)))
        acts.append((gap, draw.randrange(len(units)), draw.choice(ACTS), draw.randrange(1000)))
    return Plan(tuple(units), tuple(wires), tuple(acts))


def made(planned: Plan, images: list[bytes], journal: object = ()) -> Cell | None:
    text = ""
    for n, (model, _) in enumerate(planned.units):
        straps = "PARTY = 1" if model == "dcb-274" and n % 2 else "" if model == "dcb-274" else "CHS = 0"
        text += f'[units.u{n}]\nmodel = "{model}"\nprogram = "{n}"\nstraps = {{ {straps} }}\n'
    for source, sink in planned.wires:
        out = "P5" if planned.units[source][0] == "dcb-274" else "UO1"
        text += f'[[wires]]\nfrom = "u{source}.{out}"\nto = "u{sink}.{PINS[planned.units[sink][0]][1]}"\n'

    def store(unit: str, image: bytes) -> bool:
        images.append(image)
        return True

    try:
        return build(parse(text, "cell"), lambda name: planned.units[int(name)][1], store=store, journal=journal)  # type: ignore[arg-type]
    except ValueError:
        return None  # a program that is none


def do(cell: Cell, unit: str, model: str, what: str, number: int) -> None:
    match what:
        case "pin":
            pins = PINS[model]
            cell.set_pin(unit, pins[number % len(pins)], number // 10 % 2)
        case "say":
            cell.type(unit, SAID[model][number % len(SAID[model])])
        case "start":
            cell.start(unit)
        case "halt":
            cell.halt(unit)
        case "displace":
            cell.displace(unit, "", number - 500)
        case "dip":
            cell.breaks(SupplyDip(unit), 3 * MS)
        case "stuck":
            cell.breaks(StuckPin(unit, PINS[model][0], LOW), 40 * MS)


def lived(planned: Plan, go: Callable[[Cell, Ns], None], images: list[bytes]) -> Cell | None:
    """The cell behind everything that was done to it."""
    cell = made(planned, images)
    if cell is None:
        return None
    for gap, place, what, number in planned.acts:
        go(cell, cell.now + gap)
        if what == "copy":
            cell = cell.copy()
        elif what == "off and on":
            cell.power(f"u{place}", False)
            go(cell, cell.now + number * MS)
            cell.power(f"u{place}", True)
            cell.start(f"u{place}")
        else:
            with suppress(ValueError, RuntimeError):  # it is stuck already, off already, moves
                do(cell, f"u{place}", planned.units[place][0], what, number)
    go(cell, cell.now + SECOND + 1234)
    return cell


def nobody_can_tell(_: History, planned: Plan) -> bool:
    one_by_one: list[bytes] = []
    at_once: list[bytes] = []
    stepped, run = lived(planned, step_to, one_by_one), lived(planned, Cell.run_to, at_once)
    if stepped is None or run is None:
        return False
    everything = list(told(stepped))
    assert list(told(run)) == everything
    assert state(run) == state(stepped)
    assert one_by_one == at_once
    again = made(planned, [], tuple(run.journal))
    assert again is not None
    again.run_to(run.now)
    assert list(told(again)) == everything, "the journal makes another recording"
    assert run.next_event() is None or run.now < (run.next_event() or 0) < NEVER
    return passed_over(run) > 0


def check(count: int) -> int:
    def make(draw: Random) -> tuple[History, Plan]:
        return History({}, (), ()), plan(draw)

    return hold(nobody_can_tell, make, count, "cells with programs that turn")


def test_nobody_can_tell() -> None:
    assert check(len(seeds(48))) > 2


@pytest.mark.slow
def test_nobody_can_tell_in_many_more_cells() -> None:
    assert check(2_000) > 500


# -- who looks at it -----------------------------------------------------------------------------------------


def test_a_watch_shows_where_programs_in_loops_are() -> None:
    units = [LOOPS[name] for name in ("delays and outputs", "an L that polls", "outputs")]
    watches = []
    for go in (Cell.run_to, step_to):
        cell = many(units)
        cell.recording = watch = Watch(cell)
        go(cell, 30 * SECOND + 77)
        watches.append([(unit.front.executing, unit.front.levels, unit.sent, unit.received) for unit in watch.of_unit])
        passing = many(units)
        passing.recording = Watch(passing, passes_on=True)
        go(passing, 5 * SECOND)
        watches.append(passing.recording.take())
    assert watches[0] == watches[2]
    assert [(u, e) for u, entries in watches[1] for e in entries] == [(u, e) for u, es in watches[3] for e in es]


def test_signals_of_a_year_have_what_changed_and_no_more_than_can_be_held() -> None:
    poll = one(*LOOPS["an L that polls"])
    poll.run_to(1000 * SECOND)
    poll.set_pin("u0", "P1", LOW)
    poll.run_to(YEAR)
    wave = of_cell(poll).unit("u0").wave("P1")
    assert wave.times.tolist() == [1000 * SECOND]
    blink = one(*LOOPS["outputs"])
    blink.run_to(YEAR)
    with pytest.raises(ValueError, match="run for less"):
        of_cell(blink)


def test_a_figure_draws_a_year_of_instructions_as_one_band() -> None:
    cell = one(*LOOPS["an L that polls"])
    cell.run_to(YEAR)
    bands = instructions(of_cell(cell), "u0")
    assert [band.label for band in bands].count("") == 1
    assert max(band.end - band.begin for band in bands) > YEAR - SECOND
    assert all(one.end <= other.begin for one, other in pairwise(bands))
    for go in (Cell.run_to, step_to):
        cell = one(*LOOPS["an L that polls"])
        go(cell, 20 * SECOND)
        executed = [entry for entry in told(cell).of("u0") if isinstance(entry, Executing)]
        assert len(instructions(of_cell(cell), "u0")) == len(executed)
