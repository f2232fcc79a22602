import json
from typing import Any

import pytest
from tests.realtime.served import address, served

from detent.cli import main
from detent.cli.link_bench import QUESTIONS, Measured
from detent.realtime.connect import HOSTS


def measured(*choices: str, status: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", *choices])
    assert ended.value.code == status


def test_every_model_has_a_question() -> None:
    assert set(QUESTIONS) == set(HOSTS)


@pytest.mark.parametrize(
    ("model", "sent", "received"),
    [("gs-c200", 4, 4), ("dcb-274", 2, 7), ("bs0610", 3, 19), ("supersigma", 2, 3)],
)
def test_reply_times_and_throughput_are_measured(
    model: str, sent: int, received: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with served(model) as service:
        measured(model, address(service), "--count", "20", "--patience", "10", "--json")
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    seconds = found["seconds"]
    assert 0 < seconds["min"] <= seconds["median"] <= seconds["p99"] <= seconds["max"]
    rates = found["characters_per_second"]
    assert rates["sent"] / found["exchanges_per_second"] == pytest.approx(sent)
    assert rates["received"] / found["exchanges_per_second"] == pytest.approx(received, abs=1)


def test_people_read_milliseconds() -> None:
    text = str(Measured("gs-c200", "/dev/ttyUSB0", "V1", [0.009, 0.01, 0.011, 0.02], 16, 20))
    assert text.splitlines() == [
        "4 times V1 to the gs-c200 at /dev/ttyUSB0",
        "reply       min 9.000 ms, median 11.000 ms, 99 % 20.000 ms, max 20.000 ms",
        "throughput  80 exchanges/s, 320 characters/s sent, 400 received",
    ]


def test_wrong_requests_say_so(capsys: pytest.CaptureFixture[str]) -> None:
    measured("gs-c200", "/dev/no-such-device", "--count", "0", status=2)
    assert "ask at least once" in capsys.readouterr().err
    measured("gs-c200", "/dev/no-such-device", status=1)
    assert "no such device" in capsys.readouterr().err
