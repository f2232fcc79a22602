"""Driver chips: registers from amperes, refusals where a chip cannot do it, and chips that do not answer."""

from typing import Any

import pytest
from tests.realtime.boards.bench import Bench, setup, slide

from detent.controllers.device import Stage
from detent.realtime.boards.events import DriverFault, DriverSet
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chip
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.registers import (
    bits_of_bytes,
    bytes_of_bits,
    check_byte,
    read_answer,
    read_frame,
    settings,
    write_frame,
)
from detent.realtime.boards.setup import DriverSetup, Pin, SetupProblem
from detent.ticks import MS, SECOND

HALF = Stage(sequence=1, places=32, run=1.0, hold=0.5, settling=1 * SECOND)


def chip(kind: Any = "tmc2209", **values: Any) -> DriverSetup:
    wires: dict[str, Any] = {"uart": Pin("gpio20")}
    if kind in ("tmc2130", "tmc5160"):
        wires = {"select": Pin("gpio21"), "bus": "spi0"}
    return DriverSetup("slide driver", kind, **{"sense": 0.11, "amperes": 1.0, **wires, **values})


def values(made: DriverSetup, stage: Stage) -> dict[str, int]:
    return {entry.name: entry.value for entry in settings(made, stage)}


def test_the_check_byte_of_the_data_sheet() -> None:
    """TMC2209 data sheet, section 4.2; 48h ends the request for register 0 of chip 0."""
    assert check_byte(bytes((5, 0, 0))) == 0x48
    assert read_frame(0, 0) == bytes.fromhex("05 00 00 48")
    assert write_frame(2, 0x10, 0x01020304)[:7] == bytes.fromhex("05 02 90 01 02 03 04")


def test_bits_on_the_wire() -> None:
    assert bits_of_bytes(b"\x00") == bytes((0x00, 0x02))
    assert len(bits_of_bytes(bytes(8))) == 10
    assert len(bits_of_bytes(bytes(4))) == 5
    assert bytes_of_bits(bits_of_bytes(bytes(range(8)))) == bytes(range(8))
    assert bytes_of_bits(bytes(10)) is None
    assert read_answer(None, 2) is None
    assert read_answer(bytes.fromhex("05 ff 02 00 00 00 07 00"), 2) is None


def test_currents() -> None:
    """TMC2209 section 9: (CS + 1) / 32 * 0.325 V / (0.11 + 0.02) / sqrt 2 is 1.7678 A at 32/32, 0.979 A with vsense."""
    full = values(chip(amperes=1.5), HALF)
    run, hold = full["IHOLD_IRUN"] >> 8 & 31, full["IHOLD_IRUN"] & 31
    assert (run, hold) == (round(1.5 / 1.7678 * 32) - 1, round(0.75 / 1.7678 * 32) - 1)
    assert not full["CHOPCONF"] >> 17 & 1
    low = values(chip(amperes=0.9), HALF)
    assert low["CHOPCONF"] >> 17 & 1  # vsense: the finer range
    assert low["IHOLD_IRUN"] >> 8 & 31 == round(0.9 / 0.97909 * 32) - 1


@pytest.mark.parametrize(
    ("sense", "amperes"),
    [(1.00, 0.23), (0.75, 0.30), (0.50, 0.44), (0.33, 0.66), (0.22, 0.96), (0.15, 1.35), (0.12, 1.64), (0.10, 1.92)],
)
def test_currents_of_the_data_sheet(sense: float, amperes: float) -> None:
    """TMC2209 section 8: what resistors give with IRUN 31 and vsense 0, to a hundredth."""
    full = values(chip(sense=sense, amperes=amperes - 0.005), HALF)
    assert full["IHOLD_IRUN"] >> 8 & 31 >= 30
    assert not full["CHOPCONF"] >> 17 & 1
    with pytest.raises(SetupProblem, match=f"gives {amperes:.2f} A a phase"):
        settings(chip(sense=sense, amperes=amperes + 0.006), HALF)


@pytest.mark.parametrize("kind", ["tmc2208", "tmc2209", "tmc2130", "tmc5160"])
def test_the_current_is_within_half_a_step_of_what_was_asked(kind: Any) -> None:
    for thousandths in range(40, 1400, 7):
        asked = thousandths / 1000
        made = chip(kind, sense=0.075 if kind == "tmc5160" else 0.1, amperes=asked)
        found = values(made, HALF)
        if kind == "tmc5160":
            full = found["GLOBALSCALER"] / 256 * 0.325 / 0.075 / 2**0.5
        else:
            volts = 0.180 if found["CHOPCONF"] >> 17 & 1 else 0.320 if kind == "tmc2130" else 0.325
            full = volts / 0.12 / 2**0.5
        for scale, wanted in ((found["IHOLD_IRUN"] >> 8 & 31, asked), (found["IHOLD_IRUN"] & 31, asked / 2)):
            assert abs((scale + 1) / 32 * full - wanted) <= full / 64 + 1e-9


def test_amperes_of_a_controller_that_chops() -> None:
    stage = Stage(sequence=1, places=64, run=0.8, hold=0.4, settling=SECOND, chops=True)
    assert values(chip(amperes=None), stage) == values(chip(amperes=3.0), stage)
    less = values(chip(amperes=0.6), stage)
    full = 0.180 / 0.13 / 2**0.5
    assert less["IHOLD_IRUN"] >> 8 & 31 == round(0.6 / full * 32) - 1  # the most
    assert less["IHOLD_IRUN"] & 31 == round(0.4 / full * 32) - 1  # as commanded


def test_the_5160_scales_with_its_scaler() -> None:
    found = values(chip("tmc5160", sense=0.075, amperes=2.0), HALF)
    scaler = found["GLOBALSCALER"]
    full = scaler / 256 * 0.325 / 0.075 / 2**0.5
    assert 32 <= scaler <= 255
    assert abs((found["IHOLD_IRUN"] >> 8 & 31) + 1 - 32) <= 1
    assert full >= 2.0


@pytest.mark.parametrize(("places", "mres"), [(64, 8), (32, 7), (16, 6), (8, 5), (4, 4), (2, 3), (1, 2), (-32, 7)])
def test_microsteps(places: int, mres: int) -> None:
    assert values(chip(), HALF._replace(places=places))["CHOPCONF"] >> 24 & 15 == mres


def test_times() -> None:
    """TPOWERDOWN in units of 2**18 clocks of 12 MHz: a second is 46."""
    assert values(chip(), HALF)["TPOWERDOWN"] == 46
    without = values(chip(), HALF._replace(settling=0))
    assert without["IHOLD_IRUN"] & 31 == without["IHOLD_IRUN"] >> 8 & 31


@pytest.mark.parametrize(
    ("made", "stage", "key", "said"),
    [
        (chip(amperes=None), HALF, "amperes", "amperes = 0.8"),
        (chip(amperes=1.9), HALF, "sense", "gives 1.77 A a phase, not 1.90: say that less will do, amperes = 1.7, or "),
        (
            chip(amperes=2.5),
            HALF,
            "kind",
            "a tmc2209 carries 2 A a phase, not 2.50: say that less will do, amperes = 2, ",
        ),
        (chip("tmc2208", amperes=1.5, sense=0.1), HALF, "kind", "carries 1.4 A a phase"),
        (chip("tmc2130", amperes=1.5, sense=0.1), HALF, "kind", "carries 1.4 A a phase"),
        (chip(amperes=0.02), HALF, "amperes", "gives 0.0306 A a phase at least: take a larger resistor"),
        (chip("tmc5160", sense=0.075, amperes=0.01), HALF, "amperes", "gives 0.012 A a phase at least"),
        (chip("tmc5160", sense=0.075, amperes=4.0), HALF, "sense", "gives 3.06 A a phase, not 4.00"),
        (chip(sense=0.0), HALF, "sense", "write it in ohm"),
        (chip(), HALF._replace(places=24), "kind", "24/64 of a full step a pulse"),
        (chip(), HALF._replace(places=128), "kind", "128/64"),
        (chip(), HALF._replace(settling=6 * SECOND), "kind", "waits 5.6 s at most"),
        (chip(), HALF._replace(fast_from=1000, fast_sequence=2), "kind", "changes its sequence"),
    ],
)
def test_what_a_chip_cannot_do_is_refused(made: DriverSetup, stage: Stage, key: str, said: str) -> None:
    with pytest.raises(SetupProblem, match=said) as caught:
        settings(made, stage)
    assert (caught.value.item, caught.value.key) == ("slide driver", key)


def driven(made: DriverSetup, *chips: Chip, **changes: Any) -> Bench:
    fake = FakeBoard(slide())
    wire = made.uart or made.select
    assert wire is not None
    fake.chips[wire.name] = chips
    return Bench([(setup(drivers=(made, *changes.pop("more", ())), **changes), FakePort(fake))])


@pytest.mark.parametrize("made", [chip(address=2), chip("tmc2208"), chip("tmc2130"), chip("tmc5160", sense=0.075)])
def test_registers_are_written_and_read_back(made: DriverSetup) -> None:
    real = Chip(made.address)
    bench = driven(made, real)
    bench.boards.drivers["slide driver"].command(HALF)
    bench.run(300 * MS)
    assert [type(event) for event in bench.events[1:]] == [DriverSet]
    assert real.registers == {entry.register: entry.value for entry in settings(made, HALF)}
    # the same again writes nothing, another setting does
    writes = real.writes
    bench.boards.drivers["slide driver"].command(HALF)
    bench.run(200 * MS)
    assert real.writes == writes
    bench.boards.drivers["slide driver"].command(HALF._replace(hold=0.25))
    bench.run(300 * MS)
    assert real.registers == {entry.register: entry.value for entry in settings(made, HALF._replace(hold=0.25))}


def test_two_chips_on_a_wire() -> None:
    other = DriverSetup("other", "tmc2209", amperes=0.5, uart=Pin("gpio20"), address=1)
    chips = Chip(0), Chip(1)
    bench = driven(chip(), *chips, more=(other,))
    for driver in bench.boards.drivers.values():
        driver.command(HALF)
    bench.run(600 * MS)
    assert len(bench.of(DriverSet)) == 2
    assert chips[1].registers == {entry.register: entry.value for entry in settings(other, HALF)}


@pytest.mark.parametrize(
    ("made", "real", "said"),
    [
        (chip(), Chip(deaf=True), "tmc2209 at gpio20, address 0 does not answer"),
        (chip(address=1), Chip(0), "address 1 does not answer"),
        (chip("tmc2130"), Chip(deaf=True), "tmc2130 at gpio21 does not answer"),
        (chip("tmc2130"), Chip(forgets=True), "does not answer"),
    ],
)
def test_a_chip_that_does_not_answer_is_told(made: DriverSetup, real: Chip, said: str) -> None:
    bench = driven(made, real)
    bench.boards.drivers["slide driver"].command(HALF)
    bench.run(2 * SECOND)
    [fault] = bench.of(DriverFault)
    assert said in fault.reason


def test_a_chip_that_does_not_count_its_writes_is_told() -> None:
    class Dull(Chip):
        def write(self, register: int, value: int) -> None:
            self.writes += register != 0x10

    bench = driven(chip(), Dull())
    bench.boards.drivers["slide driver"].command(HALF)
    bench.run(2 * SECOND)
    [fault] = bench.of(DriverFault)
    assert "it took 3 of 4 writes" in fault.reason


def test_behind_a_shutdown_a_chip_is_set_again() -> None:
    real = Chip()
    bench = driven(chip(), real)
    bench.boards.drivers["slide driver"].command(HALF)
    bench.run(300 * MS)
    bench.boards.emergency_stop(bench.wall)
    real.registers.clear()  # its supply was switched off
    bench.run(50 * MS)
    bench.boards.recover(bench.wall)
    bench.run(1 * SECOND)
    assert real.registers == {entry.register: entry.value for entry in settings(chip(), HALF)}


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (DriverSetup("d", "tmc2209"), "d.uart: a driver is reached by its uart pin"),
        (DriverSetup("d", "tmc2130", uart=Pin("gpio20")), "d.kind: a tmc2130 is reached by select and a bus"),
        (DriverSetup("d", "tmc2209", uart=Pin("gpio20"), address=4), "d.address: a tmc2209 has no address 4"),
    ],
)
def test_wires_that_do_not_fit_the_chip(made: DriverSetup, said: str) -> None:
    with pytest.raises(SetupProblem, match=said):
        Bench([(setup(drivers=(made,)), FakePort(FakeBoard()))], start=False)


@pytest.mark.parametrize("made", [chip(), chip("tmc2208"), chip("tmc2130"), chip("tmc5160", sense=0.075)])
@pytest.mark.parametrize("away", [True, False])
def test_a_chip_whose_supply_was_cut_is_told_and_set_again_when_it_is_commanded(made: DriverSetup, away: bool) -> None:
    """Released, a mushroom button brings a chip back with a current and microsteps of its own."""
    real = Chip(made.address)
    bench = driven(made, real)
    driver = bench.boards.drivers["slide driver"]
    driver.command(HALF)
    bench.run(10 * SECOND)
    assert bench.of(DriverFault) == []
    writes = real.writes
    real.deaf, real.writes, real.registers = away, 0, {0x6C: 0x10410150}  # as it comes up
    bench.run(3 * SECOND)
    [fault] = bench.of(DriverFault)
    assert ("does not answer; look at its supply" if away else "lost its settings: was its supply cut?") in fault.reason
    assert real.writes == 0, "nothing is set before somebody has looked at the machine"
    real.deaf = False
    driver.command(HALF)
    bench.run(3 * SECOND)
    assert len(bench.of(DriverSet)) == 2
    assert len(bench.of(DriverFault)) == 1
    assert real.writes == writes
    assert real.registers == {entry.register: entry.value for entry in settings(made, HALF)}
