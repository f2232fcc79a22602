import select
import threading
import tracemalloc
from collections.abc import Sequence
from fractions import Fraction

import pytest
from tests.realtime.ticking import LOOK, UNREAL, Client, TickingCell, Wall, look

from detent.realtime.loop import LONGEST, LOOKS, Loop
from detent.realtime.pace import Pace
from detent.ticks import MS, SECOND, US

DAY = 24 * 3600 * SECOND


class Ready(Wall):
    """A wall clock on which every wait ends at once, with `readable` to read."""

    def __init__(self, *readable: int) -> None:
        super().__init__()
        self.readable = list(readable)
        self.asked: list[float | None] = []

    def wait(
        self, readers: Sequence[int], writers: Sequence[int], _: Sequence[int], seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        self.asked.append(seconds)
        return [descriptor for descriptor in self.readable if descriptor in readers], [], []


@pytest.mark.parametrize("factor", [Fraction(1), Fraction(1, 3), Fraction(73, 10)])
def test_in_a_day_no_deadline_is_missed_and_the_clock_does_not_drift(factor: Fraction) -> None:
    wall, cell, client = Wall(), TickingCell(2 * SECOND), Client()
    began = wall.now
    pace = Pace(factor, clock=wall)
    loop = Loop(cell, pace, [(0, client)], wait=wall.wait)
    while cell.now < DAY:
        loop.step()
    loop.close()
    assert cell.now == (wall.now - began) * factor.numerator // factor.denominator
    assert cell.ticks == cell.now // (2 * SECOND) == client.heard == pace.lateness.count
    assert pace.lateness.most <= 200 * US + LOOK


def test_a_day_takes_no_memory() -> None:
    wall, cell, client = Wall(), TickingCell(20 * SECOND), Client()
    loop = Loop(cell, Pace(clock=wall), [(0, client)], wait=wall.wait)

    def run_to(end: int) -> int:
        while cell.now < end:
            loop.step()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        after_an_hour = run_to(DAY // 24)
        assert run_to(DAY) - after_an_hour < 2_000
    finally:
        tracemalloc.stop()
    loop.close()


def test_what_a_client_sends_reaches_the_line_at_the_present_and_is_answered_in_the_same_step() -> None:
    wall, cell, client = Ready(UNREAL), TickingCell(None), Client()
    loop = Loop(cell, Pace(3, clock=wall), [(0, client)], wait=wall.wait)
    wall.now += 1_000
    client.inbox.append(b"F\r")
    loop.step()
    loop.close()
    assert cell.sent == [(3_000, 0, b"F\r")]
    assert client.outbox == b"F\r"


def test_a_deadline_comes_before_the_bytes_that_arrive_after_it() -> None:
    wall, cell, client = Ready(UNREAL), TickingCell(MS), Client()
    loop = Loop(cell, Pace(clock=wall), [(0, client)], wait=wall.wait)
    wall.now += MS + 1
    client.inbox.append(b"x")
    loop.step()
    loop.close()
    assert client.outbox == b"tx"


def test_every_endpoint_of_a_line_hears_it_and_no_other_does() -> None:
    wall, cell = Ready(UNREAL), TickingCell(None, lines=2)
    talking, beside, elsewhere = Client(UNREAL), Client(UNREAL + 1), Client(UNREAL + 2)
    loop = Loop(cell, Pace(clock=wall), [(1, talking), (1, beside), (0, elsewhere)], wait=wall.wait)
    talking.inbox.append(b"V1\r")
    loop.step()
    loop.close()
    assert (talking.outbox, beside.outbox, elsewhere.outbox) == (b"V1\r", b"V1\r", b"")


def test_bytes_of_eight_bits_pass_as_they_are() -> None:
    wall, cell, client = Ready(UNREAL), TickingCell(None), Client()
    loop = Loop(cell, Pace(clock=wall), [(0, client)], wait=wall.wait)
    client.inbox.append(b"\x80\xff\x00")
    loop.step()
    loop.close()
    assert cell.got() == client.outbox == b"\x80\xff\x00"


def test_a_client_waits_while_its_line_is_too_far_behind() -> None:
    wall, cell, client = Ready(), TickingCell(None), Client()
    loop = Loop(cell, Pace(clock=wall), [(0, client)], patience=[100], wait=wall.wait)
    for busy_until in (100, 101, 0):
        cell.lines[0].host_busy_until = busy_until
        loop.step()
    loop.close()
    assert client.rooms == [True, False, True]


def test_a_loop_without_deadlines_sleeps_until_somebody_says_something() -> None:
    wall, cell = Ready(), TickingCell(None)
    loop = Loop(cell, Pace(clock=wall), [(0, Client())], wait=wall.wait)
    loop.step()
    loop.close()
    assert wall.asked == [None]


def test_the_sleep_ends_a_little_before_the_deadline_and_the_rest_is_watched() -> None:
    wall, cell = Ready(), TickingCell(MS)
    loop = Loop(cell, Pace(clock=wall), [(0, Client())], wait=wall.wait)
    loop.step()
    wall.now += MS - 1
    loop.step()
    loop.close()
    assert wall.asked[0] == pytest.approx(940e-6, abs=1e-9)
    assert set(wall.asked[1:]) == {0.0}
    assert cell.ticks == 0


def test_near_a_deadline_it_looks_until_that_comes_and_serves_it_in_the_same_step() -> None:
    wall, cell = Ready(), TickingCell(MS)

    def looking(
        reading: Sequence[int], writing: Sequence[int], _: Sequence[int], seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        wall.now += 5 * US
        return wall.wait(reading, writing, _, seconds)

    loop = Loop(cell, Pace(clock=wall), [(0, Client())], wait=looking)
    wall.now += MS - 40 * US
    loop.step()
    assert cell.ticks == 1
    assert len(wall.asked) == 8
    loop.close()


def test_a_clock_that_stands_near_a_deadline_keeps_nobody_from_being_served() -> None:
    wall, cell = Ready(), TickingCell(MS)
    loop = Loop(cell, Pace(clock=wall), [(0, Client())], wait=wall.wait)
    wall.now += MS - 1
    loop.step()
    loop.close()
    assert len(wall.asked) == 1 + LOOKS


@pytest.mark.parametrize("far", [10**6 * SECOND, 1 << 99])
def test_no_sleep_is_longer_than_systems_can_sleep(far: int) -> None:
    wall, cell = Ready(), TickingCell(far)
    loop = Loop(cell, Pace(Fraction(1, 10**9), clock=wall), [(0, Client())], wait=wall.wait)
    loop.step()
    loop.close()
    assert wall.asked == [3600.0]


class Slow(TickingCell):
    """A cell that takes ten times as long as it lasts."""

    def __init__(self, wall: Wall) -> None:
        super().__init__(100 * US)
        self.wall = wall

    def run_to(self, until: int) -> None:
        super().run_to(until)
        self.wall.now += MS


def test_a_cell_that_cannot_keep_pace_still_serves_its_clients_and_its_lateness_shows_it() -> None:
    wall = Ready(UNREAL)
    cell, client = Slow(wall), Client()
    pace = Pace(clock=wall)
    loop = Loop(cell, pace, [(0, client)], wait=wall.wait)
    wall.now += SECOND
    client.inbox.append(b"x")
    loop.step()
    loop.close()
    assert cell.got() == b"x"
    assert cell.ticks == LONGEST // MS + 1, "it stopped soon after the time it may take"
    assert cell.now == cell.ticks * 100 * US, "nothing was skipped"
    assert pace.lateness.most > SECOND


def test_an_endpoint_is_called_when_it_wants_to_be() -> None:
    wall, cell, client = Wall(), TickingCell(None), Client()
    loop = Loop(cell, Pace(clock=wall), [(0, client)], wait=wall.wait)
    client.alarm = wall.now + SECOND
    while not client.alarms:
        loop.step()
    loop.close()
    assert client.alarms[0] - wall.now <= 0
    assert SECOND <= client.alarms[0] - 123_456_789_012_345 <= SECOND + 200 * US + LOOK


def test_stopping_wakes_a_sleeping_loop() -> None:
    loop = Loop(TickingCell(None), Pace(), [], wait=select.select)
    loop.stop()
    loop.run()
    loop.close()


def test_stopping_again_and_again_does_no_harm() -> None:
    loop = Loop(TickingCell(None), Pace(), [], wait=select.select)
    for _ in range(100_000):  # more than the pipe that wakes it holds
        loop.stop()
    loop.run()
    loop.close()


def test_a_held_cell_does_nothing_and_sleeps_until_somebody_says_something() -> None:
    wall, cell, client = Ready(), TickingCell(MS), Client()
    pace = Pace(clock=wall)
    loop = Loop(cell, pace, [(0, client)], wait=wall.wait)
    pace.hold(0)
    wall.now += SECOND
    loop.step()
    assert (cell.now, cell.ticks, wall.asked) == (0, 0, [None])
    pace.go(cell.now)
    wall.now += 3 * MS
    loop.step()
    loop.close()
    assert (cell.now, cell.ticks) == (3 * MS, 3)


def test_a_free_cell_does_what_it_can_in_the_time_that_clients_may_wait() -> None:
    class Working(Ready):
        def __call__(self) -> int:
            self.now += US
            return self.now

    wall, cell, client = Working(), TickingCell(SECOND), Client()
    pace = Pace(clock=wall)
    pace.change(None, 0)
    loop = Loop(cell, pace, [(0, client)], wait=wall.wait)
    loop.step()
    loop.close()
    assert wall.asked == [0.0]
    assert cell.ticks == LONGEST // US + 1  # the one that is over the time is the last
    assert cell.now == cell.ticks * SECOND
    assert pace.lateness.count == 0  # nothing was due at any time


def test_a_free_cell_without_anything_to_do_keeps_its_time() -> None:
    wall, cell = Ready(), TickingCell(None)
    pace = Pace(clock=wall)
    pace.change(None, 0)
    loop = Loop(cell, pace, [(0, Client())], wait=wall.wait)
    loop.step()
    loop.close()
    assert (cell.now, wall.asked) == (0, [None])


def test_other_threads_are_served_between_two_waits_and_hear_what_came_of_it() -> None:
    cell = TickingCell(None)
    loop = Loop(cell, Pace(), [], wait=look)
    serving = threading.Thread(target=loop.run)
    serving.start()
    assert loop.ask(threading.current_thread).result(20) is serving
    with pytest.raises(KeyError):
        loop.ask(lambda: {}["no"]).result(20)
    loop.stop()
    serving.join()
    late = loop.ask(lambda: 1)
    loop.close()
    assert late.cancelled()
    assert loop.ask(lambda: 1).cancelled()
