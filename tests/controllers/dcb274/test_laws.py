"""The DCB-274 and its adapters obey the laws of every device."""

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.controllers.conformance import Candidate
from tests.controllers.dcb274 import inputs
from tests.controllers.test_conformance import check_all
from tests.generated import examples

# a schedule takes long to shrink; the thorough set does it
FAST = settings(
    max_examples=examples(20),
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=list(HealthCheck),
)
THOROUGH = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
CANDIDATES = (*inputs.CANDIDATES, *inputs.SIN_CANDIDATES)


@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda candidate: candidate.name)
@given(data=st.data())
@FAST
def test_the_laws_hold(candidate: Candidate, data: st.DataObject) -> None:
    check_all(candidate, data)


@pytest.mark.slow
@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda candidate: candidate.name)
@given(data=st.data())
@THOROUGH
def test_the_laws_hold_for_many_more_inputs(candidate: Candidate, data: st.DataObject) -> None:
    check_all(candidate, data)
