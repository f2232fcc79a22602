"""The kernels: plain, compiled, abreast, as a thread of a GPU they give the same numbers; a run may be cut anywhere."""

import os
import subprocess
import sys
from math import cos, exp, pi, sin

import numpy as np
import pytest
from tests.motors.moves import SMALL, even, ramped, rig

from detent.motors import engine, gpu, kernel, variants
from detent.motors.drive import Drive
from detent.motors.excitation import Sequencer
from detent.motors.motor import MotorError
from detent.motors.move import simulate
from detent.motors.rotor import Rig, Rotor
from detent.motors.variants import changed, judge
from detent.motors.winding import FULL, HALF
from detent.ticks import MS, US

compiled_only = pytest.mark.skipif(not engine.fast(), reason="numba is not installed")


def state_after(rig: Rig, times, *, plain: bool, monkeypatch: pytest.MonkeyPatch) -> tuple[list[float], list[int]]:  # type: ignore[no-untyped-def]
    if plain:
        monkeypatch.setattr(engine, "advance", lambda: kernel.advance)
    sequencer = Sequencer(rig.drive)
    rotor = Rotor(rig, sequencer)
    rotor.run(sequencer.pulses(times, 1), int(times[-1]) + 5 * MS)
    return rotor.s.tolist(), rotor.n.tolist()


@compiled_only
@pytest.mark.parametrize("decay", ["fast", "slow", "voltage"])
def test_compiled_and_plain_agree_to_the_last_bit(decay: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = Rig(SMALL.changed(detent_torque=0.01), Drive(24, 1.0, HALF, decay))  # type: ignore[arg-type]
    times = even(900, 40)
    compiled = state_after(one, times, plain=False, monkeypatch=monkeypatch)
    assert state_after(one, times, plain=True, monkeypatch=monkeypatch) == compiled


@compiled_only
def test_motors_abreast_get_the_verdicts_that_each_gets_alone() -> None:
    """Lost moves among them: the arithmetic is the same, operation by operation."""
    base, random = rig(), np.random.default_rng(7)
    rigs = [
        changed(
            base, inertia=random.uniform(0.3, 6), inductance=random.uniform(0.8, 1.3), voltage=random.uniform(0.5, 1.5)
        )
        for _ in range(37)
    ]
    times = ramped(400, 500, 7000)
    found = judge(times, rigs)
    assert found == [simulate(times, one).verdict for one in rigs]
    assert 0 < sum(verdict.lost for verdict in found) < len(rigs)


@pytest.mark.parametrize("decay", ["slow", "voltage"])
def test_abreast_knows_the_other_drives(decay: str) -> None:
    base = Rig(SMALL, Drive(24, 1.0, HALF, decay), rig().load)  # type: ignore[arg-type]
    rigs = [changed(base, inertia=factor, resistance=2 - factor) for factor in (0.8, 1.0, 1.3)]
    times = even(400, 60)
    alone = [simulate(times, one).verdict for one in rigs]
    assert judge(times, rigs) == alone


@pytest.mark.parametrize("pieces", [1, 2, 7])
def test_a_run_may_be_cut_anywhere(pieces: int) -> None:
    one, times, end = rig(), ramped(60, 300, 1200), 100 * MS
    whole, parts = Rotor(one, Sequencer(one.drive)), Rotor(one, Sequencer(one.drive))
    whole.run(Sequencer(one.drive).pulses(times, 1), end)
    sequencer, taken = Sequencer(one.drive), 0
    for piece in range(1, pieces + 1):
        until = end * piece // pieces
        ready = int(np.searchsorted(times, until, side="right"))
        changes = sequencer.pulses(times[taken:ready], 1) if ready > taken else sequencer.up_to(until)
        parts.run(changes, until)
        taken = ready
    assert parts.s.tolist() == whole.s.tolist()
    assert parts.n[: kernel.STEP].tolist() == whole.n[: kernel.STEP].tolist()


def test_its_own_sine_and_exponential_are_exact_to_the_last_digits() -> None:
    """A free current decays by exp(-R t / L), and the torque on a held rotor is a sine of its angle."""
    heavy = SMALL.changed(inertia=1e3)
    one = Rig(heavy, Drive(24, 1.0, FULL))
    for angle in np.linspace(-700, 900, 23):
        rotor = Rotor(one, Sequencer(one.drive))
        rotor.s[kernel.X] = angle
        rotor.run(Sequencer(one.drive).up_to(0), 20 * US)
        s = rotor.s
        torque = heavy.torque_constant * (s[kernel.IB] * cos(angle) - s[kernel.IA] * sin(angle))
        assert s[kernel.ACC] * 1e3 == pytest.approx(torque, abs=1e-12)
    rotor = Rotor(one, Sequencer(one.drive))
    par = rotor.parameters
    par[kernel.GAIN] = 0.0  # a voltage drive that gives nothing
    rotor.n[kernel.MODE] = 2
    rotor.run(Sequencer(one.drive).up_to(0), 2 * MS)
    assert rotor.s[kernel.IA] == pytest.approx(exp(-2e-3 * heavy.resistance / heavy.inductance), rel=1e-12)


def test_the_step_of_the_integrator_is_fine_enough() -> None:
    """20 us against 1 us: within 0.1 electrical degrees at the end of a move."""
    times = ramped(300, 300, 1500)
    ends = [
        simulate(times, Rig(SMALL, Drive(24, 1.0, HALF), rig().load, h), sample=0).trace[-1, 1] for h in (20 * US, US)
    ]
    assert abs(ends[0] - ends[1]) < 0.1 * pi / 180


def test_plain_python_refuses_what_would_take_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "fast", lambda: False)
    with pytest.raises(MotorError, match=r"minutes without numba: ask for less, or .*setup"):
        simulate(even(100, 10_000), rig())
    assert not simulate(even(100, 3), rig()).verdict.lost
    assert judge(even(100, 3), [rig(), rig()]) == [simulate(even(100, 3), rig()).verdict] * 2


CUDA = """
import numpy as np
from numba import cuda
from detent.motors import kernel
from detent.motors.excitation import Sequencer
from detent.motors.rotor import Rotor
from tests.motors.moves import even, rig

step = cuda.jit(device=True)(kernel.advance)

@cuda.jit
def motors(s, n, times, places, levels, rows, modes, until, a, b, par, by_time, by_position, trace, substep):
    k = cuda.grid(1)
    if k < s.shape[0]:
        step(s[k], n[k], times, places, levels, rows, modes, until, a, b, par, by_time, by_position,
             -1e300, 1e300, trace, substep)

one, times, until = rig(), even(700, 6), 12_000_000
plain = Rotor(one, Sequencer(one.drive))
s, n = np.array([plain.s] * 3), np.array([plain.n] * 3)
changes = Sequencer(one.drive).pulses(times, 1)
trace = np.zeros((0, 6))
motors[1, 4](s, n, *changes, until, one.table_a, one.table_b, one.parameters, one.by_time, one.by_position,
             trace, one.substep)
plain.run(changes, until)
assert (s == plain.s).all() and (n == plain.n).all(), (s - plain.s)
print("same")
"""


@compiled_only
def test_the_kernel_is_a_thread_of_a_gpu_in_the_cuda_simulator() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CUDA], capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    if "No module named 'numba.cuda'" in done.stderr:
        pytest.skip("numba has no CUDA target here: install numba-cuda")
    assert done.stdout == "same\n", done.stderr


MANY = """
import numpy as np
from dataclasses import replace
from detent.motors import gpu
from detent.motors.load import Load, Profile
from detent.motors.variants import SPREAD, Ensemble, corners
from tests.motors.moves import even, rig

gpu.LEAST = 1
steady = rig()
changing = replace(steady, load=Load(5.4e-6, 0.02, torque_by_position=Profile(-1.0, 1.0, (0.0, 0.0, 0.2))))
for one in (steady, changing):
    some = Ensemble(one, corners(SPREAD.of(one))[:3])
    for rate, steps in ((500, 5), (20000, 20)):
        pulses = even(rate, steps)
        gpu.use(False)
        plain = some.judge(pulses, settle=2_000_000)
        first = some.survives(pulses, settle=2_000_000)
        gpu.use()
        there = some.judge(pulses, settle=2_000_000)
        for name, a, b in zip(plain._fields, plain, there):
            assert np.array_equal(a, b), (name, a, b)
        assert (some.survives(pulses, settle=2_000_000) is None) == (first is None)
        assert gpu.used()
        print(int(there.lost.sum()))
"""


@compiled_only
@pytest.mark.slow
def test_variants_on_a_gpu_are_those_of_a_processor_in_the_cuda_simulator() -> None:
    """A thread a variant, with a steady load and one that changes with the place; moves that are made, and lost."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", MANY], capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    if "there is no GPU here" in done.stderr:
        pytest.skip("numba has no CUDA target here: install numba-cuda")
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.split())) > 1, done.stdout


def test_no_gpu_is_one_clear_line_where_it_was_asked_for() -> None:
    if gpu.available():
        pytest.skip("there is a GPU")
    with pytest.raises(MotorError, match="there is no GPU here that numba sees"):
        gpu.use()
    gpu.use(where_there_is_one=True)
    assert not gpu.chosen(gpu.LEAST)


def test_a_gpu_that_does_not_work_is_left_alone_unless_it_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The verdicts are then a processor's, and nobody is told that a GPU has judged."""

    def broken(*_: object) -> None:
        raise RuntimeError("CUDA_ERROR_NO_BINARY_FOR_GPU")

    monkeypatch.setattr(gpu, "available", lambda: True)
    monkeypatch.setattr(gpu, "LEAST", 1)
    monkeypatch.setattr(variants, "_on_gpu", broken)
    some = variants.Ensemble(rig(), variants.corners(variants.SPREAD)[:2])
    try:
        gpu.use(where_there_is_one=True)
        assert not some.judge(even(500, 5), settle=2_000_000).lost.any()
        assert not gpu.used()
        gpu.use()
        with pytest.raises(RuntimeError, match="NO_BINARY"):
            some.judge(even(500, 5), settle=2_000_000)
    finally:
        gpu.use(False)
