"""The other controllers with their witnesses, each with a rotor: the bracket, and where the inputs set limits."""

import pytest
from tests.tuner.machine.rigs import Bed, made

from detent.cell.cell import Cell
from detent.cell.faults import StuckSwitch
from detent.moves.laws import law
from detent.tuner.machine.bench import WitnessError, bench, knob_of
from detent.tuner.machine.carriage import MachineError, Room

MOTOR = """
[motors.slide]
motor = "qsh4218-41-10-035"
unit = "axis"
supply = 24
{step}
load = {{ inertia = 1.5e-5, friction = 0.02, viscous = 2e-3 }}
[switches.home]
axis = "slide"
to = 4.0
drives = {drives}
"""


def cell(model: str, drives: str, step: str = "", options: str = "") -> Cell:
    head = f'[units.axis]\nmodel = "{model}"\n{options}\n'
    return made(head + MOTOR.format(drives=drives, step=step))


class TestEach:
    def test_a_gs_c200_that_stands_before_its_count_of_0(self) -> None:
        bed = Bed(cell("gs-c200", '["axis.UI1"]', options='straps = { CHS = "low" }'), "gs-c200", checksums=False)
        bed.on[1] = lambda: bed.cell.breaks(StuckSwitch("home", 1))
        room = Room(travel=220, behind=40, turn=8, rate=400)
        with pytest.raises(MachineError, match="push the carriage farther onto the witness"):
            bed.run(bed.plan("S=60", "T=400", "R=40", moves=(160,), room=room))
        bed.stays_within(room)

    def test_a_gs_c200_whose_counter_ends_at_0(self) -> None:
        """It refuses what would count below 0 (E5), and stands 3 steps before that: no piece of the way is longer."""
        bed = Bed(cell("gs-c200", '["axis.UI1"]', options='straps = { CHS = "low" }'), "gs-c200", checksums=False)
        room = Room(travel=220, behind=40, turn=8, rate=400)
        found = bed.run(bed.plan("S=60", "T=400", "R=40", moves=(160,), room=room, trials=1, confirm=1)).found
        assert found.bad is not None
        bed.stays_within(room)

    @pytest.mark.parametrize(
        "witness", ["LIMIT-B", pytest.param("HOME", marks=pytest.mark.slow), pytest.param("P1", marks=pytest.mark.slow)]
    )
    def test_a_dcb_274(self, witness: str) -> None:
        bed = Bed(cell("dcb-274", f'["axis.{witness}"]'), "dcb-274", witness)
        room = Room(travel=260, behind=40, turn=8, rate=400)
        plan = bed.plan("I=800", "V=4000", "K=12", moves=(160,), room=room, trials=1, confirm=1)
        found = bed.run(plan).found
        assert found.good <= 12
        assert found.shipped >= 2 * found.good
        bed.stays_within(room)

    @pytest.mark.slow
    def test_a_bs0610(self) -> None:
        bed = Bed(
            cell("bs0610", '["axis.LX-"]', step='axis = "X"\ncurrent = 1.0\ndecay = "fast"'), "bs0610", "LX-", motor="X"
        )
        room = Room(travel=1400, behind=160, turn=64, rate=1600)
        plan = bed.plan("K=1600", "R=20000", "P=20000", moves=(640,), room=room, trials=1, confirm=1)
        found = bed.run(plan).found
        assert found.good >= 20000
        assert found.shipped <= found.good / 2 + 1
        bed.stays_within(room)

    @pytest.mark.slow
    def test_a_supersigma_whose_rail_is_seen_only_as_it_closes(self) -> None:
        bed = Bed(cell("supersigma", '["axis.RAIL"]', options="options = { number = 1 }"), "supersigma", "RAIL")
        room = Room(travel=400, behind=40, turn=8, rate=300)
        plan = bed.plan("limit=10", moves=(240,), room=room, trials=1, confirm=1)
        found = bed.run(plan).found
        assert found.good >= 10
        assert found.shipped < found.good
        bed.stays_within(room)


class TestInputs:
    """What can be a witness; what cannot is said with what can."""

    @pytest.mark.parametrize(
        ("model", "witness", "told"),
        [
            ("gs-c200", "HOME", "UI1, UI2 and UI3, and neither HOME nor EOT"),
            ("dcb-274", "UI1", "HOME, LIMIT-A, LIMIT-B, P1"),
            ("bs0610", "LY-", "LX- and LX"),
            ("supersigma", "FORCE", "only of RAIL"),
            ("gs-c200s", "UI1=2", "UI1=1 where 1 is closed"),
        ],
    )
    def test_what_cannot_be_read(self, model: str, witness: str, told: str) -> None:
        class Driver:
            title, motor, signed = model, "X", True

        with pytest.raises(WitnessError, match=told):
            bench(law(model), Driver(), witness)  # type: ignore[arg-type]

    def test_a_limit_has_its_side(self) -> None:
        class Driver:
            title = "axis"

        assert bench(law("dcb-274"), Driver(), "LIMIT-A").away == -1  # type: ignore[arg-type]
        with pytest.raises(WitnessError, match="the switch at the other end"):
            bench(law("dcb-274"), Driver(), "LIMIT-A", 1)  # type: ignore[arg-type]

    def test_what_is_made_harder(self) -> None:
        assert knob_of(law("gs-c200")).harder(300, 1.5) == 200
        assert knob_of(law("dcb-274")).set({"K up": 7, "K down": 5, "I": 1}, 4) == {"K up": 4, "K down": 4, "I": 1}
        assert knob_of(law("bs0610")).harder(20000, 1.5) == 30000


class TestRooms:
    @pytest.mark.parametrize(
        ("room", "told"),
        [
            (Room(200, 40, 8, 400), "needs a travel of 208"),
            (Room(300, 10, 8, 400), "too few"),
        ],
    )
    def test_a_room_that_is_too_small(self, room: Room, told: str) -> None:
        from detent.moves.spelling import read
        from detent.tuner.machine.session import Plan

        made_law, values = read("gs-c200", ["S=60", "T=400", "R=40"])
        with pytest.raises(MachineError, match=told):
            Plan(made_law, values, (160,), room)
