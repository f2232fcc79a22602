"""What the windings of a motor got, at any times: from the recorded drives and the trains, exact at every step."""

from bisect import bisect_right
from collections.abc import Sequence

from detent.cell.recording import Recording
from detent.controllers.device import DriveSet
from detent.ticks import Ns


def duties(recording: Recording, unit: str, connector: str, times: Sequence[Ns], shaft: int = 0) -> list[Sequence[int]]:
    """The PWM counts of the winding ends at a connector, at each of `times`, steps of that instant included.

    `shaft` is where the axis stood at the start. ValueError for a connector of which no drive was recorded.
    """
    told = [entry for entry in recording.of(unit) if isinstance(entry, DriveSet) and entry.connector == connector]
    if not told:
        raise ValueError(f"no drive at connector {connector!r} of {unit} was recorded")
    spans = recording.motion(unit, max(times, default=0), told[0].axis)
    begins, drives = [span.begins for span in spans], [entry.at for entry in told]
    found = []
    for at in times:
        drive = told[max(bisect_right(drives, at) - 1, 0)]
        place, rate = shaft, 0
        index = bisect_right(begins, at) - 1
        if index >= 0:
            span = spans[index]
            given = min(max(span.train.steps_by(at), span.first - 1), span.last)
            place = span.shaft + span.direction * given
            rate = int(span.train.state_at(at).rate)
        found.append(drive.drive.duties(place - drive.origin, rate))
    return found
