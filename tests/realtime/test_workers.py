"""Work on several processes: the answers are those of one, in their order, also when a worker is killed."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.motors.variants import SPREAD, Ensemble, draws
from detent.motors.winding import HALF
from detent.ramps.constant_acceleration import move

pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]

RIG = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0, HALF), Load(inertia=1.5e-5, friction=0.02))
POINTS = [(slew, ramp) for slew in range(2000, 8000, 500) for ramp in range(20, 220, 20)]


def lost(rig: Rig, points: list[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Which of 32 variants lose a step with each of these slew speeds and ramps."""
    many = Ensemble(rig, draws(SPREAD.of(rig), 32, seed=3))
    found = []
    for slew, ramp in points:
        outcomes = many.judge(move(500, slew, ramp, 600).train)
        found.append(tuple(int(k) for k in outcomes.lost.nonzero()[0]))
    return found


@pytest.fixture(scope="module")
def workers() -> Iterator[Any]:
    import cloudpickle

    from detent.realtime.workers import Workers

    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    with Workers(2) as found:
        yield found
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


def test_the_answers_are_those_of_one_process(workers: Any) -> None:
    alone = lost(RIG, POINTS)
    assert any(alone)
    assert not all(alone)
    assert list(workers.map(lost, RIG, POINTS)) == alone
    assert list(workers.map(lost, RIG, POINTS, chunk=7)) == alone


def test_also_when_a_worker_is_killed(workers: Any) -> None:
    answers = workers.map(lost, RIG, POINTS, chunk=5)
    found = [next(answers)]
    os.kill(next(iter(workers.names().values())), signal.SIGKILL)
    found += answers
    assert found == lost(RIG, POINTS)


def test_what_fails_in_a_worker_is_raised_here(workers: Any) -> None:
    with pytest.raises(ZeroDivisionError):
        list(workers.map(lambda _, pieces: [1 // piece for piece in pieces], None, [1, 0]))


def test_a_worker_has_one_thread(workers: Any) -> None:
    assert list(workers.map(lambda _, pieces: [os.environ["NUMBA_NUM_THREADS"] for _ in pieces], None, [1])) == ["1"]
    assert set(workers._client.nthreads().values()) == {1}


def test_nobody_at_the_address() -> None:
    from detent.realtime.workers import Workers, WorkersLost

    with pytest.raises(WorkersLost, match=r"--scheduler tcp://127.0.0.1:1: nobody answers"):
        Workers(scheduler="tcp://127.0.0.1:1", patience=1)


PRESSED = """
import os, signal, sys
from detent.realtime.workers import Workers

def square(_, pieces):
    return [piece * piece for piece in pieces]

pressed = []
if __name__ == "__main__":
    signal.signal(signal.SIGINT, lambda *_: pressed.append(1))
    with Workers(2) as workers:
        before = workers.names()
        answers = workers.map(square, None, range(40), chunk=1)
        found = [next(answers)]
        os.kill(next(iter(before.values())), signal.SIGKILL)  # whoever comes in its place hears nothing either
        while len(there := set(workers._client.nthreads())) < 2 or there == set(before):
            pass
        now = workers.names()
        os.killpg(0, signal.SIGINT)
        found += answers
        assert workers.names() == now, "a worker has heard it"
    assert found == [k * k for k in range(40)]
    assert pressed == [1]
    print("whole", *now.values())
"""


def test_workers_do_not_hear_ctrl_c(tmp_path: Path) -> None:
    """A terminal sends it to all processes: who has started them decides what to do, and ends them.

    Nothing else is said either, also where the port is taken that a scheduler has by default.
    """
    script = tmp_path / "pressed.py"
    script.write_text(PRESSED)
    with socket.socket() as taken:
        with suppress(OSError):  # somebody else has it: as good
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        done = subprocess.run(
            [sys.executable, script], capture_output=True, text=True, timeout=240, start_new_session=True
        )
    assert done.returncode == 0, done.stderr
    word, *workers = done.stdout.split()
    assert word == "whole"
    assert done.stderr == ""
    for worker in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(int(worker), 0)


def test_a_scheduler_that_is_gone_is_told() -> None:
    from detent.realtime.workers import Workers, WorkersLost

    with ExitStack() as stack:
        command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
                   "--no-dashboard"]  # fmt: skip
        scheduler = stack.enter_context(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        stack.callback(scheduler.kill)
        assert scheduler.stderr is not None
        address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at:" in line)
        work = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
        worker = stack.enter_context(subprocess.Popen(work, stderr=subprocess.DEVNULL))
        stack.callback(worker.kill)
        workers = stack.enter_context(Workers(scheduler=address, patience=600))
        answers = workers.map(_squares, None, range(1000), chunk=1)
        assert next(answers) == 0
        scheduler.kill()
        with pytest.raises(WorkersLost, match="the scheduler answers no more"):
            list(answers)


def _squares(_: object, pieces: list[int]) -> list[int]:
    return [piece * piece for piece in pieces]


def test_the_tuner_gives_the_same_answer_and_map(workers: Any) -> None:
    from detent.tuner.map import loss_map
    from detent.tuner.search import search
    from detent.tuner.task import Task, moves_of

    task = Task("gs-c200", RIG, moves_of("200"), at_corners=False, screened=64, final=64, refined=False)
    alone = search(task)
    divided = search(task, run=workers.run, ahead=8)
    assert (divided.point, divided.check, divided.times) == (alone.point, alone.check, alone.times)
    one = loss_map(task, alone.point, columns=6, rows=5, variants=16)
    many = loss_map(task, alone.point, columns=6, rows=5, variants=16, run=workers.run, together=30)
    assert one.csv() == many.csv()


def test_a_batch_has_the_same_rows(workers: Any) -> None:
    from dataclasses import replace

    from detent.tuner.batch import answers
    from detent.tuner.task import Task, moves_of

    rigs = [RIG, replace(RIG, load=Load(inertia=3e-5, friction=0.02)), replace(RIG, load=Load(friction=3.0))]
    tasks = [Task("gs-c200", rig, moves_of("200"), at_corners=False, screened=16, final=32, refined=False)
             for rig in rigs]  # fmt: skip
    alone = answers(None, tasks)
    assert [bool(answer.problem) for answer in alone] == [False, False, True]
    assert list(workers.map(answers, None, tasks, chunk=1)) == alone
