"""The rates of a train at many times at once."""

import numpy as np

from detent.pulses import ticked_arrays
from detent.pulses.segment import Int64Array
from detent.pulses.ticked import Ticked
from detent.pulses.train import Train
from detent.ticks import FIXED_BITS, Ns, to_fixed


def rates_at(train: Train, times: Int64Array) -> Int64Array:
    """The whole steps/s of a train at times that are in order; 0 in gaps and from its end on."""
    rates = np.zeros(len(times), np.int64)
    for segment in train.segments:
        low = int(np.searchsorted(times, _from(train.start + segment.begin)))
        high = len(times) if segment.end is None else int(np.searchsorted(times, _from(train.start + segment.end)))
        inside = times[low:high]
        if not len(inside):
            continue
        if isinstance(segment, Ticked):
            rates[low:high] = ticked_arrays.rates_by(segment, inside, train.start)
        else:
            found = (int(segment.progress(to_fixed(t) - train.start)[1]) for t in inside.tolist())
            rates[low:high] = np.fromiter(found, np.int64, len(inside))
    return rates


def _from(instant: int) -> Ns:
    """The first whole ns that is not before an instant."""
    return -(-instant >> FIXED_BITS)
