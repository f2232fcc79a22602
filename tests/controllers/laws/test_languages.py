"""What a language prints it takes back: the same program at the same addresses, or a refusal.

Sources are made by number. They go through every way out of the product and back in: asm in each of its formats, list,
disasm, upload and download, backup and restore, and the EEPROM file that serve keeps.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

import pytest
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, hold
from tests.controllers.laws.models import OPEN

from detent.assembler import Assembly, AssemblyFailed, assemble, disassemble, listing
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.cli import assemble as verbs
from detent.controllers import catalogue
from detent.hosts.backups import Backup
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.gsc200 import BlockingGsC200, GsC200
from detent.realtime.images import pack
from detent.workbench.units import programs

Line = Callable[[Random], str]


def gsc(draw: Random, sign: str) -> str:
    """A line that both modules store."""
    steps = draw.choice((1, 40, 999_999, draw.randint(1, 999_999)))
    n, pin = draw.randint(1, 999), draw.randint(1, 3)
    return draw.choice((f"A{pin}", f"C{pin}", f"U{pin}", f"W{pin}", f"D{min(n, 255)}", "L0", f"L{min(n, 255)}", f"R{n}",
                        f"S{n + 1}", f"T{n + 1}", f"{sign}{steps}", f"{sign}{steps}"))  # fmt: skip


def c200(draw: Random) -> str:
    own = (f"G{draw.randint(0, 9_999_999)}", "G0", "G+", "G-2", "G+3")
    return draw.choice(own) if draw.random() < 0.3 else gsc(draw, draw.choice("+-"))


def c200s(draw: Random) -> str:
    place = draw.randint(-8_388_608, 8_388_607)
    own = (f"G{place:+d}", f"f{place:+d}", "g+", "g-2", "g+1", "I1", "I3", "j first", "jc7,first", "jc0,last", "j last")
    return draw.choice(own) if draw.random() < 0.5 else gsc(draw, draw.choice("+-"))


def smc(draw: Random) -> str:
    """A line that program mode of a DCB-274 stores."""
    place = draw.choice((0, 1, -1, 500, 8_388_607, -8_388_607, draw.randint(-8_388_607, 8_388_607)))
    rate = draw.choice((40, 41, 800, 899, 900, 10_000, 36_000, draw.randint(40, 36_000)))
    byte = draw.randint(0, 255)
    return draw.choice((
        f"+ {abs(place)}", f"- {abs(place) * 2}", f"R {place}", f"O {place}", "O", f"I {rate}", f"V {rate}",
        f"M {rate}", f"M -{rate}", "M 0", f"F {rate} {byte % 2}", f"K {byte} {draw.randint(0, 255)}", f"B {byte} 9",
        f"W {draw.randint(0, 65_535)}", f"w {byte}", f"A {draw.choice((0, 8, 16, 24, 129))}", f"D {max(byte, 1)}",
        f"H {byte % 6}", f"b {byte}", f"l {draw.choice((0, 1, 8, 9, 32))}", "Z", "Z 1", "^", "@", "] 0", "] 1", "E 3",
        f"Y {byte % 101} 80", f"k {place} {byte % 64}", f"i {place} {byte % 64}", "T 900 first", "T 5 0", "| A", "|B",
        f"J first {byte}", "J last 3", f"L 2048 {byte % 10}", f"L first {byte % 10}",
        "G first", "G last 1", "G 2048", "G 0 1",
    ))  # fmt: skip


def source(draw: Random, model: str) -> str:
    """A program with labels; that of a DCB-274 in one to three places."""
    line: Line = {"gs-c200": c200, "gs-c200s": c200s, "dcb-274": smc}[model]
    lines = []
    places = draw.sample((0, 7, 128, 160, 256, 300, 1600, 2000), draw.randint(1, 3)) if model == "dcb-274" else [0]
    room = {0: 6, 7: 20, 128: 5, 160: 5, 256: 8, 300: 30, 1600: 30, 2000: 8}
    first = draw.randrange(len(places))
    for n, place in enumerate(places):
        if model == "dcb-274" and (place or n or draw.random() < 0.5):
            lines.append(f"P {place}")
        count = draw.randint(1, room[place] if model == "dcb-274" else 12)
        count = min(count, 1) if place == 0 and model == "dcb-274" else count  # another may stand at 7
        lines += ["first:"] * (n == first)
        lines += [line(draw) for _ in range(count)]
        if n == len(places) - 1:
            lines += ["last:", line(draw)]
        if model == "dcb-274" and draw.random() < 0.7:
            lines.append("P")
    return "\n".join(text + draw.choice(("", "", "  ; a comment")) for text in lines) + "\n"


def places(assembly: Assembly[Any]) -> Mapping[int, str]:
    """The program: each instruction by its address."""
    return {placed.address: placed.text for placed in assembly.placed}


def taken(model: str, text: str) -> Assembly[Any] | None:
    """What the assembler makes of a source; None if it refuses it."""
    try:
        return assemble(catalogue.language(model), text)
    except AssemblyFailed:
        return None


def what_is_printed_is_taken_back(model: str, text: str) -> bool:
    language, made = catalogue.language(model), taken(model, text)
    if made is None:
        return False
    program = places(made)
    typed = taken(model, verbs._formatted(made, "commands").decode())
    assert typed is not None, "what asm prints is refused"
    assert places(typed) == program, "asm --format commands is another program"
    image = verbs._formatted(made, "image")
    again = taken(model, disassemble(language, image))
    assert again is not None, "what disasm prints is refused"
    assert places(again) == program, "asm and disasm make another program"
    assert bytes.fromhex(verbs._formatted(made, "hex").decode()) == image
    shown = taken(model, listing(made))
    assert shown is None or places(shown) == program, "list is taken for another program"
    return True


def file_of_the_eeprom_is_taken(model: str, text: str, folder: Path) -> bool:
    made = taken(model, text)
    if made is None:
        return False
    cell = build(parse(f'[units.u]\nmodel = "{model}"', "cell"), str)
    unit = cell.controller("u")
    unit.restore(verbs._formatted(made, "image"))
    file = folder / "u.eeprom"
    file.write_bytes(pack(unit.kept_memory(), model))
    with redirect_stdout(StringIO()) as printed:
        try:
            verbs.disasm(model, file)
        except SystemExit as refused:
            raise AssertionError("disasm refuses the EEPROM file") from refused
    again = taken(model, printed.getvalue())
    assert again is not None, "what disasm makes of the EEPROM file is refused"
    found, program = places(again), places(made)
    told = told_as_left_over(printed.getvalue())
    unsure = {at for at in set(program) - set(found) if told_with(at, made, told)}
    kept = {at: text for at, text in program.items() if at not in unsure}
    assert {at: found.get(at) for at in kept} == kept, "disasm makes another program of the EEPROM file"
    return True


def told_as_left_over(printed: str) -> dict[int, bytes]:
    """What disasm tells in comments as left of an older program: each byte by its address."""
    told: dict[int, bytes] = {}
    for at, data in re.findall(r"; left of an older program at (\d+), behind an end mark: ([0-9A-F ]+)", printed):
        told |= {int(at) + n: bytes([byte]) for n, byte in enumerate(bytes.fromhex(data))}
    return told


def told_with(at: int, made: Assembly[Any], told: Mapping[int, bytes]) -> bool:
    """Whether the instruction at `at` is of a program right behind the end mark of another, and told byte for byte.

    Nothing in the memory of a DCB-274 tells such a program from the rest of an older, longer one (page 47). So it may
    come back as a comment; it may not come back as another program, nor be passed over.
    """
    ends = {placed.address + len(placed.code) for placed in made.placed}
    start, code = at, next(placed.code for placed in made.placed if placed.address == at)
    while start in ends:
        start = next(placed.address for placed in made.placed if placed.address + len(placed.code) == start)
    held = b"".join(told.get(at + n, b"\xff") for n in range(len(code)))  # an FFh is not told
    return start - 1 in ends and held == code


def module(model: str) -> tuple[Cell, Any]:
    """A unit that has just left the factory, and its driver."""
    cell = build(parse(f'[units.u]\nmodel = "{model}"', "cell"), str, line_timing=False)
    port = HostPort(cell)
    if model == "dcb-274":
        return cell, BlockingDcb274(Dcb274(), port)
    return cell, BlockingGsC200(GsC200(model), port)


def units_keep_programs(model: str, texts: Sequence[str]) -> bool:
    """Upload and download, each program over the ones before it; then backup and restore of what has become of all."""
    cell, driver = module(model)
    told = [unit_keeps_program(model, cell, driver, text) for text in texts]
    if not any(told):
        return False
    driver.save()
    saved = Backup.parse(Backup(model, driver.saved()).text())
    other, second = module(model)
    second.restore(saved.saved)
    here, there = (one.controller("u").kept_memory() for one in (cell, other))
    assert here == there, "restore makes another memory than the one that was saved"
    return True


def unit_keeps_program(model: str, cell: Cell, driver: Any, text: str) -> bool:
    made = taken(model, text)
    if made is None:
        return False
    program, language = places(made), catalogue.language(model)
    driver.write_program(programs.lines_of(made))
    memory = cell.controller("u").program_memory()
    for placed in made.placed:
        assert memory[placed.address : placed.address + len(placed.code)] == placed.code, f"{placed.text} is elsewhere"
    starts = sorted({at for at in program if not any(p.address + len(p.code) == at for p in made.placed)})
    for start in starts if model == "dcb-274" else [0]:
        lines = driver.read_program(start) if model == "dcb-274" else driver.read_program()
        again = taken(model, programs.source_of(language, lines))
        assert again is not None, "what download prints is refused"
        for address, found in places(again).items():
            assert program.get(address, found) == found, f"download has {found} at {address}"
        assert start in places(again), f"download has moved the program of {start}"
    return True


def what_is_left_over_is_no_program(start: int, long: list[str], short: list[str]) -> bool:
    """A DCB-274 keeps the rest of a longer program behind the end mark of a shorter one (page 47)."""
    cell, driver = module("dcb-274")
    wanted = [*(driver.read_program() if start else []), f"P {start}", *short]
    driver.write_program(long, start)
    driver.write_program(short, start)
    assert driver.read_program() == wanted, "download has what is left over"
    assert driver.left_over, "nothing is said of it"
    memory = cell.controller("u").kept_memory()
    smc = catalogue.language("dcb-274")
    assert places(assemble(smc, disassemble(smc, memory))) == places(assemble(smc, "\n".join(wanted)))
    return True


LANGUAGES = [name for name in ("gs-c200", "gs-c200s", "dcb-274") if name not in OPEN.get("languages", ())]
every_language = pytest.mark.parametrize("model", LANGUAGES)


def check(law: Callable[[str, str], bool], model: str, count: int, least: int) -> None:
    def make(draw: Random) -> tuple[History, str]:
        return History({}, (), ()), source(draw, model)

    told = hold(lambda _, text: law(model, text), make, count, f"{law.__name__} of {model}")
    assert told >= least, f"{count - told} of {count} sources are refused"


TOGETHER = {"dcb-274": 8}
"""Programs that a unit is given one after the other before it is saved and restored, which takes most of the time."""


def keep(model: str, count: int) -> int:
    """Hold the law of kept programs against so many programs; how many units had something to keep."""
    together = TOGETHER.get(model, 1)

    def make(draw: Random) -> tuple[History, list[str]]:
        return History({}, (), ()), [source(draw, model) for _ in range(together)]

    return hold(
        lambda _, texts: units_keep_programs(model, texts), make, count // together, f"units_keep_programs of {model}"
    )


@every_language
def test_what_is_printed_is_taken_back(model: str) -> None:
    check(what_is_printed_is_taken_back, model, ORDINARY, ORDINARY // 2)


@every_language
def test_the_eeprom_file_is_taken_for_an_image(model: str, tmp_path: Path) -> None:
    def law(model: str, text: str) -> bool:
        return file_of_the_eeprom_is_taken(model, text, tmp_path)

    check(law, model, ORDINARY // 10, ORDINARY // 20)


@every_language
def test_units_keep_programs(model: str) -> None:
    assert keep(model, 8) >= 1


def test_what_is_left_over_is_no_program() -> None:
    def make(draw: Random) -> tuple[History, tuple[int, list[str], list[str]]]:
        long = [f"{draw.choice('+-')} {n}" for n in draw.sample(range(1, 60_000), 7)]
        short = [f"W {n}" for n in draw.sample(range(9999), 4)][: draw.choice((3, 4))]
        return History({}, (), ()), (draw.choice((0, 256, 300, 1600)), long, short)

    assert hold(lambda _, made: what_is_left_over_is_no_program(*made), make, 4, "what is left over") == 4


@pytest.mark.slow
@every_language
def test_what_is_printed_is_taken_back_of_many_more_programs(model: str) -> None:
    check(what_is_printed_is_taken_back, model, THOROUGH, THOROUGH // 2)


@pytest.mark.slow
@every_language
def test_the_eeprom_file_is_taken_for_an_image_of_many_more_programs(model: str, tmp_path: Path) -> None:
    def law(model: str, text: str) -> bool:
        return file_of_the_eeprom_is_taken(model, text, tmp_path)

    check(law, model, THOROUGH, THOROUGH // 2)


@pytest.mark.slow
@every_language
def test_units_keep_many_more_programs(model: str) -> None:
    assert keep(model, THOROUGH) >= THOROUGH // TOGETHER.get(model, 1) // 2
