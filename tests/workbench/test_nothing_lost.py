"""Nothing is lost: files are not written over unasked, and what is sent into a standing cell waits in the open."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.patience import PATIENCE

from detent.workbench import filing
from detent.workbench.client import Bench, BenchError
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.messages import State
from detent.workbench.waiting import MOST, Waiting, Waits
from detent.workbench.words import check_typed


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


def waiting(*lines: str) -> Waiting:
    found = Waiting()
    for text in lines:
        found.put("bar", "bar", text)
    return found


def texts(queue: Waiting) -> list[str]:
    return [one.text for one in queue.queue]


def test_what_waits_can_be_taken_back() -> None:
    queue = waiting("+100", "Z")
    queue.put("drill", None, "V1\r")
    queue.put("bar", "bar", "C1")
    assert [tuple(one) for one in queue.queue[1:3]] == [(2, "bar", "bar", "Z"), (3, "drill", None, "V1\r")]
    queue.withdraw(2)
    assert texts(queue) == ["+100", "V1\r", "C1"]
    queue.drop("bar")
    assert texts(queue) == ["V1\r"]
    queue.withdraw(None)
    assert texts(queue) == []


def test_a_command_that_is_refused_on_its_way_out_does_not_take_the_others_along() -> None:
    queue, sent = waiting("BAD", "+1", "+2"), list[str]()

    def send(one: Waits) -> None:
        if one.text == "BAD":
            raise ValueError("no command")
        sent.append(one.text)

    with pytest.raises(ValueError, match="no command"):
        queue.out(send)
    assert texts(queue) == ["+1", "+2"]
    queue.out(send)
    queue.out(send)
    assert sent == ["+1", "+2"], "once, however often time is told to go on"


def test_a_queue_has_a_bound_and_goes_on_with_its_numbers_in_another_engine() -> None:
    queue = waiting(*(["V1"] * MOST))
    with pytest.raises(ValueError, match="1000 commands wait already"):
        queue.put("bar", "bar", "V1")
    queue.withdraw(5)
    again = Waiting(queue.queue)
    again.put("bar", "bar", "V2")
    assert again.queue[-1].number == MOST + 1


@pytest.mark.parametrize("text", ["\u20ac", "V1\rV1", "\xb0"])
def test_what_no_line_can_carry_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="printable ASCII"):
        check_typed(text)


def position(state: State) -> int:
    return state.units["gs-c200s"].axes[""].position


def test_what_a_window_sends_into_a_standing_cell_is_checked_before_it_waits() -> None:
    async def scene() -> None:
        bench = await Bench.open("gs-c200s", straps=("CHS=low",), held=True)
        try:
            for refused, error in (
                (bench.queue_send("foo", b"x"), "no line 'foo'"),
                (bench.queue_type("foo", "V1"), "foo"),
            ):
                with pytest.raises(BenchError, match=error):
                    await refused
            await bench.queue_type("gs-c200s", "+1")
            assert [one.text for one in bench.state.queue] == ["+1"]
            await bench.step_event()
            assert bench.state.queue == ()
            await bench.go()
            await bench.until(lambda state: state.units["gs-c200s"].state == "ready" and position(state) == 1)
            await bench.queue_type("gs-c200s", "+2")
            assert bench.state.queue == (), "while time goes everything is sent at once"
            await bench.until(lambda state: position(state) == 3)
        finally:
            await bench.close()

    asyncio.run(asyncio.wait_for(scene(), PATIENCE))
