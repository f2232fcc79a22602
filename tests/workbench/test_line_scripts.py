"""Scripts for a line: what is sent when, and what is said about it."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from detent.ticks import MS, SECOND
from detent.workbench.line_scripts import Answered, Command, LineScripts, Pause, parse
from detent.workbench.live import Live


def test_a_script_is_commands_pauses_and_waiting_for_answers() -> None:
    text = "; two moves\n+200\n\n@ 500 ms ; rest\n@0.5\n  -200 ; back\n@ answer\n"
    assert parse(text) == [
        Command(2, "+200"), Pause(4, 500 * MS), Pause(5, SECOND // 2), Command(6, "-200"), Answered(7),
    ]  # fmt: skip


@pytest.mark.parametrize("line", ["@", "@ soon", "@ 5 miles"])
def test_a_pause_that_is_none_is_said_with_its_line_and_the_remedy(line: str) -> None:
    with pytest.raises(ValueError, match=r"line 2: .* @ 500 ms"):
        parse(f"+1\n{line}\n")


class Bench:
    """As much of a bench as a script needs: time goes on by a quarter second whenever somebody waits for it."""

    def __init__(self) -> None:
        self.units = {"bar": SimpleNamespace(error=None)}
        self.state = SimpleNamespace(now=0, held=False, past=False, speaking={"bar": 0}, units=self.units, real=None)
        self.picture = SimpleNamespace(lines={"bar": SimpleNamespace(units=("bar",))})
        self.sent: list[tuple[int, str]] = []
        self.answers: list[Any] = []
        self.slow = 0
        self.alarms: dict[str, int] = {}
        self.back = 0  # to where time goes back when it has come to 10 s

    async def type(self, unit: str, text: str) -> None:
        if text == "BAD":
            raise RuntimeError("bar has no supply")
        if text == "T9999":
            self.units["bar"].error = SimpleNamespace(at=self.state.now, frame=text, reason="T takes 1 to 1000")
        self.sent.append((self.state.now, text))
        self.state.now += self.slow

    async def until(self, condition: Callable[[Any], bool]) -> None:
        while not condition(self.state):
            self.state.now += SECOND // 4
            if self.back and self.state.now >= 10 * SECOND:
                self.state.now, self.back = self.back, 0
            if self.sent and self.state.now == self.sent[-1][0] + SECOND:
                self.answers.append(SimpleNamespace(whole=True, sender="bar", end=self.state.now))
            await asyncio.sleep(0)

    async def alarm(self, who: str, at: int | None) -> None:
        if at is None:
            self.alarms.pop(who, None)
        else:
            self.alarms[who] = at

    def terminal(self, line: str) -> Any:
        return SimpleNamespace(rows=self.answers[-2:])  # what is older is not kept


def run(text: str, then: Callable[[LineScripts], None] = lambda scripts: None) -> tuple[Bench, Live]:
    """A script run to its end; `then` is called once it has begun."""
    bench, live = Bench(), Live()

    async def whole() -> None:
        scripts = LineScripts(bench, live)  # type: ignore[arg-type]
        scripts.start("bar", "bar", text)
        await asyncio.sleep(0)
        then(scripts)
        while live.get("script.bar")["running"]:  # type: ignore[index,call-overload]
            await asyncio.sleep(0)

    asyncio.run(whole())
    return bench, live


def test_commands_go_out_in_order_with_pauses_in_the_time_of_the_cell() -> None:
    bench, live = run("+1\n+2\n@ 1.5\n+3\n")
    assert bench.sent == [(0, "+1"), (SECOND // 4, "+2"), (7 * SECOND // 4, "+3")]  # the first is heard out
    assert live.get("script.bar") == {"running": False, "line": 0, "told": "done"}


def test_a_script_can_wait_for_the_answer_to_its_last_command() -> None:
    bench, _ = run("+1\n@ answer\n+2\n@ answer\n+3\n")
    assert bench.sent == [(0, "+1"), (SECOND, "+2"), (2 * SECOND, "+3")]


def test_answers_are_waited_for_however_many_there_were() -> None:
    """Rows of a line are kept up to a number: that of the answers among them does not grow for ever."""
    bench, live = run("+1\n@ answer\n" * 10)
    assert [at for at, _ in bench.sent] == [n * SECOND for n in range(10)]
    assert live.get("script.bar") == {"running": False, "line": 0, "told": "done"}


def test_a_script_goes_on_where_time_has_gone_back() -> None:
    """As much of a pause is left as there was, and an interval is counted from there."""

    def rewinds(scripts: LineScripts) -> None:
        scripts._bench.back = 2 * SECOND  # type: ignore[attr-defined]

    bench, _ = run("+1\n@ 20\n+2\n@ answer\n+3\n", rewinds)
    assert [at for at, _ in bench.sent][1:] == [
        25 * SECOND // 2,
        27 * SECOND // 2,
    ]  # 20.25 s, from 9.75 s on 7.75 s earlier

    bench = Bench()

    async def whole() -> None:
        scripts = LineScripts(bench, Live())  # type: ignore[arg-type]
        bench.back = 2 * SECOND
        scripts.repeat("bar", "bar", "F", SECOND)
        while len(bench.sent) < 15:
            await asyncio.sleep(0)
        scripts.stop("bar")

    asyncio.run(whole())
    times = [at for at, _ in bench.sent]
    assert times == [*(n * SECOND for n in range(10)), *(n * SECOND + SECOND // 4 for n in range(2, 7))]


def test_a_script_that_waits_says_until_when_and_leaves_nothing_of_that() -> None:
    """At max, time comes to an instant only if something is due then."""
    bench, _ = run("+1\n@ 1.5\n+2\n", lambda scripts: scripts.stop("bar"))
    assert bench.alarms == {}
    seen: list[int | None] = []

    def listens(scripts: LineScripts) -> None:
        before = scripts._bench.alarm

        async def alarm(who: str, at: int | None) -> None:
            seen.append(at)
            await before(who, at)

        scripts._bench.alarm = alarm  # type: ignore[method-assign]

    bench, _ = run("+1\n@ 1.5\n", listens)
    assert seen[-2:] == [7 * SECOND // 4, None]
    assert bench.alarms == {}


def test_a_command_that_cannot_be_sent_ends_the_script_and_says_where() -> None:
    bench, live = run("+1\nBAD\n+2\n")
    assert [text for _, text in bench.sent] == ["+1"]
    assert live.get("script.bar") == {"running": False, "line": 2, "told": "line 2: bar has no supply"}


def test_a_script_stops_at_a_refusal_and_says_what_was_refused() -> None:
    bench, live = run("+1\nT9999\n+2\n")
    assert [text for _, text in bench.sent] == ["+1", "T9999"]
    told = "line 2: bar refused T9999: T takes 1 to 1000"
    assert live.get("script.bar") == {"running": False, "line": 2, "told": told}


def test_a_command_is_repeated_at_an_interval_until_it_is_stopped() -> None:
    bench, live = Bench(), Live()

    async def whole() -> None:
        scripts = LineScripts(bench, live)  # type: ignore[arg-type]
        scripts.start("bar", "bar", "V1\n@ 1\n@ again")
        while len(bench.sent) < 3:
            await asyncio.sleep(0)
        scripts.stop("bar")

    asyncio.run(whole())
    assert bench.sent[:3] == [(0, "V1"), (5 * SECOND // 4, "V1"), (9 * SECOND // 4, "V1")]


def test_a_repeated_command_keeps_its_interval_however_long_each_takes() -> None:
    bench = Bench()

    async def whole() -> None:
        scripts = LineScripts(bench, Live())  # type: ignore[arg-type]
        bench.slow = SECOND // 4  # what a command takes, with its answer
        scripts.repeat("bar", "bar", "F", SECOND)
        while len(bench.sent) < 8:
            await asyncio.sleep(0)
        scripts.stop("bar")
        with pytest.raises(ValueError, match="at the most"):
            scripts.repeat("bar", "bar", "F", 0)

    asyncio.run(whole())
    assert [at for at, _ in bench.sent] == [n * SECOND for n in range(8)]


def test_a_script_without_a_pause_is_not_begun_anew() -> None:
    with pytest.raises(ValueError, match="line 2: @ again needs a pause"):
        parse("V1\n@ again")


def test_a_script_that_is_stopped_sends_no_more() -> None:
    bench, live = run("+1\n@ 1000\n+2\n", lambda scripts: scripts.stop("bar"))
    assert [text for _, text in bench.sent] == ["+1"]
    assert live.get("script.bar") == {"running": False, "line": 0, "told": "stopped"}


def test_a_script_needs_something_to_send_and_a_unit_on_the_line() -> None:
    scripts = LineScripts(Bench(), Live())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="nothing to send"):
        scripts.start("bar", "bar", "; nothing\n")
    with pytest.raises(ValueError, match="drill is not on line bar"):
        scripts.start("bar", "drill", "+1")
    with pytest.raises(KeyError):
        scripts.start("foo", "bar", "+1")
