"""The estimate of a board's clock: good to a few microseconds, never backwards, across the wrap of its 32 bits."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from detent.realtime.boards.clock import Clock, nearest
from detent.ticks import MS, SECOND, US


@given(st.integers(0, 1 << 60), st.integers(-(1 << 31), (1 << 31) - 1))
def test_the_nearest_whole_count(near: int, off: int) -> None:
    whole = near + off
    assert nearest(whole & 0xFFFFFFFF, near) == whole
    assert nearest((whole & 0xFFFFFFFF) - (1 << 32), near) == whole  # as a signed integer


def test_drift_is_found_and_time_never_goes_back() -> None:
    random, frequency = Random(3), 16_000_000
    for drift in (-200, 0, 47, 300):
        clock = Clock(frequency)
        first = (1 << 32) * 5 - 90 * frequency

        def true(wall: int, drift: int = drift, first: int = first) -> int:
            return first + wall * frequency * (1_000_000 + drift) // (1_000_000 * SECOND)

        wall, told = 0, 0
        clock.note(true(0), 0, 0)
        clock.trips.clear()
        for second in range(120):
            there, back = random.randrange(60, 200) * US, random.randrange(60, 200) * US
            if not random.randrange(5):
                back += random.randrange(20) * MS  # the host was busy
            sent = wall + random.randrange(MS)
            tick = clock.extend(true(sent + there) & 0xFFFFFFFF, sent + there + back)
            assert tick == true(sent + there)
            clock.note(tick, sent, sent + there + back)
            for _ in range(20):
                wall += 50 * MS
                ns = clock.ns_at(wall)
                assert ns >= told
                told = ns
            if second > 4:
                assert abs(clock.tick_at(wall) - true(wall)) < 150 * US * frequency // SECOND
        assert abs(clock.measured / frequency - 1 - drift / 1e6) < 5e-6
        assert clock.wall_at(clock.tick_at(wall)) <= wall
        assert clock.ns_at(clock.wall_at_ns(told + 12_345)) >= told + 12_345
