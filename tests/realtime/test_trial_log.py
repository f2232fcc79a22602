import os
from pathlib import Path

import pytest

from detent.realtime import trial_log
from detent.realtime.trial_log import LogUnusable, TrialLog


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a system without such a device")
def test_a_log_without_an_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial_log, "MOST_BYTES", 1 << 16)
    with pytest.raises(LogUnusable, match="choose another place with --log FILE"):
        TrialLog(Path("/dev/zero"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
def test_a_pipe_is_no_log(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(LogUnusable, match="choose another place with --log FILE"):
        TrialLog(tmp_path / "pipe")


@pytest.mark.parametrize(
    "line", [b"[" * 100_000, b'{"a":' * 50_000, b"9" * 5000, b"[]", b"null", b"\xff", b"{"], ids=len
)
def test_a_line_that_is_none_of_a_run_is_told_with_its_number_and_nothing_is_changed(
    tmp_path: Path, line: bytes
) -> None:
    path = tmp_path / "log"
    path.write_bytes(b'{"kind": "plan"}\n' + line + b"\n")
    with pytest.raises(LogUnusable, match="line 2 is none of a tuning run: choose another --log FILE"):
        TrialLog(path)
    assert path.read_bytes() == b'{"kind": "plan"}\n' + line + b"\n"


def test_what_is_cut_off_is_taken_off_and_the_rest_is_gone_on_with(tmp_path: Path) -> None:
    with TrialLog(tmp_path / "log") as log:
        log.write({"kind": "plan"})
        log.write({"kind": "trial"})
    whole = (tmp_path / "log").read_bytes()
    (tmp_path / "log").write_bytes(whole + b'{"kind": "tri')
    with TrialLog(tmp_path / "log") as log:
        assert [record["kind"] for record in log.past] == ["plan", "trial"]
    assert (tmp_path / "log").read_bytes() == whole
