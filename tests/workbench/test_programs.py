"""What the editor is told: errors with their place, addresses, memory, the way back from an image."""

import pytest

from detent.controllers import catalogue
from detent.workbench.programs import Program

SOURCE = "S10       ; slow\nL0\n+500\nL3\n"


def test_lines_have_addresses_and_bytes() -> None:
    checked = Program("gs-c200").check(SOURCE)
    assert checked.errors == ()
    assert [(line, place.address, len(place.code)) for line, place in checked.places.items()] == [
        (1, 0, 4), (2, 4, 2), (3, 6, 4), (4, 10, 2),
    ]  # fmt: skip
    assert (checked.used, checked.capacity) == (12, 119)
    assert checked.line_at(6) == 3
    assert checked.line_at(7) is None


def test_errors_have_a_place_and_a_remedy_and_leave_the_rest_its_addresses() -> None:
    checked = Program("gs-c200").check("S10\nY9\n+500\n")
    (wrong,) = checked.errors
    assert (wrong.line, wrong.column, wrong.length) == (2, 1, 2)
    assert wrong.message
    assert [place.address for place in checked.places.values()] == [0, 4]
    assert checked.image == b""


def test_an_image_comes_back_as_source_and_is_compared() -> None:
    program = Program("gs-c200")
    checked = program.check(SOURCE)
    again = program.check(program.disassemble(checked.image))
    assert again.image == checked.image
    assert program.listed(checked.image)[2] == (6, "+500")
    assert program.differences(SOURCE, checked.image) == []
    assert program.differences(SOURCE.replace("+500", "+600"), checked.image) == [3]
    assert program.differences(SOURCE, checked.image[:6]) == [3, 4]
    with pytest.raises(ValueError, match="line 1"):
        program.differences("foo\n", checked.image)


@pytest.mark.parametrize("model", catalogue.MODELS)
def test_every_model_has_its_commands(model: str) -> None:
    program = Program(model)
    assert all(word.command and word.what for word in program.words)
    if program.language is None:
        with pytest.raises(ValueError, match="holds no programs"):
            program.check("")
    else:
        assert program.check("").errors == ()
        assert program.capacity > 0
