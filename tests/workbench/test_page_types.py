"""The types by which the scripts are checked are those by which the server checks and answers calls."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypedDict

import pytest
from pydantic import Field
from tests.workbench.page_types import FILE, Types, text


class Found(TypedDict, total=False):
    """What was found."""

    rows: Sequence[tuple[int, str]]


class Bare(NamedTuple):
    number: int


def test_the_types_of_the_calls_are_as_they_were_made() -> None:
    assert FILE.read_text() == text(), "write them anew: python -m tests.workbench.page_types"


@pytest.mark.parametrize(
    ("kind", "spelled"),
    [
        (Annotated[str, Field(max_length=3)], "string"),
        (float | None, "number | null"),
        (list[str | None], "(string | null)[]"),
        (Mapping[str, Sequence[int]], "Record<string, number[]>"),
        (tuple[str, float], "[string, number]"),
        (Literal["jog", "go"], '"jog" | "go"'),
        (Found, "Found"),
    ],
)
def test_a_type_as_the_scripts_know_it(kind: Any, spelled: str) -> None:
    kinds = Types()
    assert kinds.of(kind) == spelled
    if kind is Found:
        assert (
            kinds.interfaces["Found"] == "/** What was found. */\ninterface Found {\n  rows?: [number, string][];\n}\n"
        )


@pytest.mark.parametrize("kind", [bytes, Bare, set[int]])
def test_an_answer_that_says_nothing_of_its_keys_is_refused(kind: Any) -> None:
    with pytest.raises(TypeError, match="does not go to a window"):
        Types().of(kind)
