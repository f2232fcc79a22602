"""Files of two columns as spreadsheets write them: curves, loads that change, records of a ring-down."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.motors import columns, load, own, ring_down
from detent.motors.load import NO_LOAD
from detent.motors.motor import MotorError

NUMBER = st.integers(-(10**6), 10**6).map(lambda thousandths: thousandths / 1000)
MARKS = st.sampled_from([(",", "."), (", ", "."), (";", "."), (";", ","), ("; ", ","), ("\t", "."), ("\t", ",")])


@given(
    st.lists(st.tuples(NUMBER, NUMBER), min_size=2, max_size=9), MARKS, st.booleans(), st.sampled_from(["\n", "\r\n"])
)
def test_what_a_spreadsheet_writes_is_read(
    rows: list[tuple[float, float]], marks: tuple[str, str], quoted: bool, end: str
) -> None:
    mark, point = marks

    def cell(value: object) -> str:
        text = str(value).replace(".", point)
        return f'"{text}"' if quoted else text

    head = mark.join(map(cell, ("s", "Nm")))
    body = [mark.join((cell(t), cell(x))) + "  # noted" for t, x in rows]
    text = "\ufeff" + end.join([head, "", *body]) + end
    assert ring_down.read(text, "a.csv") == ([t for t, _ in rows], [x for _, x in rows])
    assert [columns.numbers(line) for _, line in columns.lines(text)[1:]] == rows


def test_a_curve_and_a_load_with_decimal_commas() -> None:
    assert own.read_curve("\ufeffhalf steps/s;Nm\r\n500;0,281\r\n2000;0,273\r\n", "a.csv") == (
        (250, 0.281),
        (1000, 0.273),
    )
    found = load.read_profile(NO_LOAD, '\ufeff"s";"Nm"\n0;0,01\n1;0,05\n', "a.csv", {})
    assert found.torque_by_time == load.profile([(0.0, 0.01), (1.0, 0.05)])


@pytest.mark.parametrize("line", ["0,0,281", "1;0,1,2", "1;nan", "inf,1", "1", "a;b", "1;2;3", ";", "1;0.1,2"])
def test_what_is_no_pair_of_numbers_is_told_with_its_line(line: str) -> None:
    for read, head in (
        (lambda text: own.read_curve(text, "a.csv"), "half steps/s, Nm"),
        (lambda text: load.read_profile(NO_LOAD, text, "a.csv", {}), "s, Nm"),
        (lambda text: ring_down.read(text, "a.csv"), "s, steps"),
    ):
        with pytest.raises(MotorError, match=r"a\.csv, line 2: .*decimal commas need semicolons"):
            read(f"{head}\n{line}\n")


@pytest.mark.parametrize("text", ["", "\n \n", "half steps/s, Nm\n", "# nothing\n"])
def test_a_curve_without_points_is_told(text: str) -> None:
    with pytest.raises(MotorError, match=r"a\.csv: no points: write a line 'half steps/s, Nm'"):
        own.read_curve(text, "a.csv")
