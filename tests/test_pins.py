"""Levels, drivers and nets."""

from hypothesis import given
from hypothesis import strategies as st

from detent.controllers.gsc200 import pins as gsc200
from detent.pins import HIGH, LOW, Net, PinDriver, PinKind, PinSet


def test_a_driver_tells_every_change_and_nothing_else() -> None:
    out: list[PinSet] = []
    driver = PinDriver(out)
    driver.set("RDY", HIGH, 0)
    driver.set("RDY", HIGH, 1)
    driver.set("RDY", LOW, 2)
    driver.set("MOV", LOW, 2)
    driver.set("RDY", LOW, 3)
    driver.set("RDY", HIGH, 3)
    driver.set("RDY", LOW, 3)
    assert out == [
        PinSet(0, "RDY", HIGH),
        PinSet(2, "RDY", LOW),
        PinSet(2, "MOV", LOW),
        PinSet(3, "RDY", HIGH),
        PinSet(3, "RDY", LOW),
    ]


def test_a_driver_that_has_let_go_tells_its_levels_anew() -> None:
    out: list[PinSet] = []
    driver = PinDriver(out)
    driver.set("UO1", HIGH, 0)
    driver.release()
    assert driver.levels == {}
    driver.set("UO1", HIGH, 5)
    assert out == [PinSet(0, "UO1", HIGH), PinSet(5, "UO1", HIGH)]


def test_a_net_is_low_as_soon_as_one_open_collector_pulls_it() -> None:
    """GS-C200 datasheet, pin 14: RDY is an open collector, so that several may share a wire."""
    net = Net()
    assert net.level == HIGH
    assert not net.drive((0, "RDY"), HIGH)
    assert net.drive((1, "RDY"), LOW)
    assert not net.drive((0, "RDY"), LOW)
    assert not net.drive((1, "RDY"), HIGH)
    assert net.level == LOW
    assert net.drive((0, "RDY"), HIGH)
    assert net.level == HIGH


@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from([LOW, HIGH])), max_size=30))
def test_a_net_says_whether_it_changed(drives: list[tuple[int, int]]) -> None:
    net, levels, before = Net(), dict.fromkeys(range(4), HIGH), HIGH
    for driver, level in drives:
        levels[driver] = level
        after = min(levels.values())
        assert net.drive((driver, "X"), level) == (after != before)
        assert net.level == after
        before = after


def test_what_a_kind_of_pin_does_on_a_net() -> None:
    assert [kind for kind in PinKind if kind.drives] == [PinKind.OUTPUT, PinKind.OPEN_COLLECTOR, PinKind.WINDING]
    assert [kind for kind in PinKind if kind.reads] == [PinKind.INPUT, PinKind.STRAP]


def test_the_pins_of_the_module_have_the_numbers_of_the_datasheet() -> None:
    """GS-C200 datasheet, "Pin description": 38 pins, of which 18, 19, 21, 38 repeat others and 25, 29 are open."""
    numbers = [pin.number for pin in gsc200.PINS]
    assert sorted(numbers) == sorted(set(range(1, 39)) - {18, 19, 21, 25, 29, 38})
    named = {pin.name: pin for pin in gsc200.PINS}
    assert named["RDY"].kind is PinKind.OPEN_COLLECTOR
    assert {pin.name for pin in gsc200.PINS if pin.kind is PinKind.OUTPUT} == {
        "MOV", "RAMP", "DIR", "RESET", "CLOCK", "UO1", "UO2", "UO3"
    }  # fmt: skip
    assert {pin.name for pin in gsc200.PINS if pin.kind is PinKind.INPUT} == {
        "ENABLE", "HOME", "EOT", "UI1", "UI2", "UI3"
    }  # fmt: skip
