"""Channel Access on the wire: a put is answered after its monitors, and nothing that a client sends ends the server."""

import asyncio
import socket
import struct
from collections.abc import Callable, Coroutine
from typing import Any

import caproto
import pytest
from caproto import ChannelType, SubscriptionType
from tests.bridges.record_bench import Bench

from detent.bridges.epics.fields import Settings
from detent.bridges.epics.ioc import ServedMotor, serve
from detent.bridges.epics.server import OFTEN

SETTINGS = Settings(resolution=0.01, egu="mm", low=-50, high=50, velocity=10, base=2)
NATIVE = [ChannelType.STRING, ChannelType.INT, ChannelType.FLOAT, ChannelType.ENUM, ChannelType.CHAR,
          ChannelType.LONG, ChannelType.DOUBLE]  # fmt: skip
VALUES: dict[ChannelType, list[Any]] = {
    ChannelType.STRING: [[b""], [b"nan"], [b"Go"], [b"12.5"], [b"\xff" * 39], [b"1", b"2", b"3"]],
    ChannelType.INT: [[0], [1], [-32768], [32767], [1, 2, 3]],
    ChannelType.FLOAT: [[float("nan")], [float("-inf")], [3.4e38], [1e-40]],
    ChannelType.ENUM: [[0], [3], [65535]],
    ChannelType.CHAR: [[0], [255], [65, 0, 255, 10]],
    ChannelType.LONG: [[-(2**31)], [2**31 - 1]],
    ChannelType.DOUBLE: [[float("nan")], [float("inf")], [-1.7e308], [5e-324], [0.0], [-0.5], [1.0, 2.0]],
}


class Client:
    """A client of Channel Access that sees its circuit as the bytes come: `seen` are the messages in their order."""

    def __init__(self, port: int) -> None:
        self._port, self.seen = port, list[Any]()
        self._circuit = caproto.VirtualCircuit(caproto.CLIENT, ("127.0.0.1", port), priority=0)
        self._names: dict[str, Any] = {}
        self._ids = iter(range(1, 1 << 30))

    async def open(self) -> "Client":
        self._reader, self.writer = await asyncio.open_connection("127.0.0.1", self._port)
        await self.send(caproto.VersionRequest(priority=0, version=13))
        await self.until(caproto.VersionResponse)
        await self.send(caproto.HostNameRequest("here"), caproto.ClientNameRequest("tester"))
        return self

    async def send(self, *commands: Any) -> None:
        self.writer.write(b"".join(bytes(part) for part in self._circuit.send(*commands)))
        await self.writer.drain()

    async def until(self, kind: Any, **has: Any) -> Any:
        """The next message of a kind. What comes before it is in `seen`."""
        while True:
            for message in self.seen:
                if isinstance(message, kind) and all(getattr(message, name) == it for name, it in has.items()):
                    return message
            assert not any(isinstance(message, caproto.ErrorResponse) for message in self.seen), self.seen
            data = await asyncio.wait_for(self._reader.read(65536), 180)
            assert data, "the server has closed the circuit"
            commands, _ = self._circuit.recv(data)
            for command in commands:
                self._circuit.process_command(command)
                self.seen.append(command)

    async def channel(self, name: str) -> Any:
        if name not in self._names:
            made = caproto.ClientChannel(name, self._circuit)
            await self.send(made.create())
            await self.until(caproto.CreateChanResponse, cid=made.cid)
            self._names[name] = made
        return self._names[name]

    async def put(self, name: str, value: list[Any], kind: ChannelType) -> Any:
        """Put and wait: the answer, or the error in place of it."""
        channel = await self.channel(name)
        ioid = next(self._ids)
        await self.send(channel.write(value, data_type=kind, notify=True, ioid=ioid))
        return await self.until(caproto.WriteNotifyResponse, ioid=ioid)

    async def read(self, name: str, kind: ChannelType) -> Any:
        channel = await self.channel(name)
        ioid = next(self._ids)
        await self.send(channel.read(data_type=kind, ioid=ioid))
        return await self.until(caproto.ReadNotifyResponse, ioid=ioid)

    async def monitor(self, name: str, kind: ChannelType) -> int:
        channel = await self.channel(name)
        number = next(self._ids)
        mask = SubscriptionType.DBE_VALUE | SubscriptionType.DBE_ALARM
        await self.send(channel.subscribe(data_type=kind, subscriptionid=number, mask=mask))
        await self.until(caproto.EventAddResponse, subscriptionid=number)
        return number

    def close(self) -> None:
        self.writer.close()


class Served:
    """A record over the unit of a bench, served on loopback."""

    def __init__(self, bench: Bench, port: int, told: list[str]) -> None:
        self.bench, self.port, self.told = bench, port, told
        self._clients: list[Client] = []

    async def client(self) -> Client:
        self._clients.append(await Client(self.port).open())
        return self._clients[-1]

    def close(self) -> None:
        for client in self._clients:
            client.close()


def served(
    test: Callable[[Served], Coroutine[Any, Any, None]], monkeypatch: pytest.MonkeyPatch, model: str = "dcb-274"
) -> list[str]:
    """Run `test` against a served record; returned is what people would have been told."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setenv("EPICS_CA_SERVER_PORT", str(free.getsockname()[1]))
    monkeypatch.setenv("EPICS_CAS_BEACON_ADDR_LIST", "127.0.0.1")
    monkeypatch.setenv("EPICS_CAS_AUTO_BEACON_ADDR_LIST", "NO")
    told: list[str] = []

    async def all_of_it() -> None:
        bench = Bench(model, SETTINGS)
        await bench.begin()
        motor = ServedMotor("T:m1", bench.motor, SETTINGS, told.append)
        await motor.begin()
        bench.record = motor.record
        ready: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        serving = asyncio.create_task(serve([motor], ["127.0.0.1"], ready.set_result, told.append))
        await asyncio.wait({serving, ready}, return_when=asyncio.FIRST_COMPLETED)
        try:
            ioc = Served(bench, ready.result(), told)
            await test(ioc)
            ioc.close()
            assert not serving.done(), "the server goes on"
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            await asyncio.sleep(0.01)  # so that the streams may close

    asyncio.run(all_of_it())
    return told


@pytest.mark.parametrize("model", ["dcb-274", "gs-c200s", "bs0710", "supersigma"])
def test_a_put_is_answered_when_its_monitors_have_been_sent(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(ioc: Served) -> None:
        client = await ioc.client()
        kinds = {"T:m1.RBV": ChannelType.TIME_DOUBLE, "T:m1.DMOV": ChannelType.INT, "T:m1.MIP": ChannelType.ENUM,
                 "T:m1.RRBV": ChannelType.STRING}  # fmt: skip
        watched = {name: await client.monitor(name, kind) for name, kind in kinds.items()}
        for there in (1.0, 2.0, 3.0, 2.5, 2.0, 2.0):
            client.seen.clear()
            answer = await client.put("T:m1.VAL", [there], ChannelType.DOUBLE)
            assert answer.status.name == "ECA_NORMAL"
            before = client.seen[: client.seen.index(answer)]
            last = {
                message.subscriptionid: message.data[0]
                for message in before
                if isinstance(message, caproto.EventAddResponse)
            }
            assert last[watched["T:m1.DMOV"]] == 1
            assert last.get(watched["T:m1.RBV"], there) == there
            assert float(last.get(watched["T:m1.RRBV"], there * 100)) == there * 100
            others = [it for it in client.seen[len(before) + 1 :] if isinstance(it, caproto.EventAddResponse)]
            assert others == [], "nothing of the move comes after its answer"

    assert served(test, monkeypatch, model) == []


@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 12])
def test_every_field_is_monitored_read_and_put_in_every_type(
    every: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whatever is put, the server answers, has no traceback to tell, and the record moves as before."""

    async def test(ioc: Served) -> None:
        watching, client, stopping = [await ioc.client() for _ in range(3)]
        names = list(ServedMotor("T:m1", ioc.bench.motor, SETTINGS, print)._channels)
        assert len(names) > 150
        asked = [*NATIVE, ChannelType.TIME_DOUBLE, ChannelType.CTRL_INT, ChannelType.CTRL_ENUM, ChannelType.GR_STRING]
        for number, name in enumerate(names):
            for kind in asked if number % 7 == 0 else [asked[number % len(asked)]]:
                await watching.monitor(f"T:m1.{name}", kind)
            watching.seen.clear()
        moves = {"VAL", "DVAL", "RVAL", "RLV", "TWF", "TWR", "HOMF", "HOMR", "JOGF", "JOGR", "SPMG", "MRES", "OFF"}
        for number, name in enumerate(names):
            if number % every and name not in moves:
                continue
            for kind, values in VALUES.items():
                some = values if name in moves else [values[number % len(values)]]
                for value in some:
                    await ended(client, stopping, name, value, kind)
            for kind in asked:
                await client.read(f"T:m1.{name}", kind)
            client.seen.clear()
        for name, value in {"SPMG": 3, "SET": 0, "FOFF": 0, "DIR": 0}.items():
            await client.put(f"T:m1.{name}", [value], ChannelType.ENUM)
        await client.put("T:m1.STOP", [1], ChannelType.INT)
        for name, number_put in {"MRES": 0.01, "OFF": 0.0, "DLLM": -1e6, "DHLM": 1e6, "RDBD": 0, "DLY": 0}.items():
            await client.put(f"T:m1.{name}", [number_put], ChannelType.DOUBLE)
        for name, number_put in {"VMAX": 100.0, "VELO": 20.0, "VBAS": 1.0, "ACCL": 0.2}.items():
            await client.put(f"T:m1.{name}", [number_put], ChannelType.DOUBLE)
        answer = await client.put("T:m1.DVAL", [1.0], ChannelType.DOUBLE)
        assert answer.status.name == "ECA_NORMAL", ioc.told[-3:]
        assert ioc.bench["DRBV"] == 1

    async def ended(client: Client, stopping: Client, name: str, value: list[Any], kind: ChannelType) -> None:
        """Put, and end what that begins: a run to nowhere would go on."""
        put = asyncio.create_task(client.put(f"T:m1.{name}", value, kind))
        await asyncio.wait({put}, timeout=0.1)
        while not put.done():
            await stopping.put("T:m1.STOP", [1], ChannelType.INT)
        await put

    told = served(test, monkeypatch)
    assert capfd.readouterr() == ("", "")
    assert not [line for line in told if "Traceback" in line or "\n" in line or len(line) > 400]
    assert len(told) > 60, "a put that fails is told, in a line"


def test_datagrams_and_circuits_of_garbage_are_a_few_lines(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    async def test(ioc: Served) -> None:
        port = ioc.port
        shapes = [bytes(range(n % 256)) * (n % 3 + 1) for n in range(60)]
        shapes += [struct.pack(">HHHHII", n % 30, 8 * (n % 4), n, n % 7, n, n) + b"\xff" * (n % 33) for n in range(300)]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for shape in shapes:
                out.sendto(shape, ("127.0.0.1", port))
                await asyncio.sleep(0)
        for shape in shapes[::12]:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(shape)
            await asyncio.sleep(0)
            writer.close()
        client = await ioc.client()
        await client.send(caproto.EchoRequest())
        await client.put("T:m1.VAL", [1.0], ChannelType.DOUBLE)
        assert ioc.bench["RBV"] == 1

    told = served(test, monkeypatch)
    assert capfd.readouterr() == ("", "")
    assert len(told) <= OFTEN, told
    assert not [line for line in told if "Traceback" in line or "\n" in line or len(line) > 400]


def test_a_client_that_does_not_read_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(ioc: Served) -> None:
        deaf, client = await ioc.client(), await ioc.client()
        for _ in range(40):
            await deaf.monitor("T:m1.RBV", ChannelType.CTRL_DOUBLE)
        for there in (1.0, 20.0, -20.0, 0.0):
            assert (await client.put("T:m1.VAL", [there], ChannelType.DOUBLE)).status.name == "ECA_NORMAL"

    assert served(test, monkeypatch) == []
