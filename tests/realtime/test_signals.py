import select
import signal
import threading
from collections.abc import Sequence

from tests.realtime.ticking import TickingCell

from detent.realtime.loop import Loop, stopped_by_signals
from detent.realtime.pace import Pace


def test_a_signal_that_another_thread_gets_ends_a_loop_that_sleeps() -> None:
    woken: list[list[int]] = []

    def sleep(
        readers: Sequence[int], writers: Sequence[int], _: Sequence[int], seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        assert seconds is None, "nothing else would end this sleep"
        other = threading.Thread(target=lambda: signal.pthread_kill(threading.get_ident(), signal.SIGTERM))
        other.start()
        other.join()
        found = select.select(readers, writers, (), 60)
        woken.append(found[0])
        return found

    loop = Loop(TickingCell(None), Pace(), [], wait=sleep)
    with stopped_by_signals(loop):
        loop.run()
    loop.close()
    assert woken[0], "woken, and not only by the end of the sleep"
