"""A cell in production is put on by whole rounds, and nobody can tell: recordings, memories, deadlines, files, copies.

A cell that is asked for an instant at a time runs through everything. Beside it runs one that is asked for its end.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

import pytest
from tests.cell.test_idling import do, state, step_to, told
from tests.controllers.laws.histories import History, hold
from tests.generated import seeds

from detent.cell import cycles, history
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.later import Later
from detent.cell.panel import Panel
from detent.cell.rounds import Rounds
from detent.controllers.device import Executing
from detent.outputs import arrays, vcd
from detent.outputs.signals import of_cell
from detent.realtime.watch import Watch
from detent.ticks import MS, NEVER, SECOND, Ns

DRILLING: Final = Path(__file__).parents[2] / "examples" / "drilling"


def drilling(more: str = "") -> Cell:
    """Bar after bar, until somebody stops it."""
    text = (DRILLING / "bar-after-bar.toml").read_text() + more
    return build(parse(text, "cell"), lambda name: (DRILLING / name).read_text())


def rounds(cell: Cell) -> int:
    """How many rounds were passed over."""
    return sum(piece.rounds for piece in told(cell).pieces() if isinstance(piece, Rounds))


def batches(cell: Cell) -> list[tuple[int, tuple[object, ...]]]:
    """What is taken from its recording, in batches: whoever goes back in time counts them."""
    return [(unit, tuple(entries)) for unit, entries in told(cell.copy()).take()]


def within(cell: Cell) -> list[object]:
    """What a cell is made of."""
    circuit = cell.circuit
    return [circuit.parts, circuit.nets, circuit.lines, circuit.forced, circuit.stuck, circuit.failing_writes]


def check_alike(run: Cell, stepped: Cell) -> None:
    """In everything they are made of, and in all that was recorded."""
    assert state(run) == state(stepped)
    assert list(told(run)) == list(told(stepped))
    assert len(told(run)) == len(told(stepped))
    assert batches(run) == batches(stepped)
    assert run.circuit.deadlines == stepped.circuit.deadlines
    assert run.circuit.line_deadline == stepped.circuit.line_deadline
    if rounds(run):
        assert Later(0, run.now).alike(within(stepped), within(run))


# -- the drilling cell -----------------------------------------------------------------------------------------


def test_bar_after_bar_is_passed_over_and_its_recording_says_the_same() -> None:
    stepped, run = drilling(), drilling()
    for until in (100 * SECOND, 100 * SECOND + 1, 333 * SECOND + 123_456_789):
        step_to(stepped, until)
        run.run_to(until)
        check_alike(run, stepped)
    assert rounds(run) > 60


def test_a_shift_of_it_is_soon_over_and_takes_little_room() -> None:
    cell = drilling()
    cell.run_to(8 * 3600 * SECOND)
    made = sum(len(piece[1]) for piece in told(cell).pieces() if isinstance(piece, tuple))
    assert made < 20_000 < 2_000_000 < len(told(cell))
    young, bar = drilling(), 3_391_843_550
    bars = (cell.now - 10 * SECOND) // bar
    step_to(young, cell.now - bars * bar)
    position = young.controller("bar").status(young.now).position + bars * 980
    assert cell.controller("bar").status(cell.now).position == position


def test_the_counter_of_the_bar_ends_where_it_would() -> None:
    """The bar moves on in each round: in the tenth hour its counter is at its end, and the program with error 5."""
    bars = 10_000_000 // 980
    stepped, run = drilling(), drilling()
    for cell in (stepped, run):
        cell.run_to(0)
        for unit, by in (("bar", 980 * (bars - 60)),):
            cell.displace(unit, "", by)
    for until in (100 * SECOND, 400 * SECOND):
        step_to(stepped, until)
        run.run_to(until)
        check_alike(run, stepped)
    assert rounds(run) > 20
    assert run.controller("bar").registers(run.now)["F"] == "E5"


def test_what_the_script_does_ends_it_to_the_instant() -> None:
    for at in (170.0, 175.123456789, 176.9, 178.000000001):
        script = f"[[script]]\nat = {at}\nset = {{ stop = 0 }}\n"
        stepped, run = drilling(script), drilling(script)
        step_to(stepped, 200 * SECOND)
        run.run_to(200 * SECOND)
        check_alike(run, stepped)
        assert rounds(run) > 20


def test_what_the_script_does_is_part_of_no_round() -> None:
    """A hand that opens what it has shut leaves the cell as it was; it does so once, in whichever bar, and no more."""
    for bar in range(1, 8):
        script = ""
        for late, level in ((0.7, 0), (0.8, 1)):
            script += f"[[script]]\nat = {3.39184355 * bar + late:.9f}\nset = {{ stop = {level} }}\n"
        stepped, run = drilling(script), drilling(script)
        step_to(stepped, 70 * SECOND)
        run.run_to(70 * SECOND)
        check_alike(run, stepped)
        assert rounds(run) > 3


@pytest.mark.parametrize("outside", [False, True])
def test_a_time_in_which_something_came_from_outside_is_no_round(outside: bool) -> None:
    cell, bar = drilling(), 3_391_843_550
    search = cycles.Cycles(cell.circuit)
    search.passed(cycles.FIRST)
    met = []
    for number in range(3):
        step_to(cell, 10 * SECOND + number * bar)
        met.append(search.meet(0, 1000 * SECOND, NEVER - (outside and number == 2)))  # the script goes on
    search.close()
    assert met == [False, False, not outside]
    assert (rounds(cell) > 200) is not outside


def test_copies_that_part_within_a_round_go_on_as_they_would() -> None:
    cell = drilling()
    cell.run_to(200 * SECOND)
    twin = cell.copy()
    cell.run_to(400 * SECOND)
    for until in (301 * SECOND, 400 * SECOND):
        twin.run_to(until)
    assert list(told(twin)) == list(told(cell))
    twin.halt("drill")
    twin.run_to(500 * SECOND)
    assert not [entry for entry in told(twin).of("drill") if isinstance(entry, Executing) and entry.at > 400 * SECOND]
    cell.run_to(500 * SECOND)
    assert told(cell).of("drill")[-1].at > 495 * SECOND


def test_files_have_every_round(tmp_path: Path) -> None:
    stepped, run = drilling(), drilling()
    step_to(stepped, 60 * SECOND)
    run.run_to(60 * SECOND)
    assert rounds(run) > 3
    for name, cell in (("stepped", stepped), ("run", run)):
        vcd.write(tmp_path / f"{name}.vcd", of_cell(cell))
        arrays.write(tmp_path / f"{name}.npz", of_cell(cell))
    for kind in ("vcd", "npz"):
        assert (tmp_path / f"run.{kind}").read_bytes() == (tmp_path / f"stepped.{kind}").read_bytes()


def test_who_watches_sees_how_things_are() -> None:
    watches = []
    for go in (Cell.run_to, step_to):
        cell = drilling()
        cell.recording = watch = Watch(cell, passes_on=True)
        go(cell, 100 * SECOND + 77)
        fronts = [unit.front for unit in watch.of_unit]
        watches.append([(front.executing, front.levels, front.powered) for front in fronts])
        watches.append([front.travels[""].at(cell.now) for front in fronts])
        watches.append([(unit, entry) for unit, entries in watch.take() for entry in entries])
        panel = Panel(cell, {})
        panel.take([(unit, (entry,)) for unit, entry in watches[-1]])
        assert [front.levels for front in panel.fronts] == [front.levels for front in fronts]
    assert watches[:3] == watches[3:]


def test_going_back_counts_what_there_was() -> None:
    """The way back from a copy that was kept is run in one go, and has as many batches as it had at first."""
    past = history.History(drilling())
    past.run_to(150 * SECOND)
    del past._moments[1:]  # as if they were forgotten
    past.rewind(140 * SECOND)
    stepped = drilling()
    step_to(stepped, past.now)
    assert past.now > 139 * SECOND
    assert past._here.batches == len(batches(stepped))


def test_only_time_asked_for_in_one_go_is_passed_over() -> None:
    cell = drilling()
    for second in range(1, 200):
        cell.run_to(second * SECOND)
    assert rounds(cell) == 0


def test_a_cell_that_breaks_has_its_recording_in_its_place() -> None:
    cell = drilling()
    recording = cell.recording

    def breaks(_: Ns) -> Ns:
        if cell.now > 3 * SECOND:
            raise ArithmeticError
        return advance(_)

    advance = cell.parts[0].advance
    cell.parts[0].advance = breaks  # type: ignore[method-assign,assignment]
    with pytest.raises(ArithmeticError):
        cell.run_to(100 * SECOND)
    assert cell.recording is recording


# -- the law ---------------------------------------------------------------------------------------------------


class Plan(NamedTuple):
    """A cell in production as its file, with its programs, and what is done to it, each some time behind the last."""

    text: str
    programs: tuple[str, ...]
    units: tuple[str, ...]  # their models
    deeds: tuple[tuple[Ns, int, str, int], ...]  # when, to whom, what, and a number


def smc(draw: Random) -> str:
    """A program of a DCB-274 that goes on for ever."""
    before = draw.choice(("I 800", "W 2", "O 5", "T 200 128", "l 2", "l 4", "l 32", "w 3", "Y 10 20", "K 3 9", ""))
    away = draw.choice(("+ 40", "+ 700", "- 90", "R 300", "M 400\nW 30\nM 0", "F 900 1", "+ 3"))
    back = draw.choice(("- 40", "- 700", "+ 90", "R 0", "M -400\nW 30\nM 0", "O 0", ""))
    more = ("W 0", "W 1", "W 15", "A 8", "A 16", "A 0", "L a 1", "L 2048 1", "^", "J a 3", "W 30", "O 0", "H 2")
    inside = draw.choices(more, k=draw.randint(0, 3))
    lines = [before, "a:", away, draw.choice(("W 0", "W 10")), back, "W 0", *inside, "G a"]
    return "\n".join(lines) + "\n"


def gs(draw: Random, model: str) -> str:
    """A program of a GS-C200 or GS-C200S that goes on for ever."""
    swift = model == "gs-c200s"
    begin = draw.choice(("S10\nT100\nR40", "S20\nT20", "T400\nR7", "S30\nT90\nR200"))
    away = draw.choice(("+50", "+700", "+3\n+4", "G+90" if swift else "G90", "-60" if swift else "+60"))
    back = draw.choice(("-50", "-700", "G+0" if swift else "G0", "f+0" if swift else "-3", ""))
    more = ("D1", "D3", "A1", "C1", "A2", "C2", "W1", "W2", "L0", "L3", "L2", *["I2", "I3"] * swift)
    inside = draw.choices(more, k=draw.randint(1, 5))
    middle = [away, *inside, back]
    if swift:
        return "\n".join([begin, "a:", *middle, "j a"]) + "\n"
    return "\n".join([f"U{draw.choice((1, 2, 3))}", begin, *middle]) + "\n"


def pair(draw: Random) -> tuple[tuple[str, str], str]:
    """Programs of two modules that wait for each other, and their wires: one calls, the other does something."""
    begin = [draw.choice(("S10\nT100\nR40", "S20\nT20", "T400\nR7")) for _ in range(2)]
    out = draw.choice((("+120", ""), ("+50", "-50"), ("G70", "G0"), ("+3", "-1")))
    there, back = draw.choice((("+150", "G0"), ("+150", "-150"), ("+7", "")))
    hold, late = draw.choice(("D1", "D1\nD2")), draw.choice(("", "D3"))
    more = draw.choice(("", "L4"))
    caller = f"U3\n{begin[0]}\n{'L0' if more else ''}\nA2\nD1\nC2\nW2\n{out[0]}\n{more}\n{out[1]}\n{late}\n"
    called = f"U3\n{begin[1]}\nW2\n{there}\nD1\n{back}\nA1\n{hold}\nC1\n"
    wires = '[[wires]]\nfrom = "u0.UO2"\nto = "u1.UI2"\n[[wires]]\nfrom = "u1.UO1"\nto = "u0.UI2"\n'
    return (caller, called), wires


OUTS: Final = {
    "dcb-274": ("P5", "P4", "STEPS"), "gs-c200": ("UO1", "UO2", "MOV", "RAMP", "RDY", "CLOCK"),
    "gs-c200s": ("UO1", "UO2", "MOV", "DIR"),
}  # fmt: skip
INS: Final = {
    "dcb-274": ("P1", "P2", "HOME", "GO", "JOG1", "LIMIT-A", "STEP", "SS"),
    "gs-c200": ("UI1", "UI2", "UI3", "ENABLE"), "gs-c200s": ("UI1", "UI2", "UI3", "ENABLE"),
    "bs0610": ("X+", "LX+", "NXT"), "supersigma": ("T0",), "phase-reversal": ("CLOCK", "MOV"),
}  # fmt: skip
DEEDS: Final = ("pin", "pin", "say", "off and on", "start", "halt", "displace", "dip", "stuck", "copy", "store", "wait")


def plan(draw: Random) -> Plan:
    text, units, programs = "", [], []
    twins, wires = pair(draw) if draw.random() < 0.4 else ((), "")
    for n in range(2 if twins else draw.choice((1, 1, 1, 2, 3))):
        model = draw.choice(("dcb-274", "gs-c200", "gs-c200", "gs-c200s"))
        units.append("gs-c200" if twins else model)
        programs.append(twins[n] if twins else smc(draw) if model == "dcb-274" else gs(draw, model))
        model = units[n]
        straps = "PARTY = 1" if model == "dcb-274" and n % 2 else "" if model == "dcb-274" else "CHS = 0"
        text += f'[units.u{n}]\nmodel = "{model}"\nprogram = "{n}"\nstraps = {{ {straps} }}\n'
    others = draw.choices(("bs0610", "supersigma", "phase-reversal", "step-detector"), k=draw.choice((0, 0, 0, 1)))
    for model in others:
        text += f'[units.u{len(units)}]\nmodel = "{model}"\n'
        units.append(model)
    text += wires
    used = {(0, "UI2"), (1, "UI2")} if twins else set()
    for _ in range(draw.choice((0, 0, 1)) if twins else draw.randint(0, 3)):
        source, sink = draw.randrange(len(programs)), draw.randrange(len(units))
        pin = draw.choice(INS.get(units[sink], ("",)))
        if pin and (sink, pin) not in used:  # an input has one wire
            used.add((sink, pin))
            text += f'[[wires]]\nfrom = "u{source}.{draw.choice(OUTS[units[source]])}"\nto = "u{sink}.{pin}"\n'
    if draw.random() < 0.3:
        unit = draw.randrange(len(programs))
        pin = INS[units[unit]][draw.randrange(2)]
        if (unit, pin) not in used:
            ends = f"from = {draw.choice((-20, 10, 45))}\nto = {draw.choice((50, 900))}"
            text += f'[switches.s]\naxis = "u{unit}"\n{ends}\ndrives = ["u{unit}.{pin}"]\n'
    deeds = []
    for _ in range(draw.randint(1, 4)):
        gap = draw.choice((0, MS, SECOND, 15 * SECOND)) + draw.choice((0, draw.randrange(SECOND)))
        deeds.append((gap, draw.randrange(len(programs)), draw.choice(DEEDS), draw.randrange(1000)))
    return Plan(text, tuple(programs), tuple(units), tuple(deeds))


def made(planned: Plan, images: list[bytes], journal: object = ()) -> Cell | None:
    def store(unit: str, image: bytes) -> bool:
        images.append(image)
        return True

    try:
        return build(
            parse(planned.text, "cell"), lambda name: planned.programs[int(name)], store=store, journal=journal
        )  # type: ignore[arg-type]
    except ValueError:
        return None  # wires or a program that are none


def lived(planned: Plan, go: Callable[[Cell, Ns], None], images: list[bytes]) -> Cell | None:
    """The cell behind everything that was done to it."""
    cell = made(planned, images)
    if cell is None:
        return None
    go(cell, 12 * SECOND)
    for gap, place, what, number in planned.deeds:
        go(cell, cell.now + gap)
        unit, model = f"u{place}", planned.units[place]
        if what == "copy":
            cell = cell.copy()
        elif what == "off and on":
            cell.power(unit, False)
            go(cell, cell.now + number * MS)
            cell.power(unit, True)
            cell.start(unit)
        elif what == "store" and model != "dcb-274":
            cell.halt(unit)
            cell.type(unit, "M")
            go(cell, cell.now + 200 * MS)
            cell.start(unit)
        else:
            with suppress(ValueError, RuntimeError):  # it is stuck already, off already, moves
                do(cell, unit, model, what, number)
    go(cell, cell.now + 30 * SECOND + 1234)
    return cell


def nobody_can_tell(_: History, planned: Plan) -> bool:
    one_by_one: list[bytes] = []
    at_once: list[bytes] = []
    try:
        stepped = lived(planned, step_to, one_by_one)
    except RuntimeError:
        return False  # it swings
    run = lived(planned, Cell.run_to, at_once)
    if stepped is None or run is None:
        return False
    check_alike(run, stepped)
    assert one_by_one == at_once
    if rounds(run) == 0:
        return False
    again = made(planned, [], tuple(run.journal))
    assert again is not None
    again.run_to(run.now)
    assert list(told(again)) == list(told(stepped)), "the journal makes another recording"
    if run.now < 50 * SECOND:
        assert b"".join(vcd.pieces(of_cell(run))) == b"".join(vcd.pieces(of_cell(stepped)))
    return True


def check(count: int) -> int:
    def make(draw: Random) -> tuple[History, Plan]:
        return History({}, (), ()), plan(draw)

    return hold(nobody_can_tell, make, count, "cells in production")


def test_nobody_can_tell() -> None:
    assert check(len(seeds(48))) > 0


@pytest.mark.slow
def test_nobody_can_tell_in_many_more_cells() -> None:
    assert check(1_000) > 200


# -- who looks at it -------------------------------------------------------------------------------------------


def test_nothing_is_looked_for_in_a_cell_with_a_part_that_does_not_say_what_it_remembers() -> None:
    cell = build(parse('[units.u]\nmodel = "bs0610"\n', "cell"), lambda name: "")
    assert cycles.Cycles(cell.circuit).longest == NEVER
