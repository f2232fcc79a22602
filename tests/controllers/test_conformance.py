"""All devices obey the laws of the contract (`conformance`), each with inputs of its own kind."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.controllers import conformance
from tests.controllers.conformance import Candidate, schedules
from tests.controllers.genstepper import inputs as genstepper
from tests.controllers.gsc200 import inputs
from tests.controllers.supersigma import inputs as supersigma
from tests.generated import examples

from detent.cell.detector import StepDetector
from detent.cell.switches import Switch

CANDIDATES = (*inputs.CANDIDATES, *genstepper.CANDIDATES, *supersigma.CANDIDATES,
              Candidate("step detector", StepDetector, None, ["CLOCK"]),
              Candidate("switch", lambda: Switch(1), None, ["SET"]))  # fmt: skip

FAST = settings(max_examples=examples(100), deadline=None, suppress_health_check=list(HealthCheck))
THOROUGH = settings(max_examples=700, deadline=None, suppress_health_check=list(HealthCheck))

every_candidate = pytest.mark.parametrize("candidate", CANDIDATES, ids=[candidate.name for candidate in CANDIDATES])


def check_all(candidate: Candidate, data: st.DataObject) -> None:
    schedule = data.draw(schedules(candidate), label="schedule")
    law = data.draw(st.sampled_from(["bytes", "time", "copies", "same"]), label="law")
    match law:
        case "bytes":
            cut = data.draw(st.integers(0, 20))
            conformance.output_does_not_depend_on_how_characters_are_sliced(candidate, schedule, cut)
        case "time":
            slices = data.draw(st.lists(st.sampled_from([0.0, 1.0]) | st.floats(0, 1), min_size=1, max_size=7))
            conformance.output_does_not_depend_on_how_time_is_sliced(candidate, schedule, slices)
        case "copies":
            at, other = data.draw(st.integers(0, 200)), data.draw(schedules(candidate), label="of the other copy")
            conformance.copies_go_on_alike(candidate, schedule, at, other)
        case "same":
            conformance.the_same_inputs_give_the_same_outputs(candidate, schedule)


@every_candidate
@FAST
@given(data=st.data())
def test_the_laws_hold(candidate: Candidate, data: st.DataObject) -> None:
    check_all(candidate, data)


@pytest.mark.slow
@every_candidate
@THOROUGH
@given(data=st.data())
def test_the_laws_hold_for_many_more_inputs(candidate: Candidate, data: st.DataObject) -> None:
    check_all(candidate, data)
