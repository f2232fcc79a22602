"""The motor records of `detent epics` as the standard clients of EPICS use them, unchanged."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import pytest

from detent.cell.description import single
from detent.cli import main
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.service import Service

DETENT = [sys.executable, "-c", "from detent.cli import main; main()", "epics"]
CELL = """
[units.stage]
model = "dcb-274"
[units.board]
model = "bs0710"
[switches.end]
axis = "board.X"
drives = ["board.LX+"]
from = 1000
[units.table]
model = "supersigma"
[units.slide]
model = "gs-c200s"
"""


def free_port() -> int:
    """A port that is free for datagrams and for connections."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        datagrams.bind(("127.0.0.1", 0))
        port: int = datagrams.getsockname()[1]
        return port


class Ioc(NamedTuple):
    """A running `detent epics` and the environment of its clients."""

    process: subprocess.Popen[str]
    ready: dict[str, Any]
    environment: dict[str, str]

    def client(self, script: str) -> dict[str, Any]:
        """What a client's script prints, as JSON."""
        ended = subprocess.run(
            [sys.executable, "-c", script], env=self.environment, capture_output=True, text=True, timeout=300
        )
        assert ended.returncode == 0, ended.stdout + ended.stderr
        told: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
        return told


@contextmanager
def running(command: list[str], environment: dict[str, str]) -> Iterator[Ioc]:
    with subprocess.Popen(
        [*DETENT, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as served:
        assert served.stdout is not None
        line = served.stdout.readline()
        assert line, served.communicate()[1]
        try:
            yield Ioc(served, json.loads(line), environment)
        finally:
            served.send_signal(signal.SIGTERM)
            out, err = served.communicate(timeout=180)
        assert (served.returncode, out, err) == (0, "", "")


@pytest.fixture(scope="module")
def ioc(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ioc]:
    folder = tmp_path_factory.mktemp("epics")
    (folder / "cell.toml").write_text(CELL)
    environment = {
        **os.environ,
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
        "EPICS_CAS_INTF_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_SERVER_PORT": str(free_port()),
        "EPICS_CA_REPEATER_PORT": str(free_port()),
    }
    settings = "--resolution 0.01 --egu mm --low -50 --high 50 --velocity 50 --base 0.5 --pace 5 --no-line-timing"
    with running([str(folder / "cell.toml"), *settings.split(), "--prefix", "T:", "--json"], environment) as made:
        yield made


def test_the_records_are_told_in_one_line(ioc: Ioc) -> None:
    assert ioc.ready["port"] == int(ioc.environment["EPICS_CA_SERVER_PORT"])
    assert [(motor["pv"], motor["unit"], motor["model"]) for motor in ioc.ready["motors"]] == [
        ("T:m1", "stage", "dcb-274"),
        ("T:m2", "board X", "bs0710"),
        ("T:m3", "board Y", "bs0710"),
        ("T:m4", "table", "supersigma"),
        ("T:m5", "slide", "gs-c200s"),
    ]


def test_caput_with_completion_and_caget_move_every_axis(ioc: Ioc) -> None:
    """The command-line clients of caproto use these calls, and `caput -c` this flag."""
    told = ioc.client("""
import json
from caproto.sync.client import read, write
told = {}
for number in (1, 3, 4, 5):
    pv = f"T:m{number}"
    write(pv, 2.5, notify=True, timeout=180, repeater=False)
    fields = (".RBV", ".VAL", ".RRBV", ".DMOV", ".MISS")
    told[pv] = [float(read(pv + field, repeater=False).data[0]) for field in fields]
    write(pv, 0, notify=True, timeout=180, repeater=False)
told["refused"] = write("T:m1", 51, notify=True, timeout=180, repeater=False).status.name
told["cannot"] = write("T:m4.HOMF", 1, notify=True, timeout=180, repeater=False).status.name
told["alarm"] = read("T:m4.SEVR", repeater=False).data[0].decode()
write("T:m4.SYNC", 1, notify=True, timeout=180, repeater=False)
told["settled"] = read("T:m4.SEVR", repeater=False).data[0].decode()
for field in ("EGU", "DESC", "RTYP"):
    told[field] = bytes(read("T:m1." + field, data_type="control" if field == "RTYP" else None, repeater=False)
                        .data[0]).decode()
print(json.dumps(told))
""")
    assert {pv: values for pv, values in told.items() if pv.startswith("T:")} == {
        f"T:m{number}": [2.5, 2.5, 250, 1, 0] for number in (1, 3, 4, 5)
    }
    assert (told["refused"], told["cannot"]) == ("ECA_PUTFAIL", "ECA_PUTFAIL"), "and the client is told so"
    assert (told["alarm"], told["settled"]) == ("MAJOR", "NO_ALARM")
    assert (told["EGU"], told["DESC"], told["RTYP"]) == ("mm", "stage", "motor")


def test_ophyd_moves_scans_and_is_held_back_by_limits(ioc: Ioc) -> None:
    told = ioc.client("""
import json, threading
from bluesky import RunEngine
from bluesky.plans import scan
from ophyd import EpicsMotor
from ophyd.sim import det
from ophyd.utils import LimitError
told = {}
# at once, the next move of a scan may begin while ophyd still tells of the last one, and then forgets who waits
motor = EpicsMotor("T:m1", name="motor", settle_time=0.05)
motor.wait_for_connection(timeout=180)
told["limits"] = list(motor.limits)
told["egu"] = motor.egu
told["moved"] = motor.move(5, timeout=180).success
told["position"] = motor.position
told["empty"] = motor.move(5, timeout=180).success
try:
    motor.move(51, timeout=180)
except LimitError as error:
    told["refused"] = type(error).__name__
motor.velocity.put(1, wait=True)  # so that there is time enough on the slowest computer
status = motor.move(40, wait=False)
while motor.position < 5.1:
    threading.Event().wait(0.001)
motor.stop()
try:
    status.wait(180)
except Exception as error:
    told["stopped"] = type(error).__name__
while motor.moving:
    threading.Event().wait(0.001)
told["where"] = motor.position
motor.velocity.put(50, wait=True)
motor.set_current_position(2)
told["set"] = motor.user_readback.get(use_monitor=False)
motor.user_offset.put(0, wait=True)
kinds = []
RunEngine()(scan([det], motor, 1, 3, 5), lambda name, document: kinds.append(name))
told["scan"] = kinds
told["last"] = motor.position
switched = EpicsMotor("T:m2", name="switched")
switched.wait_for_connection(timeout=180)
try:
    switched.move(40, timeout=180)
except Exception as error:
    told["limit switch"] = type(error).__name__
told["met"] = switched.high_limit_switch.get()
print(json.dumps(told))
""")
    assert told["limits"] == [-50, 50]
    assert told["egu"] == "mm"
    assert (told["moved"], told["position"], told["empty"]) == (True, 5, True)
    assert told["refused"] == "LimitError"
    assert told["stopped"] in ("UnknownStatusFailure", "RuntimeError")
    assert 5.1 <= told["where"] < 40
    assert told["set"] == 2
    assert told["scan"] == ["start", "descriptor", *["event"] * 5, "stop"]
    assert told["last"] == 3
    assert told["limit switch"] in ("UnknownStatusFailure", "RuntimeError")
    assert told["met"] == 1


def test_ophyd_async_moves_stops_and_scans(ioc: Ioc) -> None:
    told = ioc.client("""
import asyncio, json
from bluesky import RunEngine
from bluesky.plan_stubs import mv
from bluesky.plans import list_scan, scan
from ophyd.sim import det
from ophyd_async.core import FlyMotorInfo, init_devices
from ophyd_async.epics.motor import Motor, MotorLimitsError
told = {}
engine = RunEngine()
with init_devices(timeout=180):
    motor = Motor("ca://T:m3", name="motor")

async def by_hand():
    await motor.set(5)
    told["position"] = await motor.user_readback.get_value()
    await motor.set(5)
    try:
        await motor.set(51)
    except MotorLimitsError as error:
        told["refused"] = type(error).__name__
    await motor.velocity.set(1)
    status = motor.set(40)
    while await motor.user_readback.get_value() < 5.1:
        await asyncio.sleep(0.001)
    await motor.stop()
    try:
        await status
    except Exception as error:
        told["stopped"] = type(error).__name__
    while not await motor.motor_done_move.get_value():
        await asyncio.sleep(0.001)
    told["where"] = await motor.user_readback.get_value()
    await motor.velocity.set(50)

asyncio.run_coroutine_threadsafe(by_hand(), engine.loop).result(100)
kinds = []
engine(scan([det], motor, 1, 3, 5), lambda name, document: kinds.append(name))
told["scan"] = kinds
places = []
def keep(name, document):
    if name == "event":
        places.append(document["data"]["motor"])
engine(list_scan([det], motor, [0, 1, 2, 3, 2.5, 2]), keep)
told["places"] = places
engine(mv(motor, 0))

async def flies():
    told["most"] = await motor.max_velocity.get_value()
    await motor.prepare(FlyMotorInfo(start_position=1, end_position=3, time_for_move=1))
    await motor.kickoff()
    await motor.complete()
    told["flown"] = await motor.user_readback.get_value()

asyncio.run_coroutine_threadsafe(flies(), engine.loop).result(100)
print(json.dumps(told))
""")
    assert told["position"] == 5
    assert told["places"] == [0, 1, 2, 3, 2.5, 2], "documents have the positions of their own points"
    assert told["most"] == 625, "62 500 microsteps/s of 0.01 mm"
    assert told["flown"] >= 3
    assert told["refused"] == "MotorLimitsError"
    assert told["stopped"] == "RuntimeError"
    assert 5.1 <= told["where"] < 40
    assert told["scan"] == ["start", "descriptor", *["event"] * 5, "stop"]


def test_a_unit_at_a_port_is_moved_too(ioc: Ioc) -> None:
    """Real or emulated is one to the driver: here the port is a pseudo-terminal."""
    environment = {**ioc.environment, "EPICS_CA_SERVER_PORT": str(free_port())}
    with Service(single("gs-c200s"), lambda file: "", [EndpointSpec("pty")], pace=20) as service:
        with (
            service.in_thread(),
            running(["gs-c200s", service.endpoints[0].address, "--json"], environment) as other,
        ):
            told = other.client("""
import json
from caproto.sync.client import read, write
write("SIM:m1", -25, notify=True, timeout=180, repeater=False)
print(json.dumps({"RBV": float(read("SIM:m1.RBV", repeater=False).data[0])}))
""")
        assert told == {"RBV": -25}
        assert service.cell.controller("gs-c200s").status(service.cell.now).position == -25


@pytest.mark.parametrize("text", ["99999", "0", "abc", "-1", "", "9" * 5000, "\u0661"])
def test_a_port_of_the_environment_that_is_none_is_refused_in_a_line(
    text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("EPICS_CA_SERVER_PORT", text)
    code, err = said(capsys, "gs-c200s", "--interfaces", "127.0.0.1")
    assert code == 2
    assert "$EPICS_CA_SERVER_PORT" in err
    assert len(err) < 200


def test_the_clients_that_are_named_look_where_the_records_are_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of two servers with one port the second has its connections elsewhere; searches still go to the one."""
    monkeypatch.setenv("EPICS_CA_SERVER_PORT", "5064")  # and taken back, whatever the verb makes of it

    async def ready_at_once(motors: object, interfaces: object, ready: Callable[[int], None], report: object) -> None:
        ready(50_000)

    monkeypatch.setattr("detent.bridges.epics.ioc.serve", ready_at_once)
    with pytest.raises(SystemExit):
        main(["epics", "gs-c200s", "--interfaces", "127.0.0.1", "--ca-port", "18777"])
    told = capsys.readouterr().out
    assert "port 18777:" in told
    assert "EPICS_CA_SERVER_PORT=18777 caget SIM:m1.RBV" in told
    assert "connections go to 50000" in told
    assert "CA_SERVER_PORT=50000" not in told


def said(capsys: pytest.CaptureFixture[str], *choices: str) -> tuple[object, str]:
    with pytest.raises(SystemExit) as ended:
        main(["epics", *choices])
    return ended.value.code, capsys.readouterr().err


@pytest.mark.parametrize(
    ("choices", "why"),
    [
        ([], "say what to serve"),
        (["gs-c201"], "did you mean gs-c200"),
        (["gs-c200", "--resolution", "m2=1"], "no record 'm2'; .*there are: m1"),
        (["gs-c200", "--resolution", "wide"], "--resolution: 'wide' is no number"),
        (["gs-c200", "--resolution", "0"], "m1: a resolution of 0 is no resolution"),
        (["gs-c200", "--low", "2", "--high", "-2"], "m1: the low limit 2 lies above the high limit -2"),
        (["gs-c200", "--ca-port", "70000"], "--ca-port: 70000 is no port"),
        (["gs-c200", "/dev/ttyS9", "--pace", "2"], "--pace and --no-line-timing are for emulated units"),
        (["cell.toml", "/dev/ttyS9"], "a cell is emulated: leave PORT out"),
        (["gs-c200", "/dev/ttyS9", "--motor", "X"], "--motor is not for a gs-c200"),
        (["gs-c200", "--velocity", "1e9"], "m1: .*rate"),
    ],
)
def test_what_cannot_be_served_is_said_in_one_line(
    choices: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, err = said(capsys, *choices)
    assert code == 2
    assert re.search(why, err), err
    assert err.count("\n") == 1


def test_a_port_that_is_not_there_fails_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    code, err = said(capsys, "gs-c200", "/dev/no-such-port")
    assert code == 1
    assert err.startswith("detent: /dev/no-such-port cannot be opened: ")
    assert err.count("\n") == 1


def test_an_address_that_is_not_this_computers_fails_in_one_line() -> None:
    words = ["epics", "gs-c200", "--interfaces", "192.0.2.1"]  # an address of documentation (RFC 5737)
    # in a process of its own: the sockets that caproto has tried are left to the collector
    ended = subprocess.run([sys.executable, "-m", "detent", *words], capture_output=True, text=True, timeout=180)
    assert ended.returncode == 1
    assert ended.stderr.startswith("detent: Channel Access cannot be served: ")
    assert "choose another --ca-port or --interfaces" in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "at"),
    [
        ([], "1000"),
        (["--resolution", "0.0025", "--low", "-10", "--high", "40"], "2"),
        (["--resolution", "0.01", "--velocity", "50", "--low", "-10", "--high", "40"], "20"),
        (["--low", "-40", "--high", "-10"], "-20"),
        (["--low", "30", "--high", "40"], "35"),
        (["--resolution", "0.0025", "--velocity", "5", "--low", "0", "--high", "0.001"], "0.0005"),
    ],
)
def test_the_line_to_try_is_within_the_limits(options: list[str], at: str, capsys: pytest.CaptureFixture[str]) -> None:
    def serve(_prefix: str, _axes: object, _interfaces: object, ready: Callable[[int], None], **_: object) -> object:
        async def nothing() -> None:
            ready(5064)

        return nothing()

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("detent.cli.epics._serve", serve)
        patched.delenv("EPICS_CAS_INTF_ADDR_LIST", raising=False)
        with pytest.raises(SystemExit) as ended:
            main(["epics", "gs-c200s", *options])
    out = capsys.readouterr().out
    assert ended.value.code == 0
    assert f"  caput -c -w 60 SIM:m1 {at}\n" in out
    assert "--interfaces 127.0.0.1 keeps it to this computer" in out


def test_the_names_of_the_fields_are_listed_and_that_is_all(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["epics", "bs0610", "--list-pvs", "--prefix", "A:"])
    names = capsys.readouterr().out.splitlines()
    assert ended.value.code == 0
    assert {"A:m1.VAL", "A:m2.VAL", "A:m1.ACCS", "A:m1.ACCU", "A:m1.RHLM", "A:m1.RLLM", "A:m1.RSTM"} <= set(names)
    assert len(names) == len(set(names))
