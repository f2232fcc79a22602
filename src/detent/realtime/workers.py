"""Work divided over processes and machines by dask.distributed: the jobs of a map, the rows of a batch.

What a piece answers hangs on the piece alone, so that the answers are those of one process, whoever does which, and
also when a worker is lost: what it had is done again. Pieces are put together until they take `CHUNK` seconds: smaller
ones cost more to carry about than to do.
"""

import logging
import os
import re
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from time import perf_counter
from typing import Any, NamedTuple, Self, TypeVar

from detent.extras import need
from detent.tuner.judge import Job, Lost, judge_of
from detent.tuner.task import Task

CHUNK = 0.25  # s, of one worker
AT_FIRST = 4  # pieces in a chunk while nobody knows how long one takes
MOST = 512
MOST_WORKERS = 256
AHEAD = 3  # chunks for each worker that are on their way
STARTED = 60.0  # s until the first worker must be there
ANSWERS = 10.0  # s in which a scheduler must answer

ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx|ucxx)://)?(\[[0-9a-fA-F:.]+\]|[\w.-]+):\d{1,5}")  # of a scheduler

ONE_THREAD = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

Piece = TypeVar("Piece")
Result = TypeVar("Result")


class WorkersLost(RuntimeError):
    """There is nobody to do the work, or a piece of it kills whoever does it. The text says what to do."""


class _Done(NamedTuple):
    """The answers of a chunk, and how long they took."""

    answers: list[Any]
    seconds: float


class Workers:
    """Workers of a scheduler, or `count` processes of this machine. Closed, those processes are gone.

    Raises MissingExtra without dask.distributed, WorkersLost where nobody answers.
    """

    def __init__(self, count: int | None = None, scheduler: str | None = None, *, patience: float = STARTED) -> None:
        """By default one for each processor. `patience`: seconds until the first must be there. ValueError."""
        if count is not None and scheduler is not None:
            raise ValueError("--workers are processes of this computer, --scheduler has its own: give one of them")
        if count is not None and not 1 <= count <= MOST_WORKERS:
            raise ValueError(f"--workers {count}: say 1 to {MOST_WORKERS}")
        if scheduler is not None and not ADDRESS.fullmatch(scheduler):
            raise ValueError(f"--scheduler {scheduler}: write tcp://HOST:PORT, as the scheduler says where it listens")
        need("distributed", "work on several processes or machines needs")
        import distributed

        self._cluster: Any = None
        self._client: Any = None
        self._shared: Any = None
        self._carried: Any = None
        local: Any = distributed.LocalCluster
        make: Any = distributed.Client
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is told in one line of an error
        try:
            if not scheduler:
                with _deaf():
                    self._cluster = local(
                        n_workers=count or os.cpu_count() or 1, threads_per_worker=1, processes=True,
                        dashboard_address=None, host="127.0.0.1", env=ONE_THREAD, silence_logs=logging.CRITICAL,
                        # without a port of its own it takes 8787, and warns where that is taken: by another tune
                        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    )  # fmt: skip
            self._client = make(self._cluster or scheduler, timeout=min(patience, ANSWERS), set_as_default=False)
            self._client.wait_for_workers(1, timeout=patience)
        except (OSError, RuntimeError) as error:  # a timeout is an OSError
            where = f"--scheduler {scheduler}" if scheduler else "the workers of this machine"
            self.close()
            raise WorkersLost(f"{where}: nobody answers: {error or 'no worker'}") from None

    def count(self) -> int:
        """How many workers there are now."""
        return len(self._client.nthreads())

    def names(self) -> Mapping[str, int]:
        """Their addresses, and the process of each."""
        return dict(self._client.run(os.getpid))

    def map(
        self, do: Callable[[Any, list[Piece]], list[Result]], shared: Any, pieces: Sequence[Piece],
        *, chunk: int | None = None,
    ) -> Iterator[Result]:  # fmt: skip
        """`do(shared, [piece, ...])` for all of `pieces`: the results in their order, as they come.

        `chunk` is how many pieces go together; by default as many as take a quarter of a second. What `do` raises is
        raised here. Both must be picklable, as are functions of modules.
        """
        from distributed import KilledWorker

        if self._carried is None or self._shared is not shared:  # once: a worker keeps what it has made of it
            self._shared, self._carried = shared, self._client.submit(_itself, shared, pure=False)
        size, at = chunk or AT_FIRST, 0
        waiting: list[Any] = []
        try:
            while at < len(pieces) or waiting:
                while at < len(pieces) and len(waiting) < AHEAD * max(self.count(), 1):
                    some = list(pieces[at : at + size])
                    waiting.append(self._client.submit(_timed, do, self._carried, some, pure=False))
                    at += len(some)
                done: _Done = waiting.pop(0).result()
                yield from done.answers
                if chunk is None and done.answers:
                    each = max(done.seconds / len(done.answers), 1e-6)
                    size = min(max(round(CHUNK / each), 1), 2 * size, MOST)
        except KilledWorker as error:
            raise WorkersLost(
                f"a piece of the work was given to several workers, and each was lost with it ({error}). Memory, "
                "perhaps: look at their output, and take fewer workers"
            ) from None
        except (OSError, CancelledError):
            waiting.clear()
            raise WorkersLost(
                "the scheduler answers no more: what it was given is lost. See that it runs, and begin again"
            ) from None
        finally:
            if waiting:
                self._client.cancel(waiting)

    def run(self, task: Task, jobs: Sequence[Job]) -> Iterable[Lost]:
        """A `detent.tuner.judge.Runner`."""
        return self.map(_judged, task, jobs)

    def close(self) -> None:
        """Let them go; local ones end."""
        for one in (self._client, self._cluster):
            if one is not None:
                one.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started here, or later by threads that were, do not hear Ctrl-C.

    A terminal sends it to all of them. They have nothing to tidy up; whoever has started them asks them to end, or is
    gone, and then they end by themselves. Where no signals can be held back (not POSIX) they hear it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker  # POSIX

    resource_tracker.ensure_running()  # else it is begun in there, and hears Ctrl-C, and lets others hear it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _timed(do: Callable[[Any, list[Any]], list[Any]], shared: Any, pieces: list[Any]) -> _Done:
    """A chunk of work, in the worker."""
    began = perf_counter()
    answers = do(shared, pieces)
    return _Done(answers, perf_counter() - began)


def _judged(task: Task, jobs: list[Job]) -> list[Lost]:
    """Jobs of a task. A worker keeps the judge of the last one, with its trains."""
    judge = judge_of(task)
    return [judge.answer(job) for job in jobs]


def _itself(shared: Any) -> Any:
    return shared
