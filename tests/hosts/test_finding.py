"""Every question of a search reaches every unit, in whatever format either side has, bit by bit: who is there is found,
and nobody is harmed."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse, single
from detent.cell.host import HostPort
from detent.controllers.device import MotionStarted, StoreImage
from detent.hosts import finding
from detent.hosts.finding import FORMATS, Found, Pass, plan
from detent.realtime.connect import connect
from detent.realtime.finding import Talks, search_at
from detent.ticks import MS, SECOND
from detent.uart import Format, heard_as


class Wire(HostPort):
    """The wire to a line of a cell: whoever talks in another format than the line has is heard as bits fall."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.own = cell.lines[0].format
        self.form = self.own

    def set_format(self, form: Format) -> None:
        self.form = form

    def write(self, data: bytes) -> int:
        if self.form == self.own:
            return super().write(data)
        self.cell.send(0, heard_as(data, self.form, self.own))
        self.wait(len(data) * self.form.duration() / SECOND)
        return len(data)

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        if self.form == self.own:
            return data
        return bytes(char.value for char in heard_as(data, self.own, self.form))


def alone(model: str, straps: Mapping[str, Any] | None = None, options: Mapping[str, Any] | None = None) -> Cell:
    """A unit that has been on for a while, with line timing."""
    cell = build(single(model, straps=dict(straps or {}), options=dict(options or {})), no_file)
    cell.run_to(SECOND)
    return cell


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


def looked_for(cell: Cell, passes: list[Pass] | None = None) -> list[Found]:
    return search_at(Wire(cell), passes if passes is not None else plan())


def harm(cell: Cell) -> list[object]:
    """What no question may do: motion, and writing to a memory that stays."""
    assert cell.recording is not None
    return [entry for _, entry in cell.recording if isinstance(entry, (MotionStarted, StoreImage))]


GS_C200_RATES = [  # BR0, BR1, BR2 (datasheet, baud rate selection)
    ("low", "low", "low", 9600),
    ("high", "low", "low", 4800),
    ("low", "high", "low", 2400),
    ("high", "high", "low", 1200),
    ("low", "low", "high", 600),
    ("high", "low", "high", 300),
    ("low", "high", "high", 150),
    ("high", "high", "high", 110),
]


@pytest.mark.parametrize(("br0", "br1", "br2", "baud"), GS_C200_RATES)
@pytest.mark.parametrize("checksum", ["open", "low"])
def test_a_gs_c200_is_found_at_each_of_its_rates(br0: str, br1: str, br2: str, baud: int, checksum: str) -> None:
    cell = alone("gs-c200", {"BR0": br0, "BR1": br1, "BR2": br2, "CHS": checksum})
    (found,) = looked_for(cell)
    options = {} if checksum == "open" else {"checksums": False}
    assert found == ("gs-c200", Format(baud, 7, "odd", 2), options, "ready, at 0")
    assert not harm(cell)


def test_a_gs_c200s_is_told_by_the_sign_of_its_counter_and_an_old_one_by_its_checksums() -> None:
    assert looked_for(alone("gs-c200s"))[0].model == "gs-c200s"
    old = looked_for(alone("gs-c200", options={"revision": "2.1"}))[0]  # "V2.1 or older": not ORed with 10h
    assert (old.model, old.options) == ("gs-c200", {"revision": "2.1"})


def test_modules_of_a_multipoint_line_are_found_by_their_addresses() -> None:
    text = """
    [units.one]
    model = "gs-c200"
    straps = { SEL0 = "high", SEL1 = "high", SEL2 = "low" }
    [units.two]
    model = "gs-c200s"
    straps = { SEL0 = "high", SEL1 = "low", SEL2 = "high" }
    [lines.bus]
    units = ["one", "two"]
    """
    cell = build(parse(text, "cell.toml"), no_file)
    found = looked_for(cell)
    assert [(one.model, one.options) for one in found] == [("gs-c200", {"address": 1}), ("gs-c200s", {"address": 2})]
    assert not harm(cell)


@pytest.mark.parametrize(("b1", "b2", "baud"), [(0, 0, 9600), (1, 0, 460_800), (0, 1, 38_400), (1, 1, 19_200)])
def test_a_dcb_274_is_found_in_single_mode_at_each_of_its_rates(b1: int, b2: int, baud: int) -> None:
    levels = {0: "low", 1: "high"}
    cell = jumpered(levels, b1, b2)
    (found,) = looked_for(cell)
    assert (found.model, found.form.baud, found.options) == ("dcb-274", baud, {})
    assert "n=A" in found.says  # X prints the settings (page 52)
    assert not harm(cell)


def jumpered(levels: Mapping[int, str], b1: int, b2: int, party: str = "low") -> Cell:
    """A DCB-274 with jumpers B1 and B2 set or not, whichever level that is."""
    for inverted in (False, True):
        straps = {"B1": levels[b1 ^ inverted], "B2": levels[b2 ^ inverted], "PARTY": party}
        cell = alone("dcb-274", straps)
        if cell.lines[0].format.baud == {(0, 0): 9600, (1, 0): 460_800, (0, 1): 38_400, (1, 1): 19_200}[b1, b2]:
            return cell
    raise AssertionError("no level makes these rates")


@pytest.mark.parametrize(("b1", "b2", "baud"), [(0, 0, 9600), (1, 0, 460_800), (0, 1, 38_400), (1, 1, 19_200)])
def test_an_axis_of_a_party_line_is_found_by_its_name(b1: int, b2: int, baud: int) -> None:
    cell = jumpered({0: "low", 1: "high"}, b1, b2, party="high")
    (found,) = looked_for(cell)
    assert found == ("dcb-274", Format(baud), {"mode": "party", "name": "A"}, "at rest")
    assert not harm(cell)


def test_all_axes_of_a_party_line_are_found() -> None:
    unit = '[units.{0}]\nmodel = "dcb-274"\nstraps = {{ PARTY = "high" }}\noptions = {{ name = "{0}" }}\n'
    text = "".join(unit.format(name) for name in "AX7") + '[lines.bus]\nunits = ["A", "X", "7"]\n'
    cell = build(parse(text, "cell.toml"), no_file)
    found = looked_for(cell)
    assert [one.options["name"] for one in found] == ["7", "A", "X"]
    assert not harm(cell)


def test_an_axis_of_a_party_line_that_runs_a_program_is_found_by_the_echo_of_its_name() -> None:
    """Pages 25 and 57: the name is echoed, so that | can follow; nothing else is."""
    cell = jumpered({0: "low", 1: "high"}, 0, 0, party="high")
    for line in ("\nAP 0", "AM 900", "AL 2048 0", "AP", "AG"):
        cell.send(0, f"{line}\n".encode())
        cell.run_to(cell.now + 200_000_000)
    (found,) = looked_for(cell)
    assert (found.options, found.says) == ({"mode": "party", "name": "A"}, "runs a program, or jogs")
    assert next(iter(cell.controllers().values())).status(cell.now).state == "running"


@pytest.mark.parametrize(("baud", "dual"), [(9600, "no"), (4800, "no"), (2400, "no"), (4800, "yes"), (2400, "yes")])
def test_a_genstepper_board_is_found_at_each_of_its_rates(baud: int, dual: str) -> None:
    straps = {"S1K": "low"} if dual == "yes" else {}
    cell = alone("bs0610", straps, {"baud": str(baud), "dual_baud": dual})
    before = state(cell)
    (found,) = looked_for(cell)
    assert (found.model, found.form.baud) == ("bs0610", baud // (4 if dual == "yes" else 1))
    assert "2.18" in found.says
    assert not harm(cell)
    assert state(cell) == before


def test_drives_of_a_microbus_are_found_by_their_numbers_on_request_alone() -> None:
    text = """
    [units.left]
    model = "supersigma"
    options = { number = 0 }
    [units.right]
    model = "supersigma"
    options = { number = 255 }
    [lines.bus]
    units = ["left", "right"]
    """
    cell = build(parse(text, "cell.toml"), no_file)
    found = looked_for(cell, plan(["supersigma"]))
    assert [one.options["drive"] for one in found] == [0, 255]
    assert not harm(cell)
    with pytest.raises(ValueError, match="a SUPERSIGMA is looked for alone"):
        plan(["supersigma", "gs-c200"])


# -- nobody is harmed ------------------------------------------------------------------------------------


def state(cell: Cell) -> object:
    """What a unit keeps and how it is set, as its own driver reads it, in a copy of the cell."""
    copy = cell.copy()
    copy.run_to(copy.now + SECOND)
    name = next(iter(copy.controllers()))
    model = copy.controller(name).model
    unit = connect(model, HostPort(copy), **({"checksums": False} if model == "gs-c200" else {}))
    # the NV memory of a DCB-274 is no matter here: harm() looks whether anything was written to it
    return unit.examine() if model == "dcb-274" else unit.saved(), unit.position()


def typed(text: bytes) -> Callable[[Cell], None]:
    """Somebody has begun to type a command, and went away."""

    def begin(cell: Cell) -> None:
        for value in text:
            cell.send(0, bytes([value]))
            cell.run_to(cell.now + 20 * MS)

    return begin


def everything_asked() -> list[tuple[Format, bytes]]:
    """Every question of a search that nobody answers, with its format."""
    asked: list[tuple[Format, bytes]] = []
    form = Format(9600)
    steps = finding.search(plan())
    answer = None
    try:
        while True:
            step = next(steps) if answer is None else steps.send(answer)
            answer = finding.Answer(b"", whole=False)
            if isinstance(step, finding.Tune):
                form = step.form
            elif isinstance(step, finding.Ask):
                asked.append((form, step.data))
    except StopIteration:
        return asked


ASKED = everything_asked()


@pytest.mark.parametrize("begun", [b"", b"+1000", b"G", b"R9", b"1+10", b"M"])
@pytest.mark.parametrize("baud", [9600, 2400, 110])
def test_every_question_in_every_format_leaves_a_gs_c200_as_it_was(begun: bytes, baud: int) -> None:
    br0, br1, br2, _ = next(row for row in GS_C200_RATES if row[3] == baud)
    cell = alone("gs-c200", {"BR0": br0, "BR1": br1, "BR2": br2, "CHS": "low"})
    before = state(cell)
    typed(begun)(cell)
    ask_all(cell)
    assert not harm(cell)
    assert state(cell) == before


@pytest.mark.parametrize("begun", [b"", b" +1000", b" V 500", b" @"])
@pytest.mark.parametrize(("b1", "b2"), [(0, 0), (1, 1), (0, 1), (1, 0)])
def test_a_search_leaves_a_dcb_274_in_single_mode_as_it_was(begun: bytes, b1: int, b2: int) -> None:
    cell = jumpered({0: "low", 1: "high"}, b1, b2)
    before = state(cell)
    typed(begun)(cell)
    # what it hears at other rates, and the whole search, which takes back what was begun
    own = cell.lines[0].format
    ask_all(cell, [(form, data) for form, data in ASKED if data == b" " and form != own])
    assert len(looked_for(cell)) == 1
    assert not harm(cell)
    assert state(cell) == before


def test_a_dcb_274_in_program_mode_is_found_and_its_program_is_left_alone() -> None:
    cell = alone("dcb-274")
    typed(b" P 300\r+5")(cell)
    (found,) = looked_for(cell)
    assert found.says == "in program mode"
    cell.run_to(cell.now + SECOND)
    assert not harm(cell)


@pytest.mark.parametrize("begun", [b"", b"\nA+1000", b"\nA", b"\nB+1000"])
@pytest.mark.parametrize(("b1", "b2"), [(0, 0), (1, 1), (0, 1), (1, 0)])
def test_every_question_in_every_format_leaves_a_party_line_as_it_was(begun: bytes, b1: int, b2: int) -> None:
    cell = jumpered({0: "low", 1: "high"}, b1, b2, party="high")
    typed(begun)(cell)
    ask_all(cell)
    assert not harm(cell)


@pytest.mark.parametrize("baud", [9600, 4800, 2400])
def test_what_is_heard_at_another_rate_leaves_a_genstepper_board_as_it_was(baud: int) -> None:
    cell = alone("bs0610", options={"baud": str(baud)})
    before = state(cell)
    ask_all(cell, [(form, data) for form, data in ASKED if data == b" "])
    assert not harm(cell)
    assert state(cell) == before


def ask_all(cell: Cell, questions: list[tuple[Format, bytes]] | None = None) -> None:
    """Everything is asked, whoever answers."""
    wire = Wire(cell)
    for form, data in ASKED if questions is None else questions:
        wire.set_format(form)
        wire.write(data)
        wire.wait(0.02)


def test_a_space_at_another_rate_is_nothing_that_any_unit_knows() -> None:
    rates = {*FORMATS["dcb-274"], *FORMATS["bs0610"]}
    heard = {
        char.value
        for sent in rates
        for read in rates
        if sent != read
        for char in heard_as(b" ", sent, read)
        if char.framing_ok
    }
    assert heard <= {0x00, 0x80, *range(0xF8, 0x100)}


# -- the plan ---------------------------------------------------------------------------------------------


def test_a_line_without_a_format_is_asked_once_with_the_patience_of_the_slowest() -> None:
    passes = plan(formless=True)
    assert [(one.kind, one.form.baud) for one in passes] == [("space", 600), ("frames", 110), ("names", 9600)]
    assert all(one.rate == "" for one in passes)


def test_rates_and_models_can_be_chosen() -> None:
    assert [one.form.baud for one in plan(["gs-c200"], rates=[1200, 9600])] == [9600, 1200]
    with pytest.raises(ValueError, match="none of these controllers talks at 77 baud"):
        plan(rates=[77])
    with pytest.raises(ValueError, match="gs-c300 cannot be looked for; dcb-274, bs0610, gs-c200, supersigma can"):
        plan(["gs-c300"])


class Chatter(Wire):
    """Something that talks all the time."""

    def receive(self, timeout: float) -> bytes:
        return b"$GPGGA,,,,,0\r\n"


def test_what_talks_without_being_asked_is_left_alone() -> None:
    with pytest.raises(Talks, match="something talks there without being asked"):
        search_at(Chatter(alone("gs-c200")), plan())


def test_a_plug_that_sends_back_what_it_hears_is_no_controller() -> None:
    class Loopback(Wire):
        back = b""

        def write(self, data: bytes) -> int:
            self.back += data
            return len(data)

        def receive(self, timeout: float) -> bytes:
            data, self.back = self.back, b""
            return data

    for model in ("gs-c200", "dcb-274", "bs0610", "supersigma"):
        with pytest.raises(Talks, match="looped or crossed"):
            search_at(Loopback(alone("gs-c200")), plan((model,)))


def test_the_error_that_a_program_left_behind_is_fetched_and_told() -> None:
    # "E5: overflow of the position counter" is kept until F
    cell = alone("gs-c200", {"CHS": "low"})
    unit = connect("gs-c200", HostPort(cell), checksums=False)
    unit.write_program(["T1000", "G9999999", "+100"])
    unit.execute()
    cell.run_to(cell.now + 3600 * SECOND)
    (found,) = looked_for(cell)
    assert found.says.startswith("ready, and a program had ended with E5")
