"""Best first: the fastest setting that survives, whoever does the work; what is proved of it; what is refused."""

import pickle
from collections.abc import Sequence
from functools import cache

import pytest

from detent.motors import chance
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.tuner.grid import Dimension
from detent.tuner.judge import Job, Judge, Lost, judge_of
from detent.tuner.map import loss_map
from detent.tuner.search import Found, Progress, Stopped, grid_points, search
from detent.tuner.spaces import Point, Space, space
from detent.tuner.task import NOMINAL, Move, Task, TunerError, moves_of
from detent.tuner.tune import tune

RIG = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0), Load(inertia=1.5e-5, friction=0.02))


def task(moves: str = "120", **other: object) -> Task:
    """A small task; `coarse` puts 45 points in the place of its grid."""
    return Task("gs-c200", RIG, moves_of(moves), **{"screened": 128, "final": 256, **other})  # type: ignore[arg-type]


@cache
def whole_space() -> Space:
    return space(task())


def coarse(made: Task) -> Judge:
    judge = judge_of(made)
    start, slew, ramp = whole_space().dimensions
    judge.space = whole_space()._replace(dimensions=(
        start._replace(values=(40, 90, 150)), slew._replace(values=(260, 420, 700)),
        ramp._replace(values=(12, 24, 48, 96, 190)),
    ))  # fmt: skip
    return judge


def test_best_first_is_what_trying_everything_finds() -> None:
    made = task(refined=False)
    judge = coarse(made)
    found = search(made)
    order = list(grid_points(judge))
    assert len(order) == 45
    assert order == sorted(order)
    variants = tuple(sorted(found.examples))
    safe = [(time, point) for time, point in order if not judge.answer(Job(point, variants, to_the_end=True))]
    assert safe[0] == (found.time, found.point)
    assert safe[0] > order[0]  # the fastest of all is none
    assert set(made.corners) < set(found.examples)


def test_the_answer_is_that_of_the_task_however_the_work_is_divided() -> None:
    def pieces(of: Task, jobs: Sequence[Job]) -> list[Lost]:
        """The last job first, each by somebody who has only read what was sent."""
        if not readers:
            readers.append(Judge(pickle.loads(pickle.dumps(of))))
            readers[0].space = judge_of(of).space
        return [readers[0].answer(job) for job in reversed(jobs)][::-1]

    readers: list[Judge] = []

    small = {"refined": False, "screened": 32, "final": 64}
    alone, divided = task("60", **small), task("60", **small)
    coarse(alone)
    one = search(alone)
    coarse(divided)  # the judge of the last task is kept
    other = search(divided, run=pieces, ahead=5)
    assert readers
    assert (one.point, one.times, one.check) == (other.point, other.times, other.check)
    assert sorted(one.examples) == sorted(other.examples)


def test_no_verdict_hangs_on_who_is_judged_beside() -> None:
    made = task()
    judge = coarse(made)
    variants = (NOMINAL, *made.corners, *made.drawn(5, 200))
    ramps = ((90, 420, ramp) for ramp in (24, 34, 48, 68, 96, 136))
    answers = ((point, judge.answer(Job(point, variants, to_the_end=True))) for point in ramps)
    point, whole = next((point, lost) for point, lost in answers if 0 < len(lost) < len(variants))
    parts = [judge.answer(Job(point, variants[k : k + 37], to_the_end=True)) for k in range(0, len(variants), 37)]
    assert whole == tuple(one for part in parts for one in part)
    first = judge.answer(Job(point, variants))
    assert len(first) == 1
    assert first[0] in whole


class Planted:
    """A runner that knows nothing of motors: which variants lose is told by the point."""

    def __init__(self, least_ramp: int, planted: Point = (), rare: tuple[int, ...] = ()) -> None:
        self.least_ramp, self.planted, self.rare = least_ramp, planted, rare
        self.asked: list[Job] = []

    def __call__(self, _: Task, jobs: Sequence[Job]) -> list[Lost]:
        self.asked += jobs
        return [self.answer(job) for job in jobs]

    def answer(self, job: Job) -> Lost:
        if job.point == self.planted:
            lost = tuple(one for one in job.variants if one in self.rare)
        else:
            lost = job.variants if job.point[2] < self.least_ramp else ()
        return lost if job.to_the_end else lost[:1]


def test_a_fragile_optimum_is_refused_by_the_final_look_and_the_bound_counts_the_looks() -> None:
    made = task(refined=False)
    judge = coarse(made)
    planted = next(point for _, point in grid_points(judge))
    rare = made.drawn(16 + 128, 256)[::100]  # three variants, none of them among those that are screened
    found = search(made, run=(run := Planted(24, planted, rare)))
    assert found.point[2] >= 24
    assert set(rare[:1]) <= set(found.examples)
    final = [job for job in run.asked if job.fine]
    assert {job.point for job in final} == {planted, found.point}
    assert found.check.looks == 2
    assert found.check.bound == chance.bound(0, 256, looks=2) > chance.bound(0, 256)
    seen = [variant for job in final for variant in job.variants if variant not in made.corners]
    assert len(seen) == len(set(seen)) == 512  # each look has variants that nobody has met
    assert "2 looks counted" in str(found.check)


def test_a_winner_at_the_edge_of_the_grid_widens_it() -> None:
    made = task()
    judge = coarse(made)
    judge.space = judge.space._replace(dimensions=(
        *judge.space.dimensions[:2], judge.space.dimensions[2]._replace(values=(400, 500, 600)))
    )  # fmt: skip
    found = search(made, run=Planted(5))
    assert 5 <= found.point[2] < 400


def test_between_the_points_of_the_grid_there_are_faster_ones() -> None:
    rough, fine = task(refined=False), task()
    coarse(rough)
    on_the_grid = search(rough, run=Planted(20)).time
    coarse(fine)
    assert search(fine, run=Planted(20)).time < on_the_grid


def test_a_search_that_is_stopped_says_what_it_has() -> None:
    made = task(refined=False)
    coarse(made)
    told: list[Progress] = []
    stopped = search(made, run=Planted(24), watch=told.append, cancelled=lambda: any(one.best for one in told))
    assert not stopped.whole
    assert stopped.point[2] >= 24
    assert stopped.check.variants == 0
    assert stopped.check.bound == 1
    assert "no fresh ones yet" in str(stopped.check)
    with pytest.raises(Stopped):
        search(made, run=Planted(24), cancelled=lambda: True)


class Rare(Planted):
    """One more: the shorter its ramps, the more variants a point loses, each point others, and no corner."""

    def answer(self, job: Job) -> Lost:
        *_, ramp = job.point
        lost = tuple(one for one in job.variants if one >= 128 and hash((job.point, one)) % 1000 < 4000 / ramp**2)
        return lost if job.to_the_end else lost[:1]


@pytest.mark.parametrize("seed", range(4))
def test_what_a_stopped_search_has_survives_all_that_others_lost_and_is_not_forgotten(seed: int) -> None:
    """Stopped at each of its jobs in turn."""

    def until(job: int) -> Found:
        left = [job]

        def cancelled() -> bool:
            left[0] -= 1
            return left[0] < 0

        made = task(refined=False, screened=64, final=512, seed=seed)
        coarse(made).space = dense
        return search(made, run=Rare(0), cancelled=cancelled)

    ramps = tuple(range(12 + seed, 120, 5))
    start, slew, ramp = whole_space().dimensions
    dense = whole_space()._replace(dimensions=(
        start._replace(values=(90,)), slew._replace(values=(400, 420)), ramp._replace(values=ramps)
    ))  # fmt: skip
    whole = until(1 << 30)
    assert whole.check.looks > 1  # a final look was lost on the way
    runner, kept, job = Rare(0), [], 0
    while True:
        job += 1
        try:
            found = until(job)
        except Stopped:
            assert not any(not runner.answer(Job(point, whole.examples)) for point in kept), job
            continue
        if found.whole:
            break
        assert not runner.answer(Job(found.point, found.examples)), job
        assert found.check.met == len(found.examples)
        kept.append(found.point)
    assert len(set(kept)) > 1


def test_progress_counts_up_to_what_it_said() -> None:
    made = task(refined=False)
    coarse(made)
    told: list[Progress] = []
    search(made, run=Planted(90), watch=told.append)
    done = [one.done for one in told]
    assert done == sorted(done)
    assert all(one.done <= one.total for one in told)


def test_where_nothing_is_without_loss_it_is_said_why() -> None:
    made = Task("gs-c200", Rig(RIG.motor, RIG.drive, Load(inertia=2e-3, friction=0.02)), moves_of("150"), screened=8)
    coarse(made)
    with pytest.raises(TunerError, match=r"no settings on the grid .* lost after pulse"):
        search(made)
    stuck = Rig(RIG.motor, RIG.drive, Load(inertia=1e-5, friction=1.0))
    with pytest.raises(TunerError, match="does not turn this load"):
        search(Task("gs-c200", stuck, moves_of("150")))


def test_moves_are_read_as_people_write_them() -> None:
    assert moves_of("200,1000x3, 5000X0.5") == (Move(200), Move(1000, 3), Move(5000, 0.5))
    for wrong in ("", "x3", "200,", "0", "-5", "1e3", "10x0", "10xnan", "10x"):
        with pytest.raises(TunerError, match="--moves"):
            moves_of(wrong)
    with pytest.raises(TunerError, match="at most"):
        task("999999999")
    with pytest.raises(TunerError, match="--variants"):
        task(final=0)


def test_a_map_has_a_rate_and_a_time_for_each_point() -> None:
    made = task("80")
    judge = coarse(made)
    point = judge.space.hand
    found = loss_map(made, point, columns=4, rows=3, variants=16)
    assert found.lost.shape == found.times.shape == (len(found.y), len(found.x))
    assert found.x[0] <= point[1] <= found.x[-1]
    rows = found.csv().splitlines()
    assert rows[0].startswith('"T: slew speed, 10 steps/s","R: ramp length, steps",')
    assert len(rows) == 1 + len(found.x) * len(found.y)
    assert (found.times[0] <= found.times[-1]).all()  # longer ramps take longer
    with pytest.raises(TunerError, match="before it was whole"):
        loss_map(made, point, columns=2, rows=2, variants=4, cancelled=lambda: True)


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610"])
def test_the_chosen_settings_are_a_point_of_the_map(model: str) -> None:
    """Also at the limit of a command: they lay where there are no settings, P=62500 of a BS0610 between two rows."""
    made = Task(model, RIG, moves_of("80"))
    judge = judge_of(made)
    space, hand = judge.space, judge.space.hand
    x, y = (space.place(name) for name in space.plane)

    def with_ramp(ramp: int) -> Point:
        return space.on_plane(hand, hand[x], ramp)

    highest = next(with_ramp(ramp) for ramp in range(space.dimensions[y].high, 0, -1)
                   if space.admits(with_ramp(ramp)) and judge.time(with_ramp(ramp)) is not None)  # fmt: skip
    for point in (hand, highest):
        found = loss_map(made, point, columns=5, rows=4, variants=1)
        assert found.chosen == (point[x], point[y])
        assert found.times[found.y.index(point[y]), found.x.index(point[x])] == judge.time(point)
        assert list(found.x) == sorted(set(found.x))
        assert list(found.y) == sorted(set(found.y))


def test_a_grid_is_widened_at_its_end_and_not_beyond_what_a_command_takes() -> None:
    grid = Dimension("R", 1, 999, (10, 20, 40))
    wider, added = grid.wider(40)
    assert wider.values == (10, 20, 40, 80, 160, 320, 640)
    assert added == (80, 160, 320, 640)
    assert wider.wider(640)[1] == (999,)
    assert grid.wider(20) == (grid, ())
    assert all(10 < value < 40 for value in grid.near(20))
    assert grid.near(20)[len(grid.near(20)) // 2] == 20


def test_a_supply_that_barely_drives_the_current_is_tuned_for_all_the_same() -> None:
    """Another model of the motor that such a supply cannot drive is left out: it is no reason to say nothing."""
    tight = Rig(motor("qsh4218-41-10-035"), Drive(4.8, 1.0), Load(inertia=1.5e-5, friction=0.02))
    made = Task("gs-c200", tight, moves_of("30"), screened=0, final=16, at_corners=False)
    judge = judge_of(made)
    grid = (one._replace(values=one.values[::3]) for one in judge.space.dimensions)
    judge.space = judge.space._replace(dimensions=tuple(grid))
    found = tune(made)
    assert found.found.check.lost == 0
    names = [model.name for model in found.models]
    assert "half steps compensated" not in names
    assert "no damping" in names
