"""A cell that cannot go on: it stops with a report that names the pins, and is served all the same."""

from pathlib import Path

import pytest
from tests.cell.cells import cell as built

from detent.cell.circuit import Oscillation
from detent.cell.description import parse
from detent.realtime.guarded import Guarded
from detent.realtime.picture import whole_state
from detent.realtime.service import Service
from detent.ticks import MS


class Failing:
    """A cell one of whose units raises at 10 ms."""

    now = 0
    lines = ()

    def next_event(self) -> int | None:
        return 10 * MS

    def run_to(self, until: int) -> None:
        self.now = until
        if until >= 10 * MS:
            raise AssertionError("a character that nobody sent")

    def send(self, line: int, data: object) -> None:
        raise KeyError(line)


@pytest.mark.parametrize("how", ["time", "characters"])
def test_what_a_unit_raises_stops_its_cell_with_a_report_and_nothing_else(how: str) -> None:
    told: list[str] = []
    made = Guarded(Failing(), told.append)
    if how == "time":
        made.run_to(20 * MS)
        assert told == ["the cell has stopped at 0.020000 s: AssertionError: a character that nobody sent"]
    else:
        made.send(0, b"x")
        assert told == ["the cell has stopped at 0.000000 s: KeyError: 0"]
    assert made.stopped == told[0]
    assert made.next_event() is None
    made.run_to(30 * MS)
    made.send(0, b"x")
    assert len(told) == 1


def test_an_oscillation_names_its_pins_and_what_drives_them(monkeypatch: pytest.MonkeyPatch) -> None:
    made = built('[units.a]\nmodel = "gs-c200"\n[[wires]]\nfrom = "a.UO1"\nto = ["a.UI1", "a.UI2"]\n')
    monkeypatch.setattr("detent.cell.circuit.MOST_DELIVERIES", 6)
    net = made.circuit.net_driven(0, "UO1")
    assert net is not None

    def swing() -> None:
        for n in range(9):
            made.circuit.drive(net, (0, "UO1"), n % 2)

    with pytest.raises(
        Oscillation, match=r"a\.UI1 \(driven by a\.UO1\), a\.UI2 \(driven by a\.UO1\) change without end"
    ):
        swing()


def test_a_service_whose_cell_has_stopped_still_answers(tmp_path: Path) -> None:
    told: list[str] = []
    description = parse('[units.a]\nmodel = "gs-c200s"\n', "cell.toml")
    with Service(description, lambda _: "", observed=True, on_stop=told.append) as service:
        service.guarded.stop(RuntimeError("a.UO1, b.UI1 change without end"))
        assert "a.UO1, b.UI1" in told[0]
        future = service.ask(lambda: service.cell.now)
        service.step()
        assert future.result(0) == service.cell.now
        assert service.stopped == told[0]
        assert whole_state(service)["stopped"] == told[0]
