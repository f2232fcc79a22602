"""The four laws of pulses."""

from typing import TypeAlias

from detent.pulses.accelerating import Accelerating
from detent.pulses.table import Table
from detent.pulses.ticked import Ticked
from detent.pulses.uniform import Uniform

AnySegment: TypeAlias = Uniform | Accelerating | Table | Ticked
