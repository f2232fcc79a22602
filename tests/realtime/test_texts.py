"""Files that people name: read whole, never for ever, whatever they are."""

import os
import threading
from pathlib import Path

import pytest

from detent.realtime import texts
from detent.realtime.texts import read_text, read_whole

pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")


@pipes
def test_a_pipe_to_which_nobody_writes_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texts, "PIPE", 0.01)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="nobody writes to it") as raised:
        read_whole(tmp_path / "pipe")
    assert raised.value.filename == str(tmp_path / "pipe")


@pipes
def test_a_pipe_is_read_to_its_end_however_it_comes(tmp_path: Path) -> None:
    """As a shell gives one for <(...)."""
    os.mkfifo(tmp_path / "pipe")

    def write() -> None:
        with (tmp_path / "pipe").open("wb", buffering=0) as pipe:
            for _ in range(3):
                pipe.write(b"W1\n" * 1000)

    writing = threading.Thread(target=write)
    writing.start()
    assert read_text(tmp_path / "pipe") == "W1\n" * 3000
    writing.join()


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open descriptors are counted in /proc")
def test_what_cannot_be_read_is_told_by_its_name_and_let_go_of(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nothing", Path("/proc/self/mem")):
        for _ in range(3):
            before = len(os.listdir("/proc/self/fd"))
            with pytest.raises(OSError, match="r") as raised:
                read_whole(path)
            assert raised.value.filename in (str(path), path)
            assert len(os.listdir("/proc/self/fd")) == before


def test_a_file_that_never_ends_is_refused_at_its_bound(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="it is larger than 0 MiB"):
        read_whole(Path("/dev/zero"), 1000)
    (tmp_path / "large").write_bytes(b"x" * 1001)
    with pytest.raises(OSError, match="it is larger"):
        read_whole(tmp_path / "large", 1000)
    assert read_whole(tmp_path / "large", 1001) == b"x" * 1001
