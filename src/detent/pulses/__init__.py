"""Pulse trains: when each step pulse falls, exactly, without storing any.

A :class:`Train` is an immutable run of segments, each a law with an instant it is anchored to. The four
laws: :class:`Uniform`, :class:`Accelerating`, :class:`Table`, :class:`Ticked`.
"""

from detent.pulses.accelerating import Accelerating
from detent.pulses.segment import Segment, State
from detent.pulses.table import Table
from detent.pulses.ticked import Ticked
from detent.pulses.train import Train
from detent.pulses.uniform import Uniform

__all__ = ["Accelerating", "Segment", "State", "Table", "Ticked", "Train", "Uniform"]
