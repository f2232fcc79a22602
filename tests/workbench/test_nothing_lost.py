"""Nothing is lost: files are not written over unasked, and what is sent into a standing cell waits in the open."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from detent.workbench import filing
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.waiting import Waiting


def saved(folder: Path, *arguments: object) -> Any:
    live = Live()
    filing.offer(live, Folder(folder), Drafts(folder / "state", "cell"))
    return asyncio.run(live._calls["write_file"](*arguments))  # type: ignore[arg-type]


def test_a_file_of_another_text_is_never_written_over_unasked(tmp_path: Path) -> None:
    assert saved(tmp_path, "bar.gsc", "+1\n") == {"saved": "bar.gsc"}
    asked = saved(tmp_path, "bar.gsc", "+2\n")
    assert asked == {"asks": "bar.gsc is there already, with another text: replace it?"}
    assert (tmp_path / "bar.gsc").read_text() == "+1\n"
    assert saved(tmp_path, "bar.gsc", "+2\n", None, True) == {"saved": "bar.gsc"}


def test_ones_own_file_is_written_as_long_as_nobody_else_has_changed_it(tmp_path: Path) -> None:
    saved(tmp_path, "bar.gsc", "+1\n")
    assert saved(tmp_path, "bar.gsc", "+2\n", "+1\n") == {"saved": "bar.gsc"}
    (tmp_path / "bar.gsc").write_text("+3\n")  # by another program
    assert "changed by somebody else" in saved(tmp_path, "bar.gsc", "+4\n", "+2\n")["asks"]
    assert (tmp_path / "bar.gsc").read_text() == "+3\n"


class Bench:
    """A bench of one unit that keeps what it is sent."""

    def __init__(self, held: bool) -> None:
        self.state = SimpleNamespace(held=held, real=None)
        self.picture = SimpleNamespace(
            units={"bar": SimpleNamespace(line="bar")}, lines={"bar": SimpleNamespace(host=None)}
        )
        self.sent: list[object] = []
        self.changed: Callable[[], None] = lambda: None

    def on_change(self, callback: Callable[[], None]) -> None:
        self.changed = callback

    async def type(self, unit: str, text: str) -> None:
        await asyncio.sleep(0)  # it goes to another process
        if text == "BAD":
            raise RuntimeError("no command")
        self.sent.append((unit, text))

    async def send(self, line: str, data: bytes) -> None:
        self.sent.append(data)


def test_what_is_sent_while_the_cell_stands_waits_and_can_be_taken_back() -> None:
    async def scene() -> None:
        bench, live = Bench(held=True), Live()
        waiting = Waiting(bench, live)  # type: ignore[arg-type]
        await waiting.type("bar", "+100")
        await waiting.type("bar", "Z")
        await waiting.send("bar", b"V1\r")
        assert bench.sent == []
        assert live.get("queue") == [[1, "bar", "bar", "+100"], [2, "bar", "bar", "Z"], [3, "bar", None, "V1\r"]]
        waiting.withdraw(2)
        await waiting.out()
        assert bench.sent == [("bar", "+100"), b"V1\r"]
        assert live.get("queue") == []

    asyncio.run(scene())


def test_a_command_that_is_refused_on_its_way_out_does_not_take_the_others_along() -> None:
    async def scene() -> None:
        bench, live = Bench(held=True), Live()
        waiting = Waiting(bench, live)  # type: ignore[arg-type]
        await waiting.type("bar", "BAD")
        await waiting.type("bar", "+1")
        with pytest.raises(RuntimeError, match="no command"):
            await waiting.out()
        assert live.get("queue") == [[2, "bar", "bar", "+1"]]
        with pytest.raises(ValueError, match="no line 'foo'"):
            await waiting.send("foo", b"x")

    asyncio.run(scene())


@pytest.mark.parametrize("text", ["\u20ac", "V1\rV1", "\xb0"])
def test_what_no_line_can_carry_is_refused_before_it_waits(text: str) -> None:
    waiting = Waiting(Bench(held=True), Live())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="printable ASCII"):
        asyncio.run(waiting.type("bar", text))


def test_while_time_goes_everything_is_sent_at_once() -> None:
    bench = Bench(held=False)
    asyncio.run(Waiting(bench, Live()).type("bar", "+1"))  # type: ignore[arg-type]
    assert bench.sent == [("bar", "+1")]


def test_what_waits_is_sent_once_however_often_time_is_told_to_go_on() -> None:
    async def scene() -> None:
        bench, live = Bench(held=True), Live()
        waiting = Waiting(bench, live)  # type: ignore[arg-type]
        for text in ("+1", "+2", "+3"):
            await waiting.type("bar", text)
        await asyncio.gather(waiting.out(), waiting.out(), waiting.out())
        assert bench.sent == [("bar", "+1"), ("bar", "+2"), ("bar", "+3")]

    asyncio.run(scene())


def test_what_comes_to_wait_while_time_is_told_to_go_on_goes_out_as_soon_as_it_does() -> None:
    async def scene() -> None:
        bench, live = Bench(held=True), Live()
        waiting = Waiting(bench, live)  # type: ignore[arg-type]
        await waiting.out()  # the first half of a go
        await waiting.type("bar", "BAD")
        await waiting.type("bar", "+1")
        bench.state.held = False  # the second, or a run to the cursor
        bench.changed()
        bench.changed()
        while not bench.sent:
            await asyncio.sleep(0)
        assert live.get("queue") == []
        assert bench.sent == [("bar", "+1")]
        assert live.get("turneddown") == "BAD: no command"

    asyncio.run(scene())
