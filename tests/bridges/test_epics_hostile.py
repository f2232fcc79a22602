"""Clients of Channel Access that mean harm, or are broken: no value that is none moves the unit, and all are served."""

import asyncio
import socket
import struct
from typing import Any

import caproto
import pytest
from caproto import ChannelType
from tests.bridges.test_epics_puts import Client, Served, served

from detent.bridges.epics import client_limits
from detent.bridges.epics import ioc as served_records
from detent.bridges.epics import server as channel_access
from detent.bridges.epics.values import check_number

ONE = struct.pack(">d", 1.0)


def request(command: int, payload: bytes, kind: int, count: int, first: int, second: int, size: int = -1) -> bytes:
    """A message as bytes, whatever it says of itself."""
    payload += bytes(-len(payload) % 8)
    size = len(payload) if size < 0 else size
    if size < 0xFFFF:
        return struct.pack(">HHHHII", command, size, kind, count, first, second) + payload
    return struct.pack(">HHHHIIII", command, 0xFFFF, kind, 0, first, second, size, count) + payload


async def put_raw(client: Client, name: str, payload: bytes, kind: int, count: int) -> int:
    """Put what no client of caproto's would, and wait: the status of the answer."""
    channel = await client.channel(name)
    ioid = next(client._ids)
    client._circuit._ioids[ioid] = channel  # so that it knows the answer
    client.writer.write(request(19, payload, kind, count, channel.sid, ioid))
    answer = await client.until(caproto.WriteNotifyResponse, ioid=ioid)
    return int(answer.header.parameter1)


async def gone(client: Client) -> bool:
    """Whether the server is rid of this client, within a minute."""
    try:
        async with asyncio.timeout(60):
            await client._reader.read()  # to its end
    except ConnectionError:
        return True
    except TimeoutError:  # which is an OSError, too
        return False
    return True


TEXTS = [b"", b" ", b"1_0", b"0x10", b"5mm", b"nan", b"inf", b"-infinity", b"1e999", "٣".encode(), b"1,5", b"True",
         b"\xff\xfe", b"1.2.3", b"--1", b"e5", b"."]  # fmt: skip
LIES = [(ONE, 6, 0), (b"", 6, 1), (ONE, 6, 5), (ONE, 6, 65535), (b"", 0, 1), (b"1".ljust(40, b"\0"), 0, 2),
        *[(ONE * 60, kind, 1) for kind in [*range(7, 35), 37, 38]]]  # fmt: skip
DOUBLES = [float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 57.1, -57.1, 2.0**31]


@pytest.mark.parametrize("field", ["", ".DVAL", ".RVAL", ".RLV"])
def test_no_value_that_is_none_moves_the_unit(field: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(ioc: Served) -> None:
        client = await ioc.client()
        await client.put("T:m1", [7.0], ChannelType.DOUBLE)
        steps = ioc.bench["RRBV"]
        bad = [*((text.ljust(40, b"\0"), 0, 1) for text in TEXTS), *LIES]
        bad += [(struct.pack(">d", number * (100 if field == ".RVAL" else 1)), 6, 1) for number in DOUBLES]
        for payload, kind, count in bad:
            assert await put_raw(client, f"T:m1{field}", payload, kind, count) != 1, (payload, kind, count)
            assert ioc.bench["RRBV"] == steps, (payload, kind, count)
        assert await put_raw(client, "T:m1", b" -1.5e0\n\0left over", 0, 1) == 1
        assert ioc.bench["RBV"] == -1.5

    told = served(test, monkeypatch)
    assert len(told) >= 25
    assert not [line for line in told if "\n" in line or len(line) > 400]


@pytest.mark.parametrize("text", [b"1", b"-1.5", b"+.5e-3", b"2.", b" 7\n", b"1e5"])
def test_what_is_a_number_is_one(text: bytes) -> None:
    check_number([text, text + b"\0and what was there before"])


def test_a_message_without_an_end_costs_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(ioc: Served) -> None:
        bad, client = await ioc.client(), await ioc.client()
        channel = await bad.channel("T:m1")
        bad.writer.write(request(19, b"", 6, 1 << 29, channel.sid, 1, size=(1 << 32) - 8) + bytes(200_000))
        assert await gone(bad)
        assert (await client.put("T:m1", [1.0], ChannelType.DOUBLE)).status.name == "ECA_NORMAL"

    told = served(test, monkeypatch)
    assert len([line for line in told if "more than 16384 bytes" in line]) == 1, told
    assert not [line for line in told if "\n" in line or len(line) > 400], told


def test_a_client_that_says_much_at_once_keeps_no_other_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the two, each command of the second is served behind few of the first."""
    served_in_order: list[type] = []
    usual = channel_access.Circuit._process_command

    async def noted(circuit: Any, command: Any) -> Any:
        served_in_order.append(type(command))
        return await usual(circuit, command)

    monkeypatch.setattr(channel_access.Circuit, "_process_command", noted)

    async def test(ioc: Served) -> None:
        loud, client = await ioc.client(), await ioc.client()
        stop = await client.channel("T:m1.STOP")
        served_in_order.clear()
        loud.writer.write(b"".join(request(18, b"T:m1\0", 0, 0, number, 13) for number in range(9, 3009)))
        while not served_in_order:
            await asyncio.sleep(0)
        before = len(served_in_order)
        assert before < 10, "others have their turn between two commands"
        await client.send(stop.write([1], notify=True, ioid=1))
        await client.until(caproto.WriteNotifyResponse, ioid=1)
        assert served_in_order.index(caproto.WriteNotifyRequest) < before + 100

    served(test, monkeypatch)


def test_of_one_client_not_more_puts_are_under_way_than_a_bound_and_a_stop_is_heard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(channel_access, "PUTS", 20)

    async def test(ioc: Served) -> None:
        client = await ioc.client()
        channel = await client.channel("T:m1")
        await client.channel("T:m1.STOP")
        await client.put("T:m1.JVEL", [1.0], ChannelType.DOUBLE)
        jog = await client.channel("T:m1.JOGF")
        await client.send(jog.write([1], notify=False))
        flood = [channel.write([float(number)], notify=True, ioid=1000 + number) for number in range(100)]
        await client.send(*flood)
        refused = [await client.until(caproto.WriteNotifyResponse, ioid=1000 + number) for number in range(60, 100)]
        assert {answer.status.name for answer in refused} == {"ECA_PUTFAIL"}
        assert (await client.put("T:m1.STOP", [1], ChannelType.INT)).status.name == "ECA_NORMAL"
        assert ioc.bench["DMOV"] == 1
        for number in range(100):
            await client.until(caproto.WriteNotifyResponse, ioid=1000 + number)
        assert (await client.put("T:m1", [2.0], ChannelType.DOUBLE)).status.name == "ECA_NORMAL"
        assert ioc.bench["RBV"] == 2

    told = served(test, monkeypatch)
    assert any("more than 20 puts" in line for line in told)


def test_the_client_that_is_silent_longest_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_limits, "CLIENTS", 3)

    async def test(ioc: Served) -> None:
        silent, *others = [await ioc.client() for _ in range(3)]
        for client in others:
            await client.read("T:m1.RBV", ChannelType.DOUBLE)
        for _ in range(4):
            newer = await ioc.client()
            await newer.read("T:m1.RBV", ChannelType.DOUBLE)
            await others[1].read("T:m1.RBV", ChannelType.DOUBLE)
        assert await gone(silent)
        assert await gone(others[0])
        assert (await others[1].put("T:m1", [1.0], ChannelType.DOUBLE)).status.name == "ECA_NORMAL"

    assert any("silent longest" in line for line in served(test, monkeypatch))


@pytest.mark.parametrize("what", ["WATCHED", "HELD"])
def test_the_client_that_holds_most_makes_room(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_limits, what, 40)

    async def test(ioc: Served) -> None:
        greedy, client = await ioc.client(), await ioc.client()
        for _ in range(5):
            await client.monitor("T:m1.RBV", ChannelType.DOUBLE)
        channel = await greedy.channel("T:m1.RBV")
        for number in range(1, 60):
            greedy.writer.write(request(1, struct.pack(">fffHH", 0, 0, 0, 1, 0), 6, 1, channel.sid, number))
        assert await gone(greedy)
        for _ in range(5):
            await client.monitor("T:m1.RBV", ChannelType.DOUBLE)
        assert (await client.put("T:m1", [1.0], ChannelType.DOUBLE)).status.name == "ECA_NORMAL"

    assert any("with most of them was left" in line for line in served(test, monkeypatch))


def test_nothing_is_kept_of_a_client_that_left(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    class Seen(channel_access.Context):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            made.append(self)

    monkeypatch.setattr(served_records, "Context", Seen)

    async def test(ioc: Served) -> None:
        for number in range(4):
            client = await ioc.client()
            for name in (f'T:m1.RBV{{"dbnd":{{"abs":{number}.5}}}}', 'T:m1.VAL{"ts":{}}', "T:m1.DMOV"):
                await client.monitor(name, ChannelType.TIME_DOUBLE)
            client.close()
        client = await ioc.client()
        await client.read("T:m1.RBV", ChannelType.DOUBLE)
        while len(made[0].circuits) > 1:
            await asyncio.sleep(0)
        for kept in (made[0].subscriptions, made[0].last_dead_band, made[0].last_sync_edge_update):
            assert not kept

    served(test, monkeypatch)


def test_a_search_in_a_datagram_that_no_client_would_send_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(ioc: Served) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            out.bind(("127.0.0.1", 0))
            out.setblocking(False)
            search = request(6, b"T:m1\0", 5, 13, 0, 0)
            out.sendto(search * 200, ("127.0.0.1", ioc.port))
            out.sendto(request(6, b"T:m1\0", 5, 13, 99, 99), ("127.0.0.1", ioc.port))
            loop = asyncio.get_running_loop()
            answer = await asyncio.wait_for(loop.sock_recv(out, 65536), 60)
            assert answer[-4:] == struct.pack(">I", 99) or b"\0\0\0\x63" in answer
            assert len(answer) < 100

    assert served(test, monkeypatch) == []
