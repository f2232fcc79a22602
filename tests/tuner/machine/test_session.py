"""Tuning on an emulated machine with a rotor: what it finds, and everything that may go wrong on the way."""

import json

import pytest
from tests.tuner.machine.rigs import GSC200S, ROOM, TIED, Bed, gsc200s, made

from detent.cell.cell import Cell
from detent.cell.faults import OnLine, StuckSwitch
from detent.hosts.errors import DriverError
from detent.lines.faults import CableOut
from detent.motors.load import Load
from detent.motors.move import simulate
from detent.motors.rotor import Rig
from detent.tuner.machine.carriage import MachineError, Room
from detent.tuner.machine.session import NothingToShip, OtherRun, Plan, Result, left_safe

SHORT = Room(travel=220, behind=40, turn=8, rate=400)
SAFE = ("S=60", "T=400", "R=40")


def short(bed: Bed, *, begin: tuple[str, ...] = SAFE, trials: int = 1, confirm: int = 1) -> Plan:
    return bed.plan(*begin, moves=(160,), room=SHORT, trials=trials, confirm=confirm)


@pytest.fixture(scope="module")
def whole() -> tuple[Bed, Result]:
    """A run without a mishap."""
    bed = gsc200s()
    return bed, bed.run(short(bed))


Whole = tuple[Bed, Result]


class TestWhatItFinds:
    def test_the_bracket_is_closed_from_the_safe_side_and_the_carriage_stays_in_its_travel(self, whole: Whole) -> None:
        bed, found = whole
        good, bad = found.found.good, found.found.bad
        assert bad is not None
        assert good <= max(1.08 * bad, bad + 1)
        assert found.shipped == {"S": 60, "T": 400, "R": 2 * good}
        assert found.lost >= 1
        assert all(trial["early"] % 8 == 0 for trial in bed.trials() if trial["lost"])
        bed.stays_within(SHORT)
        knobs = [trial["knob"] for trial in bed.trials()]
        for n, trial in enumerate(bed.trials()):
            if trial["lost"]:
                assert min(knobs[n:]) == trial["knob"]  # nothing harder than what has lost is tried again

    def test_the_unit_is_left_with_what_is_shipped_and_at_the_witness(self, whole: Whole) -> None:
        bed, found = whole
        registers = bed.cell.controller("axis").registers(bed.cell.now)
        assert registers["R"] == str(found.shipped["R"])
        assert bed.motor().place(bed.cell.now) == pytest.approx(4.0, abs=2.0)

    @pytest.mark.slow
    def test_the_bracket_of_the_page_within_8_percent(self) -> None:
        """1000 half steps with S 600 and T 4000: the shortest ramp that the rotor alone makes in a simulation."""
        bed = gsc200s()
        found = bed.run(bed.plan("S=60", "T=400", "R=300", moves=(1000,), confirm=20)).found
        rig = bed.motor().rig
        assert isinstance(rig, Rig)
        assert isinstance(rig.load, Load)
        lost = {
            ramp: simulate(bed.law.train({"S": 60, "T": 400, "R": ramp}, 1000), rig).verdict.lost
            for ramp in range(10, 60)
        }
        first = max(ramp for ramp, is_lost in lost.items() if is_lost)  # from the safe side
        assert first / 1.08 <= found.good <= 1.08 * (first + 1)
        bed.stays_within(ROOM)


class TestLog:
    def test_an_interrupted_run_goes_on_where_it_was(self, whole: Whole) -> None:
        """Interrupted at its fourth trial, by hand; the trials of the log are not made again."""
        first, there = whole
        bed = gsc200s()

        def interrupt() -> None:
            raise KeyboardInterrupt

        bed.on[4] = interrupt
        with pytest.raises(KeyboardInterrupt):
            bed.run(short(bed))
        past = [json.loads(json.dumps(record)) for record in bed.records]
        bed.shell.perform(bed.bench.end())
        again = gsc200s()
        here = again.run(short(again), past)
        assert here == there
        assert again.trials()[0]["number"] == 4
        assert [dict(one) for one in [*bed.trials(), *again.trials()]] == [dict(one) for one in first.trials()]

    def test_whoever_interrupts_a_trial_finds_the_settings_with_which_it_began(self) -> None:
        """In the middle of the fast move of trial 3: R is shorter then, and in between S and T are those of the way."""
        bed = gsc200s()
        wait = bed.port.wait

        def interrupted(seconds: float) -> None:
            wait(seconds)
            if bed.motor().place(bed.cell.now) > 60:
                bed.port.wait = wait  # type: ignore[method-assign]
                raise KeyboardInterrupt

        bed.on[3] = lambda: setattr(bed.port, "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            bed.run(short(bed))
        registers = bed.cell.controller("axis").registers
        assert registers(bed.cell.now)["R"] != "40"
        stop = bed.bench.driver.stop

        def refused():  # type: ignore[no-untyped-def]
            bed.bench.driver.stop = stop
            raise DriverError("GS-C200S", "is busy and does not obey Z")
            yield

        bed.bench.driver.stop = refused
        bed.shell.perform(left_safe(short(bed), bed.bench))
        assert not bed.shell.perform(bed.bench.driver.moving())
        assert [registers(bed.cell.now)[name] for name in "STR"] == ["60", "400", "40"]

    def test_a_finished_log_moves_nothing(self, whole: Whole) -> None:
        bed, found = whole
        other = gsc200s()
        assert other.run(short(other), bed.records) == found
        assert max(other.port.seen) < 1

    @pytest.mark.parametrize("lost", [None, "false", 1, []])
    def test_a_log_whose_trials_do_not_say_what_came_of_them_moves_nothing(self, whole: Whole, lost: object) -> None:
        there, _ = whole
        bed = gsc200s()
        records = [{**one, "lost": lost} if one.get("kind") == "trial" else one for one in there.records]
        with pytest.raises(OtherRun, match="trial 1 of the log is not one of this plan"):
            bed.run(short(bed), records)
        assert max(bed.port.seen, default=0) < 1

    def test_a_log_of_another_run_is_refused(self, whole: Whole) -> None:
        there, _ = whole
        bed = gsc200s()
        with pytest.raises(OtherRun, match=r"moves was \[160\] and is \[150\]"):
            bed.run(bed.plan(*SAFE, moves=(150,), room=SHORT, trials=1, confirm=1), there.records)


class TestWhatGoesWrong:
    def test_an_open_witness_at_the_start_moves_nothing(self) -> None:
        bed = gsc200s(where="to = -3.0")
        with pytest.raises(MachineError, match="the witness is open"):
            bed.run(short(bed))
        assert max(map(abs, bed.port.seen)) < 1

    def test_a_carriage_clear_of_the_witness_goes_there_no_farther_than_it_was_told(self) -> None:
        bed = gsc200s(where="to = -30.0")
        plan = bed.plan(*SAFE, moves=(160,), room=SHORT._replace(approach=20))
        with pytest.raises(MachineError, match="still open after the 20 steps"):
            bed.run(plan)
        assert min(bed.port.seen) > -21
        bed = gsc200s(where="to = -3.0")
        bed.on[1] = lambda: bed.cell.breaks(StuckSwitch("home", 0))
        with pytest.raises(MachineError, match="still closed"):
            bed.run(plan)

    def test_on_another_switch_of_the_same_wire_it_does_not_run_into_the_end(self) -> None:
        """HOME, EOT and UI1 are one wire, closed at both ends, and the carriage stands at the far one."""
        bed = gsc200s(where="from = -20.0")
        with pytest.raises(MachineError, match="or this is another switch on the same wire"):
            bed.run(short(bed))
        assert max(bed.port.seen) <= SHORT.behind + 3 * SHORT.turn + 1

    def test_homing_on_the_closed_wire_is_not_trusted(self) -> None:
        """Datasheet: with HOME and EOT closed homing is done without a step; the counter alone says home then."""
        bed = gsc200s(where="from = -20.0")
        bed.cell.type("axis", "H-")
        bed.cell.run_to(bed.cell.now + 10**9)
        assert bed.cell.controller("axis").status(bed.cell.now).position == 0
        with pytest.raises(MachineError, match="still closed"):
            bed.run(short(bed))

    def test_a_witness_that_sticks_closed(self) -> None:
        bed = gsc200s()
        bed.on[2] = lambda: bed.cell.breaks(StuckSwitch("home", 0))
        with pytest.raises(MachineError, match="still closed"):
            bed.run(short(bed))
        bed.stays_within(SHORT)

    def test_a_witness_that_sticks_open(self) -> None:
        bed = gsc200s()
        bed.on[2] = lambda: bed.cell.breaks(StuckSwitch("home", 1))
        with pytest.raises(MachineError, match=r"did not close|still open"):
            bed.run(short(bed))
        bed.stays_within(SHORT)

    def test_a_witness_that_breaks_on_the_way_out(self) -> None:
        """The way back ends where the count says that the switch should have been, and the room behind it."""
        bed = gsc200s()
        plan = short(bed)
        inner = bed.bench.settings

        def settings(values):  # type: ignore[no-untyped-def]
            bed.cell.breaks(StuckSwitch("home", 1))
            yield from inner(values)

        bed.bench.settings = settings  # type: ignore[method-assign]
        with pytest.raises(MachineError, match="still open 32 steps behind where it should have closed"):
            bed.run(plan)
        bed.stays_within(SHORT)

    def test_a_carriage_that_does_not_move(self) -> None:
        bed = gsc200s()
        bed.cell.set_switch("power", 0)
        with pytest.raises(MachineError, match="the carriage does not move"):
            bed.run(short(bed))

    def test_a_carriage_that_sticks_in_mid_run(self) -> None:
        bed = gsc200s()
        bed.on[2] = lambda: bed.cell.set_switch("power", 0)
        with pytest.raises(MachineError, match="the carriage does not move"):
            bed.run(short(bed))
        bed.stays_within(SHORT)

    def test_a_loss_on_the_way_back_is_noticed(self) -> None:
        """The drive is off for a part of the way back: the carriage is farther out than the count says."""
        bed = gsc200s()
        plan = short(bed, begin=("S=60", "T=400", "R=24"))
        inner, count = bed.bench.slowly, [0]

        def slowly(rate):  # type: ignore[no-untyped-def]
            yield from inner(rate)
            count[0] += 1
            if count[0] == 3:  # the way back of the first trial
                move = bed.bench.move

                def dead(steps, timeout):  # type: ignore[no-untyped-def]
                    bed.cell.set_switch("power", 0)
                    made = yield from move(steps, timeout)
                    bed.cell.set_switch("power", 1)
                    bed.bench.move = move  # type: ignore[method-assign]
                    return made

                bed.bench.move = dead  # type: ignore[method-assign]

        bed.bench.slowly = slowly  # type: ignore[method-assign]
        assert bed.run(plan).found.bad is not None
        (doubt,) = [record for record in bed.records if record["kind"] == "doubt"]
        assert "closed late" in doubt["what"]
        assert doubt["early"] < -4

    def test_a_travel_that_is_not_free_is_found_slowly(self) -> None:
        """A wall at 100 steps: the first way out is slow."""
        wall = "load_by = { turns = [[-1, 0], [0.25, 0], [0.26, 3], [9, 3]] }"
        bed = Bed(walled(wall), checksums=False)
        with pytest.raises(MachineError, match="160 steps out and back at 400 steps/s end"):
            bed.run(short(bed))
        assert bed.trials() == []

    def test_a_line_that_fails_in_a_trial(self) -> None:
        """The move that nobody was told of is over; a new reference, and the trial again."""
        bed = gsc200s(patience=0.2)
        bed.on[2] = lambda: bed.cell.breaks(OnLine(0, CableOut()), 10**9)
        found = bed.run(short(bed, begin=("S=60", "T=400", "R=24")))
        assert bed.kinds().count("mishap") >= 1
        assert found.found.bad is not None
        bed.stays_within(SHORT)

    def test_a_line_that_fails_for_good_leaves_nothing_moving(self) -> None:
        bed = gsc200s(patience=0.2)
        bed.on[2] = lambda: bed.cell.breaks(OnLine(0, CableOut()))
        with pytest.raises(DriverError, match="does not answer"):
            bed.run(short(bed))
        bed.cell.run_to(bed.cell.now + 3 * 10**9)
        bed.stays_within(SHORT)
        assert "mishap" in bed.kinds()

    def test_a_unit_that_is_switched_off_on_its_way_is_noticed(self) -> None:
        bed = gsc200s(patience=0.2)
        inner, count = bed.bench.rest, [0]

        def rest(timeout):  # type: ignore[no-untyped-def]
            count[0] += 1
            if count[0] == 30:
                bed.cell.power("axis", False)
                bed.cell.power("axis", True)
            return (yield from inner(timeout))

        bed.bench.rest = rest  # type: ignore[method-assign]
        with pytest.raises(MachineError, match=r"it was switched off|a stop ended the motion"):
            bed.run(short(bed))
        assert max(bed.port.seen) <= SHORT.travel

    def test_what_it_begins_with_loses_already(self) -> None:
        bed = gsc200s()
        with pytest.raises(NothingToShip, match="R=2 already, with which it began"):
            bed.run(short(bed, begin=("S=60", "T=400", "R=2")))
        bed.stays_within(SHORT)
        again = gsc200s()  # no trial is left to make: the same words, and nothing moves
        with pytest.raises(NothingToShip, match="R=2 already, with which it began"):
            again.run(short(again, begin=("S=60", "T=400", "R=2")), bed.records)
        assert max(again.port.seen) < 1


def walled(wall: str) -> Cell:
    text = GSC200S.format(viscous=2e-3, where="to = 4.0", drives=TIED, more="")
    return made(text.replace("supply = 24\n", f"supply = 24\n{wall}\n"))
