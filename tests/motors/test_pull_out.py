"""Where the greatest torque of a speed is looked for changes nothing of what is found."""

import pytest

from detent.motors import curve
from detent.motors.drive import Decay, Drive
from detent.motors.named import MOTORS, motor


@pytest.mark.parametrize("likely", [range(curve.ANGLES), range(2)], ids=["everywhere", "where it is not"])
@pytest.mark.parametrize("decay", ["fast", "slow", "mixed", "voltage"])
def test_the_greatest_torque_is_where_it_is_looked_for(
    decay: Decay, likely: range, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = [
        (motor(name), Drive(24, motor(name).current, decay=decay), rate)
        for name in list(MOTORS)[:: len(MOTORS) // 3]
        for rate in (200, 3000)
    ]
    found = [curve.pull_out(*one) for one in asked]
    monkeypatch.setattr(curve, "LIKELY", likely)
    curve.greatest.cache_clear()
    assert [curve.pull_out(*one) for one in asked] == found
    curve.greatest.cache_clear()
