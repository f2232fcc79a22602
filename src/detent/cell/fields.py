"""What the keys of a cell file take: names, numbers within bounds, levels, times; and how strict its tables are."""

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field

from detent.pins import HIGH, LOW, Level
from detent.ticks import Ns, parse_duration

MOST_STEPS = 10**15  # farther from 0 no axis stands, and no number of any other meaning is greater
LONGEST_NAME = 64


class KeyFault(ValueError):
    """What is wrong with one key of a table, found when the whole table is looked at."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


def _level(value: object) -> Level:
    levels: dict[object, Level] = {"0": LOW, "low": LOW, "1": HIGH, "high": HIGH}
    text = str(value).strip().lower()
    if isinstance(value, bool) or text not in levels:
        raise ValueError("a level is 0, 1, low or high")
    return levels[text]


def _duration(value: object) -> Ns:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError("write a time like 1.5 (seconds) or '400 us'")
    return parse_duration(value)


def _no_flag(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("true and false are no numbers")
    return value


def _list(value: object) -> object:
    return [value] if isinstance(value, str) else value


def _name(value: str) -> str:
    if not value.strip() or value != value.strip() or not value.isprintable() or len(value) > LONGEST_NAME:
        raise ValueError(f"a name is 1 to {LONGEST_NAME} characters, without blanks around them: choose another")
    wrong = next((sign for sign in value if sign in ".:=/"), None)
    if wrong is not None:
        raise ValueError(
            f"{wrong!r} in a name would part it where UNIT.PIN, UNIT:LINE or UNIT=FILE is written; leave it out"
        )
    return value


Name = Annotated[str, AfterValidator(_name)]
NoFlag = BeforeValidator(_no_flag)
"""Of a number: `true` is none, though Python takes it for 1."""
Steps = Annotated[int, NoFlag, Field(ge=-MOST_STEPS, le=MOST_STEPS)]
Number = Annotated[float, NoFlag, Field(ge=-MOST_STEPS, le=MOST_STEPS)]
Flag = Annotated[bool, Field(strict=True)]
LevelField = Annotated[Level, BeforeValidator(_level)]
DurationField = Annotated[Ns, BeforeValidator(_duration)]
Names = Annotated[list[str], BeforeValidator(_list)]


STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
"""A table of a cell file: no other keys, nothing changes, every number is finite."""
