"""The times of pulses that follow each other in one segment, as an array."""

from detent.pulses import arrays, ramp_arrays, table_arrays, ticked_arrays
from detent.pulses.accelerating import Accelerating
from detent.pulses.laws import AnySegment
from detent.pulses.segment import Int64Array
from detent.pulses.table import Table
from detent.pulses.uniform import Uniform
from detent.ticks import Fixed


def fill(out: Int64Array, segment: AnySegment, first: int, start: Fixed) -> None:
    """Write the ns of the pulses first .. first + len(out) - 1 of a segment, in a train that starts at `start`.

    The caller has made sure that they exist and fit int64.
    """
    if isinstance(segment, Uniform):
        anchor = start + segment.anchor
        arrays.fill_progression(out, segment.first + first, segment.numerator, segment.denominator, anchor)
    elif isinstance(segment, Accelerating):
        ramp_arrays.fill_ramp(out, first, segment, start)
    elif isinstance(segment, Table):
        table_arrays.fill(segment, out, first, start)
    else:
        ticked_arrays.fill(segment, out, first, start)
