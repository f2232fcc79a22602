import contextlib
import http.client
import json
import socket
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from typing import Any

import pytest
from tests.realtime.controlled import controlled, looping, one

from detent.realtime import verbs
from detent.realtime.control import Control
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.http import MOST_CLIENTS, MOST_WAITING, HttpControl, is_loopback
from detent.realtime.http1 import LONGEST_BODY
from detent.realtime.verbs import Answer

ANY = TcpAddress("127.0.0.1", 0)
TOKEN = "a secret of many letters"


@pytest.fixture
def served() -> Iterator[HttpControl]:
    with controlled(one()) as control:
        http = HttpControl(control, ANY)
        yield http
        http.close()


@pytest.fixture
def guarded() -> Iterator[HttpControl]:
    with controlled(one()) as control:
        http = HttpControl(control, ANY, TOKEN)
        yield http
        http.close()


def ask(
    http: HttpControl, method: str, path: str, body: object = None, headers: Mapping[str, str] = {}
) -> tuple[int, dict[str, Any], Mapping[str, str]]:
    connection = http_connection(http)
    data = body if isinstance(body, (bytes, str)) or body is None else json.dumps(body)
    connection.request(method, path, data, dict(headers))
    response = connection.getresponse()
    text = response.read()
    found = response.status, json.loads(text) if text else {}, dict(response.headers)
    connection.close()
    return found


def http_connection(served: HttpControl) -> http.client.HTTPConnection:
    return http.client.HTTPConnection(served.address.host, served.address.port, timeout=180)


def test_the_interface_describes_itself_as_openapi(served: HttpControl) -> None:
    status, found, _ = ask(served, "GET", "/openapi.json")
    assert (status, found["openapi"]) == (200, "3.1.0")
    assert set(found["paths"]) == {"/", *(f"/{name}" for name in verbs.VERBS)}
    for name, verb in verbs.VERBS.items():
        path = found["paths"][f"/{name}"]
        schema = path["post"]["requestBody"]["content"]["application/json"]["schema"]
        assert set(schema["properties"]) == {p.name for p in verb.parameters}
        assert set(schema.get("required", [])) == {p.name for p in verb.parameters if p.required}
        assert ("get" in path) == (not verb.changes)
    identifiers = [what["operationId"] for path in found["paths"].values() for what in path.values()]
    assert len(identifiers) == len(set(identifiers))
    assert ask(served, "POST", "/openapi.json")[0] == 405


def raw(served: HttpControl, data: bytes) -> bytes:
    """The whole answer to `data`."""
    with socket.create_connection(served.address[:2], timeout=180) as connected:
        connected.sendall(data)
        connected.shutdown(socket.SHUT_WR)
        answer = b""
        while more := connected.recv(4096):
            answer += more
        return answer


def test_the_root_lists_every_verb_with_its_arguments(served: HttpControl) -> None:
    status, listed, _ = ask(served, "GET", "/")
    assert status == 200
    assert [entry["verb"] for entry in listed["verbs"]] == list(verbs.VERBS)
    (fault,) = [entry for entry in listed["verbs"] if entry["verb"] == "fault"]
    assert fault["method"] == "POST"
    assert fault["arguments"][0]["name"] == "where"
    assert [entry["kind"] for entry in listed["faults"]] == list(verbs.FAULTS)


def test_what_changes_nothing_is_asked_with_get(served: HttpControl) -> None:
    status, state, headers = ask(served, "GET", "/state")
    assert status == 200
    assert state["units"]["gs-c200"]["state"] == "ready"
    assert headers["Cache-Control"] == "no-store"
    assert ask(served, "GET", "/pins?unit=gs-c200")[1]["pins"]["gs-c200"]["RDY"]["level"] == 1
    assert ask(served, "POST", "/state")[0] == 200


def test_what_changes_something_is_asked_with_post(served: HttpControl) -> None:
    status, told, headers = ask(served, "GET", "/pause")
    assert (status, headers["Allow"]) == (405, "POST")
    assert told == {"error": "GET is not for /pause", "remedy": "use POST"}
    assert ask(served, "POST", "/pause")[1]["paused"] is True
    fault = {"where": "line", "kind": "cable-out", "for": "1 s"}
    assert ask(served, "POST", "/fault", fault)[1]["fault"] == 1
    assert ask(served, "GET", "/faults")[1]["faults"][0]["kind"] == "cable-out"


def test_waiting_is_one_request(served: HttpControl) -> None:
    ask(served, "POST", "/type", {"text": "+100"})
    status, told, _ = ask(served, "POST", "/wait", {"position": 100, "state": "ready"})
    assert (status, told["reached"]) == (200, True)


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "error", "remedy"),
    [
        ("POST", "/fualt", {}, 404, "no verb 'fualt'", "did you mean fault?"),
        ("GET", "/state/units", None, 404, "no verb 'state/units'", "there are: state"),
        ("DELETE", "/state", None, 405, "DELETE is not for /state", "use POST"),
        ("POST", "/", {}, 405, "POST is not for /", "use GET"),
        ("BREW", "/state", None, 405, "Unsupported method ('BREW')", "GET / lists the verbs"),
        ("POST", "/type", {}, 400, "type: text is missing", "it takes text: the command line"),
        ("POST", "/type", {"txt": "V1"}, 400, "no argument of type 'txt'", "did you mean text?"),
        ("POST", "/type", b"{", 400, "the body is no JSON", "send an object"),
        ("POST", "/type", b"\xff\xfe\x00", 400, "the body is no JSON", "send an object"),
        ("POST", "/type", b"[" * 60000, 400, "the body is no JSON", "send an object"),
        ("POST", "/type", ["V1"], 400, "the body is no JSON object", "send arguments by name"),
        ("POST", "/type", {"text": {"a": 1}}, 400, "type: text cannot be {'a': 1}", "it takes text"),
        ("POST", "/type", b" " * (LONGEST_BODY + 1), 413, "is too long", "at most 65536 bytes"),
        ("GET", "/pins?unit=x", None, 400, "no unit 'x'", "there are: gs-c200"),
    ],
)
def test_every_error_is_json_with_a_remedy(
    served: HttpControl, method: str, path: str, body: object, status: int, error: str, remedy: str
) -> None:
    found, told, headers = ask(served, method, path, body)
    assert found == status
    assert error in told["error"]
    assert remedy in told["remedy"]
    assert headers["Content-Type"] == "application/json"


@pytest.mark.parametrize(
    ("headers", "error"),
    [
        ({"Host": "evil.example"}, "host 'evil.example' is not this one"),
        ({"Host": "127.0.0.1.evil.example:80"}, "is not this one"),
        ({"Host": "192.0.2.7"}, "is not this one"),
        ({"Host": "127.0.0.1:80.evil.example"}, "is not this one"),
        ({"Host": "127.0.0.1/evil.example"}, "is not this one"),
        ({"Host": "evil.example@127.0.0.1"}, "is not this one"),
        ({"Origin": "http://evil.example"}, "origin 'http://evil.example' may not ask"),
        ({"Origin": "null"}, "origin 'null' may not ask"),
        ({"Origin": "http://localhost:1"}, "may not ask"),
    ],
)
def test_pages_of_other_sites_and_names_that_were_pointed_here_are_turned_away(
    served: HttpControl, headers: dict[str, str], error: str
) -> None:
    status, told, _ = ask(served, "POST", "/pause", {}, headers)
    assert status == 403
    assert error in told["error"]
    assert ask(served, "GET", "/state")[1]["paused"] is False


@pytest.mark.parametrize("host", ["localhost", "localhost:8400", "127.0.0.1", "[::1]:8400", "LOCALHOST"])
def test_names_of_this_computer_are_served(served: HttpControl, host: str) -> None:
    assert ask(served, "GET", "/faults", None, {"Host": host})[0] == 200
    assert ask(served, "GET", "/faults", None, {"Host": host, "Origin": f"http://{host}"})[0] == 200


def test_a_request_without_a_host_is_turned_away(served: HttpControl) -> None:
    assert raw(served, b"GET /state HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    ("given", "error"),
    [
        (None, "a token is needed"),
        ("Bearer", "a token is needed"),
        ("Bearer wrong", "the token is wrong"),
        (f"Basic {TOKEN}", "the token is wrong"),
        (f"Bearer {TOKEN}x", "the token is wrong"),
        ("Bearer \xe4", "the token is wrong"),
    ],
)
def test_where_there_is_a_token_it_is_needed(guarded: HttpControl, given: str | None, error: str) -> None:
    headers = {} if given is None else {"Authorization": given}
    for method, path in (("GET", "/"), ("GET", "/state"), ("POST", "/pause"), ("GET", "/nothing")):
        status, told, answered = ask(guarded, method, path, None, headers)
        assert (status, told["error"], answered["WWW-Authenticate"]) == (401, error, "Bearer")
        assert "--token or $DETENT_TOKEN" in told["remedy"]


def test_who_has_the_token_may_come_by_any_name(guarded: HttpControl) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}", "Host": "bench.example:8400"}
    assert ask(guarded, "GET", "/faults", None, headers)[0] == 200
    assert ask(guarded, "GET", "/faults", None, headers | {"Origin": "http://evil.example"})[0] == 403


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "example.org"])
def test_what_other_computers_reach_needs_a_token(host: str) -> None:
    with controlled(one()) as control, pytest.raises(EndpointError, match="open to other computers: give --token TEXT"):
        HttpControl(control, TcpAddress(host, 0))


@pytest.mark.parametrize("host", ["0.0.0.0", "127.0.0.1"])
def test_a_token_that_can_be_guessed_is_refused(host: str) -> None:
    with controlled(one()) as control, pytest.raises(EndpointError, match="too short; at least 8"):
        HttpControl(control, TcpAddress(host, 0), "x")


@pytest.mark.parametrize(
    "token", ["        ", "a word\nof two", " before it", "nul\0nul\0nul", "日本語日本語日本語", "some\udcffwhere"]
)
def test_a_token_that_no_request_can_carry_is_refused(token: str) -> None:
    with controlled(one()) as control, pytest.raises(EndpointError, match=r"--token or \$DETENT_TOKEN: it has "):
        HttpControl(control, TcpAddress("127.0.0.1", 0), token)


def test_a_token_opens_it_to_other_computers() -> None:
    with controlled(one()) as control:
        http = HttpControl(control, TcpAddress("0.0.0.0", 0), TOKEN)
        assert http.url == f"http://127.0.0.1:{http.address.port}"
        http.close()


def test_a_port_that_is_taken_is_named() -> None:
    with controlled(one()) as control, socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(EndpointError, match=rf"127\.0\.0\.1:{port} cannot be listened on: Address already in use"):
            HttpControl(control, TcpAddress("127.0.0.1", port))


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("localhost", True), ("0.0.0.0", False),
     ("::", False), ("10.0.0.1", False), ("localhost.example.org", False), ("", False)],
)  # fmt: skip
def test_loopback_is_what_this_computer_alone_reaches(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback


@pytest.mark.parametrize(
    "data",
    [
        b"\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n",
        b"GET /" + b"a" * 70000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 300 + b"\r\n",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: many\r\n\r\n",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n{",
        b"GET / HTTP/1.1\r\nHost: [::\r\n\r\n",
        b"GET //[ HTTP/1.1\r\nHost: localhost\r\n\r\n",
    ],
)
def test_garbage_is_turned_away_without_a_traceback(
    served: HttpControl, capsys: pytest.CaptureFixture[str], data: bytes
) -> None:
    answer = raw(served, data)
    assert b"Traceback" not in answer
    assert b" 200 " not in answer.split(b"\r\n")[0]
    assert ask(served, "GET", "/faults")[0] == 200
    assert capsys.readouterr().err == ""


class Broken:
    """A control with a fault of its own."""

    def ask(self, verb: str, given: Mapping[str, object]) -> Future[Answer]:
        raise ZeroDivisionError("what should not be")

    def late(self, verb: str) -> Answer:
        raise NotImplementedError

    def end(self) -> None:
        pass


def test_a_fault_of_ours_is_told_in_a_line_and_logged_whole(capsys: pytest.CaptureFixture[str]) -> None:
    http = HttpControl(Broken(), ANY)
    status, told, _ = ask(http, "GET", "/state")
    http.close()
    assert (status, told["error"]) == (500, "ZeroDivisionError: what should not be")
    assert "Traceback" in capsys.readouterr().err


def test_many_clients_are_served_at_once(served: HttpControl) -> None:
    ask(served, "POST", "/pause")
    found: list[int] = []
    waiting = [
        threading.Thread(target=lambda: found.append(ask(served, "POST", "/wait", {"time": "100 s"})[0]))
        for _ in range(MOST_WAITING - 1)
    ]
    for thread in waiting:
        thread.start()
    assert ask(served, "GET", "/state")[0] == 200
    ask(served, "POST", "/wait", {"time": "101 s", "resume": True})
    for thread in waiting:
        thread.join()
    assert found == [200] * len(waiting)


def test_whoever_waits_when_it_ends_is_told_and_idle_clients_hold_nothing_up() -> None:
    with controlled(one()) as control:
        http = HttpControl(control, ANY)
        idle = socket.create_connection(http.address[:2])
        idle.sendall(b"GET /state HT")
        found: list[tuple[int, dict[str, Any]]] = []
        waiting = threading.Thread(target=lambda: found.append(ask(http, "POST", "/wait", {"position": 9})[:2]))
        waiting.start()
        until_waiting(control)
        http.close()
        waiting.join()
        idle.close()
    assert found == [(503, {"error": "the cell is not served any more", "remedy": "start it again: detent serve"})]


def test_slow_clients_cost_nobody_a_place_they_leave_when_another_comes(served: HttpControl) -> None:
    slow = [socket.create_connection(served.address[:2], timeout=180) for _ in range(MOST_CLIENTS)]
    for one_of_them in slow:
        one_of_them.sendall(b"POST /state HTTP/1.1\r\nHost: 127")
    assert ask(served, "GET", "/state")[0] == 200
    gone = []
    for one_of_them in slow:
        one_of_them.setblocking(False)
        try:
            gone.append(one_of_them.recv(1) == b"")
        except ConnectionError:
            gone.append(True)
        except BlockingIOError:
            gone.append(False)
        one_of_them.close()
    assert gone.index(True) == 0, "the first of them has waited for longest"


def test_clients_that_take_no_answer_cost_nobody_a_place(served: HttpControl) -> None:
    slow = [socket.create_connection(served.address[:2], timeout=180) for _ in range(MOST_CLIENTS + 20)]
    for one_of_them in slow:
        with contextlib.suppress(OSError):  # sent away already
            one_of_them.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert ask(served, "GET", "/state")[0] == 200
    for one_of_them in slow:
        one_of_them.close()


def test_more_than_so_many_cannot_wait_and_those_who_leave_make_room(served: HttpControl) -> None:
    ask(served, "POST", "/pause")
    body = b'{"time": "100 s"}'
    said = b"POST /wait HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)
    waiting = [socket.create_connection(served.address[:2], timeout=180) for _ in range(MOST_WAITING)]
    for one_of_them in waiting:
        one_of_them.sendall(said)
    short = {"time": "100 s", "timeout": "1 ms"}
    while (found := ask(served, "POST", "/wait", short)[:2])[0] != 503:
        assert found[1]["reached"] is False  # not all of them have been heard yet
    assert found[1]["error"] == f"{MOST_WAITING} clients wait for the cell already"
    assert ask(served, "GET", "/state")[0] == 200
    for one_of_them in waiting:
        one_of_them.close()
    while ask(served, "POST", "/wait", short)[0] == 503:
        pass  # until it is seen that they have left


def test_others_are_answered_while_a_step_takes_long_and_a_word_about_time_ends_it() -> None:
    with controlled(looping()) as control:
        http = HttpControl(control, ANY)
        ask(http, "POST", "/pause")
        found: list[dict[str, Any]] = []
        step = {"time": 1e6, "timeout": "1 h"}
        stepping = threading.Thread(target=lambda: found.append(ask(http, "POST", "/step", step)[1]))
        stepping.start()
        began = ask(http, "GET", "/state")[1]["time_ns"]
        while (now := ask(http, "GET", "/state")[1])["time_ns"] == began:
            pass
        assert now["paused"] is True
        stands = ask(http, "POST", "/pause")[1]["time_ns"]
        stepping.join()
        assert (found[0]["reached"], found[0]["time_ns"]) == (False, stands)
        assert ask(http, "POST", "/step", {"time": "1 s"})[1]["time_ns"] == stands + 1_000_000_000
        http.close()


def test_a_step_ends_when_the_client_who_asked_leaves() -> None:
    with controlled(looping()) as control:
        http = HttpControl(control, ANY)
        ask(http, "POST", "/pause")
        body = b'{"time": 1e6}'
        client = socket.create_connection(http.address[:2], timeout=180)
        client.sendall(b"POST /step HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
        while control._stepping is None:
            ask(http, "GET", "/faults")
        client.close()
        while not control._stepping.cancelled():
            ask(http, "GET", "/faults")
        stands = ask(http, "GET", "/state")[1]["time_ns"]
        assert ask(http, "GET", "/state")[1]["time_ns"] == stands
        http.close()


def test_it_ends_at_once_whatever_its_clients_are_about() -> None:
    with controlled(looping()) as control:
        http = HttpControl(control, ANY)
        ask(http, "POST", "/pause")
        clients = []
        for said in (
            b"", b"GET /sta", b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: 90\r\n\r\n{",
            b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
            b'POST /step HTTP/1.1\r\nHost: localhost\r\nContent-Length: 13\r\n\r\n{"time": 1e6}',
            b'POST /wait HTTP/1.1\r\nHost: localhost\r\nContent-Length: 13\r\n\r\n{"time": 1e9}',
        ):  # fmt: skip
            client = socket.create_connection(http.address[:2], timeout=180)
            client.sendall(said)
            clients.append(client)
        until_waiting(control)
        http.close()
        answers = []
        for client in clients:
            answer = b""
            with contextlib.suppress(ConnectionError):
                while more := client.recv(4096):
                    answer += more
            answers.append(answer[:13])
            client.close()
    assert answers == [b"", b"", b"", b"HTTP/1.1 200 ", b"HTTP/1.1 503 ", b"HTTP/1.1 503 "]


@pytest.mark.parametrize(
    "data",
    [
        b"GET /state HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\nContent-Length: 3\r\n\r\n{} ",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: +2\r\n\r\n{}",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: \xb2\r\n\r\n{}",
        b"POST /type HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + b"9" * 9000 + b"\r\n\r\n{}",
        b"GET /state HTTP/1.1\r\nHost: localhost\r\n folded\r\n\r\n",
        b"GET /state HTTP/1.1\r\nHo\0st: localhost\r\n\r\n",
        b"GET  /state HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /state\r\n\r\n",
    ],
)
def test_what_two_readers_could_read_in_two_ways_is_turned_away(served: HttpControl, data: bytes) -> None:
    assert raw(served, data).startswith(b"HTTP/1.1 400 ")


def test_a_client_that_asks_first_whether_it_may_send_its_body_is_told_so(served: HttpControl) -> None:
    with socket.create_connection(served.address[:2], timeout=180) as client:
        client.sendall(b"POST /faults HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n")
        assert client.recv(25, socket.MSG_WAITALL) == b"HTTP/1.1 100 Continue\r\n\r\n"
        client.sendall(b"{}")
        assert client.recv(13, socket.MSG_WAITALL) == b"HTTP/1.1 200 "


def until_waiting(control: Control) -> None:
    """Come back when somebody waits for the cell."""
    while not control._watched._waiters:
        control.ask("faults", {}).result()
