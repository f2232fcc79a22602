"""What takes longer than a window should wait for another is done beside the loop of the pages, in threads of a few.

Those of `asyncio.to_thread` would do as well, but that a server which is told to end waits for them.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import Any, Final, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

MOST: Final = 6  # at once; others wait for their turn

_waiting: SimpleQueue[tuple[Future[Any], Callable[[], Any]]] = SimpleQueue()
_threads: list[Thread] = []


async def beside(function: Callable[P, T], *given: P.args, **named: P.kwargs) -> T:
    """Call `function` in a thread; its result. Whoever is cancelled does not wait, and what runs ends unheard.

    A process that ends does so in the middle of it: nothing that must not be left half done is done here.
    """
    future: Future[T] = Future()
    _waiting.put((future, partial(function, *given, **named)))
    if len(_threads) < MOST:
        _threads.append(Thread(target=_work, name="beside", daemon=True))
        _threads[-1].start()
    return await asyncio.wrap_future(future)


def _work() -> None:
    while True:
        future, call = _waiting.get()
        if future.set_running_or_notify_cancel():
            try:
                future.set_result(call())
            except BaseException as error:  # whoever asked is told
                future.set_exception(error)
        del future, call  # what was asked is kept no longer than it takes
