"""Names that somebody may have meant: never the other end of an axis, and all that are equally near."""

import pytest

from detent.controllers import catalogue
from detent.nearest import did_you_mean, nearest

BOARD = [pin.name for pin in catalogue.MODELS["bs0710"].pins]


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("drilling", ["drill", "damping"], "did you mean drill? "),
        ("ui1", ["UI1", "UI2"], "did you mean UI1? "),
        ("UI4", ["UI1", "UI2", "UI3"], "did you mean UI1, UI2 or UI3? "),
        ("LIMIT-C", ["LIMIT-A", "LIMIT-B", "HOME"], "did you mean LIMIT-A or LIMIT-B? "),
        ("EOTT", ["EOT", "HOME"], "did you mean EOT? "),
        ("zzz", ["EOT", "HOME"], ""),
        ("EOT", [], ""),
        ("LX+", ["LX-", "RDY"], "did you mean LX-? "),
    ],
)
def test_all_that_are_equally_near_are_named(name, known, meant):
    assert did_you_mean(name, known) == meant


@pytest.mark.parametrize(
    "name", [*(pin[:-1] for pin in BOARD if pin[-1] in "+-"), "XL+", "L-", "Z+", "LZ-", "Y+-", "LX--"]
)
def test_no_end_of_an_axis_is_proposed_where_the_other_is_there(name):
    assert not [found for found in nearest(name, BOARD) if found[-1] in "+-"]


def test_whatever_is_mistyped_of_a_pin_the_other_end_is_not_proposed():
    for pin in BOARD:
        for place in range(len(pin)):
            for letter in ("", "X", "-", "+", pin[place] * 2):
                wrong = pin[:place] + letter + pin[place + 1 :]
                if wrong not in BOARD and wrong.lower() not in (known.lower() for known in BOARD):
                    assert not [found for found in nearest(wrong, BOARD) if found[-1] in "+-"], wrong


@pytest.mark.parametrize("pin", ["lx-", "Lx-"])
def test_another_case_of_a_name_is_that_name(pin):
    assert nearest(pin, BOARD) == ["LX-"]
