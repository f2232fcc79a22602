"""A unit that is left alone while its line carries what is for others is as if it had heard all of it.

The same generated stream goes to two cells, of which one lets every unit hear every character.
"""

import contextlib
from collections.abc import Callable, Sequence

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from detent.cell import circuit
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.faults import Fault, OnLine, SupplyDip, WriteFailure
from detent.controllers.dcb274.firmware import Dcb274
from detent.lines.faults import UNITS, BitErrors, LostCharacters
from detent.ticks import MS, US
from detent.uart import SOUND, Char, Chars

NAMES = "ABcd"
SETTINGS = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=list(HealthCheck)
)
Deed = Callable[[Cell], None]

COMMANDS = ("", "Z", "+30", "-7", "M 900", "@", "|", "G 0", "P 0", "P", "W 1", "J 0 2", "L 1", "S", "C", "X", "^",
            "R 50", "T 4", "O", "Z 1", "C 1", "far too long a line for it")  # fmt: skip
CONTROL = b"\x03\x0e\x10\x1b\n\n\r\x00 @"
PINS = ("GO", "SS", "JOG1", "LIMIT-A", "HOME", "P1", "PARTY", "B1", "STEP")


def party_line(names: str, *, timed: bool) -> Cell:
    """Units u0, u1 ... on one line; two may have the same name."""
    text = ["[lines.bus]", f"units = {[f'u{place}' for place in range(len(names))]}"]
    for place, name in enumerate(names):
        options, straps = f'{{ name = "{name}" }}', '{ PARTY = "high", B1 = "high" }'
        text += [f"[units.u{place}]", 'model = "dcb-274"', f"options = {options}", f"straps = {straps}"]
    return build(parse("\n".join(text), "test"), lambda file: "", line_timing=timed)


def sends(data: Chars) -> Deed:
    return lambda cell: cell.send(0, data)


@st.composite
def deeds(draw: st.DrawFn) -> Deed:
    """Something that is done to a cell in one instant."""
    name = draw(st.sampled_from(NAMES))
    unit = f"u{draw(st.integers(0, 1))}"
    match draw(st.integers(0, 15)):
        case 0:
            return sends(bytes([draw(st.sampled_from(CONTROL))]))
        case 1:
            return sends(b"\x0e" + draw(st.sampled_from(NAMES + "E")).encode())
        case 2:
            value = draw(st.sampled_from(b"ABcd\nZ\x1b"))
            return sends([SOUND[ord(name)], Char(value, parity_ok=draw(st.booleans()), framing_ok=False), SOUND[10]])
        case 3:
            return sends(draw(st.binary(max_size=4)))
        case 4:
            pin, level = draw(st.sampled_from(PINS)), draw(st.integers(0, 1))
            return lambda cell: cell.set_pin(unit, pin, level)
        case 5:
            on = draw(st.booleans())
            return lambda cell: cell.power(unit, on)
        case 6:
            return draw(st.sampled_from([lambda cell: cell.start(unit), lambda cell: cell.halt(unit)]))
        case 7:
            seed = draw(st.integers(0, 9))
            lost: list[Fault] = [
                OnLine(0, LostCharacters(UNITS, 0.2, seed=seed)),
                OnLine(0, BitErrors(UNITS, 0.2, seed=seed)),
            ]
            fault = draw(st.sampled_from([*lost, WriteFailure(unit, 1), SupplyDip(unit)]))
            lasting = draw(st.sampled_from([US, 10 * MS]))
            return lambda cell: cell.breaks(fault, lasting) and None
        case _:
            text = name + draw(st.sampled_from(COMMANDS)) + "\n"
            data = text.encode()[: draw(st.sampled_from([1, 2, 99, 99, 99]))]
            return sends(data)


def made_of(cell: Cell) -> Sequence[object]:
    """What was told of it, and how its units are."""
    units = [unit for unit in cell.parts if isinstance(unit, Dcb274)]
    looks = [(unit.mode, unit.answering, unit.next_deadline(), unit.registers(cell.now)) for unit in units]
    memories = [(unit.kept_memory(), unit.program_memory()) for unit in units]
    return [list(cell.recording or ()), cell.lines[0].take(), cell.next_event(), looks, memories]


def everybody_hears(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(circuit, "overhearing", lambda parts, places: None)


def hold(names: str, stream: list[tuple[int, Deed]], *, timed: bool) -> None:
    """Both cells live through the same, and both have the same to tell of it."""
    with pytest.MonkeyPatch.context() as plain:
        everybody_hears(plain)
        hearing = party_line(names, timed=timed)
    skipping = party_line(names, timed=timed)
    for place, (pause, deed) in enumerate(stream):
        for one in (hearing, skipping):
            one.run_to(one.now + pause)
            with contextlib.suppress(ValueError):  # of a unit that is switched off
                deed(one)
        if place == len(stream) // 2:
            skipping = skipping.copy()
    for one in (hearing, skipping):
        one.run_to(one.now + 100 * MS)
    assert made_of(skipping) == made_of(hearing)
    for one in (hearing, skipping):
        for name in names:
            one.send(0, f"\n{name}Z\n".encode())
            one.run_to(one.now + 100 * MS)
    assert made_of(skipping) == made_of(hearing)


DAMAGED = Char(10, framing_ok=False)


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize(
    "deeds_of_it",
    [
        [sends(b"AZ\n"), sends(b"BZ\n"), sends(b"B+30\n"), sends(b"AZ\n")],
        [sends(b"A"), sends(b"\x1b")],
        [sends(b"AZ\n"), sends(b"\x03"), sends(b"BZ\n")],
        [sends(b"A"), sends(b"\x0e"), sends(b"C"), sends(b"CZ\nBZ\nAZ\n")],
        [sends(b"A"), sends(b"Z"), sends([DAMAGED]), sends(b"B"), sends(b"Z"), sends(b"\n"), sends(b"BZ\n")],
        [sends(text) for text in (b"AP 0\n", b"A+70\n", b"AP\n", b"BZ\n", b"AG 0\n", b"B", b"A@\n")],
        [
            sends(b"A"), sends(b"Z"), lambda cell: cell.set_pin("u1", "PARTY", 0), lambda cell: cell.power("u1", False),
            lambda cell: cell.power("u1", True), sends(b"x"), sends(b" "), sends(b"\n"),
        ],
    ],
    ids=["lines", "ESC", "reset", "new names", "a damaged end", "a program", "out of the party"],
)  # fmt: skip
def test_who_is_turned_away_hears_what_it_must(deeds_of_it: list[Deed], timed: bool) -> None:
    hold("AB", [(40 * MS, deed) for deed in deeds_of_it], timed=timed)


@given(
    st.lists(st.tuples(st.sampled_from([0, 1, 30 * US, 2 * MS, 40 * MS]), deeds()), min_size=4, max_size=40),
    st.sampled_from(["AB", "AA", "dcB", "ABcd", "BABc"]), st.booleans(),
)  # fmt: skip
@SETTINGS
def test_who_is_turned_away_misses_nothing(stream: list[tuple[int, Deed]], names: str, timed: bool) -> None:
    hold(names, stream, timed=timed)
