"""The calls of the Program page."""

import asyncio
import threading
from collections.abc import Awaitable, Callable, Iterable
from types import SimpleNamespace
from typing import Any, TypeVar

import pytest

from detent.workbench import programs
from detent.workbench.editing import Editing
from detent.workbench.live import Live
from detent.workbench.programs import Program

T = TypeVar("T")
SOURCE = "again: W1 ; wait\n+250\nU1\n"


class Bench:
    """Two units, one with program memory."""

    def __init__(self) -> None:
        picture = {"bar": ("gs-c200", True), "board": ("bs0610", False)}
        self.picture = SimpleNamespace(units={
            name: SimpleNamespace(model=model, title=model, capacity=119 if language else 0, nonvolatile=language,
                                  file="", line=name)
            for name, (model, language) in picture.items()
        })  # fmt: skip
        self.sources: dict[str, str] = {}
        self.memory, self.kept, self.reads = b"", b"", 0
        self.done: list[tuple[object, ...]] = []
        self.callbacks: list[Callable[[], None]] = []
        self.look()

    def look(self) -> None:
        state = SimpleNamespace(powered=True, memory=hash(self.memory))
        self.state = SimpleNamespace(units={"bar": state, "board": state}, breakpoints={"bar": frozenset({6, 2})})

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        self.callbacks.append(callback)
        return lambda: None

    def program(self, unit: str) -> Program:
        return Program(self.picture.units[unit].model)

    async def load(self, unit: str, image: bytes, base: int) -> None:
        self.done.append(("load", unit, image, base))
        self.memory = image
        self.look()

    async def start(self, unit: str) -> None:
        self.done.append(("start", unit))

    async def read_back(self, unit: str, *, kept: bool = False) -> bytes:
        self.reads += 1
        return self.kept if kept else self.memory

    async def set_breakpoints(self, unit: str, addresses: Iterable[int]) -> None:
        self.done.append(("breaks", unit, *addresses))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def editing(bench: Bench) -> Editing:
    return Editing(bench, Live())  # type: ignore[arg-type]


def run(call: Awaitable[T]) -> T:
    async def wait() -> T:
        return await call

    return asyncio.run(wait())


def test_a_unit_is_told_with_its_commands_from_the_table(editing: Editing) -> None:
    about: dict[str, Any] = run(editing.about("bar"))
    assert (about["language"], about["capacity"], about["comment"]) == (True, 119, ";")
    (wait,) = (word for word in about["words"] if word["spelling"] == "W")
    assert (wait["rows"][0]["bytes"], wait["rows"][0]["section"]) == (2, "command description, Wx")


def test_a_unit_without_programs_says_so(editing: Editing) -> None:
    about: dict[str, Any] = run(editing.about("board"))
    assert about["language"] is False
    assert {"K", "R", "P"} <= {word["spelling"] for word in about["words"]}


def test_without_a_source_the_text_is_what_memory_holds(editing: Editing, bench: Bench) -> None:
    bench.memory = bench.program("bar").check(SOURCE).image
    assert run(editing.about("bar"))["source"] == "W1\n+250\nU1\n"


def test_a_text_is_checked_with_addresses_labels_and_memory_use(editing: Editing) -> None:
    found = run(editing.check("bar", SOURCE))
    assert found["places"] == [(1, 0, 2), (2, 2, 4), (3, 6, 2)]  # W1, +250 and U1 take 2, 4 and 2 bytes
    assert found["labels"] == {"again": 0}
    assert (found["used"], found["capacity"], found["errors"], found["loaded"]) == (8, 119, [], False)


def test_errors_are_told_with_their_place_while_the_rest_keeps_its_addresses(editing: Editing) -> None:
    found: dict[str, Any] = run(editing.check("bar", "W1\nT10000\n+250\n"))
    (error,) = found["errors"]
    assert error[:3] == (2, 2, 5)
    assert "1 to 1000" in error[3]
    assert [place[0] for place in found["places"]] == [1, 3]


def test_what_was_loaded_is_known_to_be_in_memory(editing: Editing, bench: Bench) -> None:
    assert run(editing.load("bar", SOURCE, True)) == "8 bytes loaded, and started"
    assert [action[0] for action in bench.done] == ["load", "start"]
    assert run(editing.check("bar", SOURCE))["loaded"] is True
    assert run(editing.check("bar", SOURCE + "A1\n"))["loaded"] is False


def test_memory_is_read_again_only_when_it_has_changed(editing: Editing, bench: Bench) -> None:
    run(editing.load("bar", SOURCE, False))
    for _ in range(5):
        run(editing.check("bar", SOURCE))
    assert bench.reads == 1


def test_a_text_with_errors_is_not_loaded(editing: Editing, bench: Bench) -> None:
    with pytest.raises(ValueError, match="line 2"):
        run(editing.load("bar", "W1\nT10000\nW9\n", True))
    assert bench.done == []


def test_compare_tells_the_lines_that_differ(editing: Editing, bench: Bench) -> None:
    run(editing.load("bar", SOURCE, False))
    assert run(editing.compare("bar", SOURCE, False))["same"] is True
    changed = run(editing.compare("bar", SOURCE.replace("250", "251"), False))
    assert (changed["lines"], changed["same"]) == ([2], False)
    shorter = run(editing.compare("bar", "W1\n", False))
    assert (shorter["lines"], shorter["same"]) == ([], False)
    assert "more" in str(shorter["words"])
    assert "empty" in str(run(editing.compare("bar", SOURCE, True))["words"])


def test_nothing_to_read_back_is_an_error(editing: Editing) -> None:
    with pytest.raises(ValueError, match="no program"):
        run(editing.fetch("bar", False))


def test_breakpoints_are_shown_to_all_windows(bench: Bench) -> None:
    live = Live()
    Editing(bench, live)  # type: ignore[arg-type]
    assert live.get("u.bar.breaks") == [2, 6]
    assert live.get("u.board.breaks") == []


def test_an_unknown_unit_is_an_error_in_words(editing: Editing) -> None:
    with pytest.raises(ValueError, match="no unit 'bra'"):
        run(editing.check("bra", ""))


def test_no_text_is_assembled_on_the_loop_of_the_pages(
    editing: Editing, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = set()

    def watched(*given: Any) -> Any:
        threads.add(threading.get_ident())
        return assemble(*given)

    assemble = programs.assemble
    monkeypatch.setattr(programs, "assemble", watched)
    run(editing.check("bar", SOURCE))
    run(editing.load("bar", SOURCE, False))
    run(editing.compare("bar", SOURCE, False))
    assert threads
    assert threading.get_ident() not in threads
