"""The commands by what is typed of them."""

import pytest

from detent.controllers.catalogue import MODELS
from detent.workbench.words import words


@pytest.mark.parametrize("model", MODELS)
def test_every_row_of_the_table_is_found_by_what_is_typed_but_parts_of_numbers(model: str) -> None:
    found = [row for word in words(model) for row in word.rows]
    missing = [row for row in MODELS[model].commands() if row not in found]
    assert all(row.type == "number" for row in missing)


@pytest.mark.parametrize("model", MODELS)
def test_the_longest_comes_first_as_the_longest_that_fits_counts(model: str) -> None:
    lengths = [len(word.spelling) for word in words(model)]
    assert lengths == sorted(lengths, reverse=True)
    assert len({word.spelling for word in words(model)}) == len(lengths)


def test_one_letter_of_a_gsc200_stands_for_two_commands() -> None:
    """Datasheet, command description: Gxxxxxxx is a goto, Gs and Gsx move on in a direction."""
    (goto,) = (word for word in words("gs-c200") if word.spelling == "G")
    assert [row.command for row in goto.rows] == ["Gxxxxxxx", "Gs Gsx"]


def test_a_jump_of_a_gsc200s_is_known_by_either_case() -> None:
    spellings = {word.spelling for word in words("gs-c200s")}
    assert {"j", "J", "jc", "Jc", "Po", "P0", "Px"} <= spellings


def test_genstepper_takes_either_case_and_a_dcb274_does_not() -> None:
    """BS0610 manual, page 24: commands are one character, upper or lower case; B and b of a DCB-274 differ."""
    assert {"k", "K"} <= {word.spelling for word in words("bs0610")}
    by_letter = {word.spelling: word.rows[0].what for word in words("dcb-274")}
    assert by_letter["B"] != by_letter["b"]


def test_the_words_of_a_supersigma_are_whole() -> None:
    assert all(word.whole for word in words("supersigma"))
