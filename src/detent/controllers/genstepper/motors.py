"""The motors with which the manual's boards were tested, and how they were wired (pages 77 to 82)."""

from typing import NamedTuple


class Example(NamedTuple):
    """One motor: its number in the Jameco catalogue, ratings, and the leads at pins 1 to 6 of its connector.

    The pins are common B (or nothing), WB2, WB1, WA2, WA1, common A (or nothing); "" where no lead goes.
    """

    number: str
    volts: float
    amperes: float
    degrees: float | None  # of a full step
    unipolar: bool
    leads: tuple[str, str, str, str, str, str]
    remark: str = ""


EXAMPLES = (
    Example("105873", 12, 0.15, 3.6, True, ("Black", "Brown", "Red", "Green", "White", "")),
    Example("151861", 5, 0.55, 7.5, True, ("Green", "Black", "Brown", "Yellow", "Orange", "Red"), "does not microstep"),
    Example("155432", 12, 0.4, 1.8, True, ("White", "Brown", "Yellow", "Red", "Blue", "Black"), "2000 g cm"),
    Example("162026", 12, 0.6, 1.8, True, ("Black", "Orange", "Green", "Yellow", "Blue", "White"), "6000 g cm"),
    Example("169201", 24, 0.3, 1.8, True, ("Black", "Peach", "Violet", "Yellow", "Red", "White")),
    Example("173180", 12, 0.06, 0.09, True, ("Red", "Orange", "Pink", "Yellow", "Blue", ""), "geared; 400 g cm"),
    Example("174553", 12, 0.6, 7.5, True, ("Black", "Brown", "Red", "Green", "Yellow", "Orange")),
    Example("117954", 5, 0.8, 7.5, False, ("", "Yellow", "Black", "Red", "Gray", ""), "does not microstep"),
    Example("155459", 12, 0.4, 1.8, False, ("", "Brown", "Orange", "Yellow", "Red", ""), "2100 g cm"),
    Example("163395", 8.4, 0.28, 0.9, False, ("", "Yellow", "White", "Blue", "Red", "")),
    Example("168831", 12, 1.25, None, False, ("", "White Brown", "Brown White", "Yellow", "Yellow", ""),
            "double current only: more than the board's ampere"),
)  # fmt: skip
PINS = ("common B", "WB2", "WB1", "WA2", "WA1", "common A")


def example(number: str) -> Example | None:
    """The motor of that number, None if the manual has none."""
    return next((found for found in EXAMPLES if found.number == number), None)
