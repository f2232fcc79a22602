import shutil
import subprocess
from configparser import ConfigParser
from fractions import Fraction
from pathlib import Path
from zipfile import ZipFile

import pytest
from tests.outputs.expected import level_changes, pulses
from tests.outputs.recorded import BAR, DRILL, drilling, heard, interrupted, moved

from detent.cell.recording import Recording
from detent.controllers.device import Powered
from detent.outputs import arrays, signals, sigrok, step_file, vcd
from detent.outputs.signals import Signals
from detent.pins import PinSet
from detent.ticks import MS, SECOND

needs_sigrok = pytest.mark.skipif(
    shutil.which("sigrok-cli") is None, reason="sigrok-cli is not installed (Debian package sigrok-cli)"
)


def read(path: Path) -> tuple[list[str], int, list[list[int]]]:
    """A reader of its own: channel names, samplerate, and the samples of each channel."""
    with ZipFile(path) as archive:
        assert archive.read("version") == b"2"
        about = ConfigParser()
        about.read_string(archive.read("metadata").decode())
        device = about["device 1"]
        names = [device[f"probe{n}"] for n in range(1, int(device["total probes"]) + 1)]
        chunks = [name for name in archive.namelist() if name.startswith("logic-1-")]
        assert chunks == [f"logic-1-{n}" for n in range(1, len(chunks) + 1)]
        data = b"".join(archive.read(name) for name in chunks)
    size = int(device["unitsize"])
    samples = [int.from_bytes(data[k : k + size], "little") for k in range(0, len(data), size)]
    rate, unit = device["samplerate"].split()
    assert unit == "Hz"
    return names, int(rate), [[sample >> n & 1 for sample in samples] for n in range(len(names))]


def sampled(changes: list[tuple[int, int]], rate: int, count: int) -> list[int]:
    """The level at every sample, for changes that are at least one sample apart."""
    levels, k = [], 0
    for sample in range(count):
        while k + 1 < len(changes) and changes[k + 1][0] <= Fraction(sample * SECOND, rate):
            k += 1
        levels.append(int(changes[k][1] == 1))
    return levels


@pytest.mark.parametrize(("made", "views"), [(drilling, [BAR, DRILL]), (interrupted, [DRILL])])
def test_a_sample_is_the_level_at_its_time(made, views, tmp_path, monkeypatch):
    monkeypatch.setattr(sigrok, "CHUNK", 40_000)
    recording, until = made()
    until = min(until, 400 * MS)
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(recording, views, until), samplerate=600_000)
    names, rate, channels = read(path)
    assert rate == 600_000
    wanted = {f"{view.name}.{pin}": changes for view in views
              for pin, changes in level_changes(recording, view, until).items()}  # fmt: skip
    assert names == list(wanted)
    for name, channel in zip(names, channels, strict=True):
        assert len(channel) == until * rate // SECOND + 1
        if not name.endswith("CLOCK"):
            assert channel == sampled(wanted[name], rate, len(channel)), name


def test_a_pulse_narrower_than_a_sample_takes_one(tmp_path):
    recording, until = interrupted()
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(recording, [DRILL], until), samplerate=20_000, names=["drill.CLOCK"])
    names, rate, [channel] = read(path)
    assert names == ["drill.CLOCK"]
    falls = [k for k in range(1, len(channel)) if channel[k - 1 : k + 1] == [1, 0]]
    times = [t for t, _, _ in pulses(recording, "drill", until)]
    assert falls[: len(times)] == [-(-t * rate // SECOND) for t in times]
    assert all(channel[k + 1] == 1 for k in falls[: len(times) - 1])


def test_edges_closer_than_samples_are_stretched_and_none_is_lost(tmp_path):
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *(PinSet(MS + n, "UO1", (n + 1) % 2) for n in range(6))])
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(recording, [BAR], 2 * MS), samplerate=10_000, names=["bar.UO1"])
    assert read(path)[2] == [[0] * 10 + [1, 0, 1, 0, 1, 0] + [0] * 5]


def test_a_samplerate_too_low_for_a_channel_is_refused_with_one_that_will_do(tmp_path):
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *moved(5_000, 1, 0)[0]])
    signals = Signals(recording, [BAR], 3 * SECOND)
    path = tmp_path / "run.sr"
    with pytest.raises(ValueError, match=r"too few for the edges of bar\.CLOCK: take at least") as refused:
        sigrok.write(path, signals, samplerate=3_000)
    assert not path.exists()
    enough = int(str(refused.value).split("at least ")[1].split(",")[0])
    sigrok.write(path, signals, samplerate=enough)
    assert sum(read(path)[2][3][k] < read(path)[2][3][k - 1] for k in range(1, 100)) > 0


def test_a_run_too_long_for_its_samplerate_is_refused_with_one_that_fits(tmp_path):
    seen = Signals(Recording(["bar"]), [BAR], 10**6 * SECOND)
    with pytest.raises(ValueError, match=r"a samplerate of at most 8589, a shorter run, or a VCD"):
        sigrok.write(tmp_path / "run.sr", seen)
    for far in (10**6, 10**8):
        with pytest.raises(ValueError, match="shorter run, or a VCD") as told:
            sigrok.size(Signals(Recording(["bar"]), [BAR], 4 * 10**18), far)
        assert str(told.value).count("\n") == 0


@pytest.mark.parametrize("rate", [1, 3, 100])
def test_a_long_silence_takes_few_members_at_any_samplerate(rate, tmp_path):
    """A year takes what a minute does, but for the samples themselves."""
    recording, _ = drilling()
    path = tmp_path / "run.sr"
    seconds = 10**6 // rate
    names = ["bar.UO1", "bar.RDY"]
    sigrok.write(path, Signals(recording, [BAR, DRILL], seconds * SECOND), samplerate=rate, names=names)
    with ZipFile(path) as archive:
        assert len(archive.namelist()) < 12
    assert [len(samples) for samples in read(path)[2]] == [seconds * rate + 1] * 2


def test_what_would_be_written_one_by_one_has_a_bound(tmp_path, monkeypatch):
    recording, until = drilling()
    seen = Signals(recording, [BAR, DRILL], until)
    monkeypatch.setattr(signals, "MOST_PULSES", seen.pulse_count() - 1)
    for write in (
        lambda path: vcd.write(path, seen),
        lambda path: list(vcd.pieces(seen)),
        lambda path: arrays.write(path, seen),
        lambda path: step_file.write(path, seen, 12_000_000, 1000),
    ):
        with pytest.raises(ValueError, match=r"there are \d+ pulses, and \d+ can be written: run for less"):
            write(tmp_path / "file")
        assert not list(tmp_path.iterdir())


def test_a_channel_that_is_none_is_refused_with_those_there_are(tmp_path):
    signals = Signals(Recording(["bar"]), [BAR], 1)
    with pytest.raises(KeyError, match=r"no channel 'bar.MOVE': there are bar.RXD"):
        sigrok.write(tmp_path / "run.sr", signals, names=["bar.MOVE"])
    with pytest.raises(ValueError, match="at least 1 sample a second"):
        sigrok.write(tmp_path / "run.sr", signals, samplerate=0)


def test_the_same_run_gives_the_same_file(tmp_path):
    recording, until = drilling()
    for name in ("one.sr", "other.sr"):
        sigrok.write(tmp_path / name, Signals(recording, [BAR, DRILL], until))
    assert (tmp_path / "one.sr").read_bytes() == (tmp_path / "other.sr").read_bytes()


def decoded(path: Path, *options: str) -> list[str]:
    done = subprocess.run(["sigrok-cli", "-i", str(path), *options], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return [line.split(": ", 1)[1] for line in done.stdout.splitlines()]


@needs_sigrok
def test_sigroks_own_decoder_reads_the_characters(tmp_path):
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *heard("+300t\r", 2 * MS)])
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(recording, [BAR], 20 * MS))
    options = "uart:rx=bar.RXD:baudrate=9600:data_bits=7:parity=odd:stop_bits=2:format=hex"
    assert decoded(path, "-P", options, "-A", "uart=rx-data") == [f"{ord(c):02X}" for c in "+300t\r"]
    warnings = "uart=rx-parity-err:rx-warnings"
    assert decoded(path, "-P", options, "-A", warnings) == []


@needs_sigrok
def test_sigroks_own_decoder_counts_the_steps_and_their_direction(tmp_path):
    recording, until = drilling()
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(recording, [BAR, DRILL], until))
    steps = decoded(path, "-P", "stepper_motor:step=drill.CLOCK:dir=drill.DIR", "-A", "stepper_motor=position")
    # it tells the position of a step when the next one comes
    assert steps == [f"{n} steps" for n in [*range(1, 151), *range(149, 0, -1)]]


@needs_sigrok
def test_sigrok_takes_as_many_channels_as_twelve_units_have(tmp_path):
    names = [f"u{n}" for n in range(12)]
    path = tmp_path / "run.sr"
    sigrok.write(path, Signals(Recording(names), [BAR._replace(name=name) for name in names], MS))
    done = subprocess.run(["sigrok-cli", "-i", str(path), "--show"], capture_output=True, text=True, timeout=60)
    assert "- u11.UI1: logic" in done.stdout
