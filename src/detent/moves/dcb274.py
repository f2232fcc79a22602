"""DCB-274: I, V, K and D, by the counts of its timer."""

from collections.abc import Mapping

from detent.controllers import catalogue
from detent.controllers.dcb274 import commands as dcb274
from detent.controllers.dcb274.settings import Settings
from detent.motors.winding import DCB_274
from detent.moves.law import Commands, Law, Setting, Values
from detent.pulses import Train
from detent.ramps import timer_table

FACTORY_STEP = "1/4"  # H 1, page 40


def law(found: catalogue.Model, _: Mapping[str, object], axis: str) -> Law:
    """I, V, K and D of the manual (pages 37, 40, 41, 50), by the counts of its timer."""
    factory = Settings("A")
    up, down = dcb274.ROWS[dcb274.Op.RAMP].arguments
    (divide,) = dcb274.ROWS[dcb274.Op.DIVIDE].arguments
    fastest = timer_table.rate_of(timer_table.LEAST_COUNT)

    def rate(op: dcb274.Op, title: str, count: int) -> Setting:
        return Setting(op.value, title, "steps/s", timer_table.SLOWEST, fastest, timer_table.rate_of(count))

    def train(values: Values, steps: int) -> Train:
        initial, slew = timer_table.count_of(values["I"]), timer_table.count_of(values["V"])
        speeds = timer_table.Speeds(initial, slew, values["K up"], values["K down"], values["D"])
        return timer_table.index(speeds, steps).train

    def commands(values: Values, steps: int) -> Commands:
        ramp = f"K {values['K up']} {values['K down']}"
        return Commands((f"I {values['I']}", f"V {values['V']}", ramp, f"D {values['D']}"), f"+ {steps}")

    def remark(values: Values) -> str:
        initial, slew = values["I"], values["V"]
        if timer_table.count_of(initial) >= timer_table.count_of(slew):
            return ""
        return (
            f"V={slew} is below I={initial}: a {found.name} makes no ramp then, and all steps at {slew} steps/s, "
            "divided by D"
        )

    return Law(
        found.name, "table of speeds of an 8 036 ns timer", "steps", dcb274.ROWS[dcb274.Op.PLUS].arguments[0].high,
        (
            rate(dcb274.Op.INITIAL, "initial speed", factory.initial),
            rate(dcb274.Op.SLEW, "slew speed", factory.slew),
            Setting("K up", "ramp up, steps each", "steps", up.low, up.high, factory.ramp[0]),
            Setting("K down", "ramp down, steps each", "steps", down.low, down.high, factory.ramp[1]),
            Setting("D", "speeds divided by", "", divide.low, divide.high, factory.divide),
        ),
        train, commands, tuple(sorted(DCB_274, key=lambda winding: winding.name != FACTORY_STEP)), remark,
    )  # fmt: skip
