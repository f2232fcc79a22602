"""Who is let in, and what files a window can reach."""

import asyncio
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from detent.workbench.drafts import LONGEST, Draft, Drafts
from detent.workbench.folder import LARGEST, Folder, OutsideFolder
from detent.workbench.guard import Guard, check_place, is_loopback
from detent.workbench.listening import Listening

TOKEN = "a word of my own"


async def everything(scope: Any, receive: Any, send: Any) -> None:
    """An application that lets everybody in."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"in"})


def ask(guard: Guard, *headers: tuple[str, str], kind: str = "http", method: str = "GET", path: str = "/",
        query: str = "") -> dict[str, Any]:  # fmt: skip
    """The first message of the answer to a request."""
    sent: list[dict[str, Any]] = []
    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "query_string": query.encode(),
        "headers": [(name.encode(), value.encode("latin-1")) for name, value in headers],
    }

    async def receive() -> dict[str, Any]:
        return {"type": f"{kind}.connect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    asyncio.run(guard(scope, receive, send))  # type: ignore[arg-type]
    return sent[0]


def status(*args: Any, **keywords: Any) -> int:
    """The status of the answer; of a WebSocket: 101 if it was accepted, else its close code."""
    message = ask(*args, **keywords)
    if message["type"].startswith("websocket"):
        return 101 if message["type"] == "websocket.accept" else int(message["code"])
    return int(message["status"])


HERE = ("host", "127.0.0.1:8080")
OWN = ("origin", "http://127.0.0.1:8080")


@pytest.fixture
def loopback() -> Guard:
    return Guard(everything, "127.0.0.1")


@pytest.fixture
def open_to_all() -> Guard:
    return Guard(everything, "0.0.0.0", TOKEN, names=("bench7",))


def test_an_address_that_others_can_reach_needs_a_token() -> None:
    for host in ("0.0.0.0", "192.168.1.4", "::", "bench7"):
        with pytest.raises(ValueError, match="--token"):
            check_place(host, None)
        check_place(host, TOKEN)
    for host in ("127.0.0.1", "127.3.2.1", "::1", "localhost"):
        assert is_loopback(host)
        check_place(host, None)
    with pytest.raises(ValueError, match="too short"):
        check_place("0.0.0.0", "short")
    for token in ("        ", " before it", "behind it\n", "some\udcffwhere", "tab\there", "nul\0nul\0"):
        with pytest.raises(ValueError, match="cannot be seen"):
            check_place("127.0.0.1", token)
    check_place("0.0.0.0", "a word of your öwn")


def test_a_page_on_loopback_is_served_to_whoever_asks_by_its_name(loopback: Guard) -> None:
    for host in ("127.0.0.1:8080", "localhost:8080", "LOCALHOST:8080", "[::1]:8080", "localhost:9000"):
        assert status(loopback, ("host", host)) == 200


FOREIGN = ["evil.example:8080", "127.0.0.1.evil.example", "192.168.1.4:8080", "", "a b", "[::1"]
HARDLY_A_NAME = [
    "127.0.0.1:8080.evil.example", "127.0.0.1:8080@evil.example", "evil.example@127.0.0.1:8080",
    "127.0.0.1/evil.example",
    "127.0.0.1:", "127.0.0.1:http", "[::1]evil.example", "127.0.0.1:80 ", "127.0.0.1?x", "127.0.0.1#", "127.0.0.1\\x",
    ":8080",
]  # fmt: skip


@pytest.mark.parametrize("host", [*FOREIGN, *HARDLY_A_NAME])
def test_a_foreign_name_that_points_here_is_refused(loopback: Guard, host: str) -> None:
    assert status(loopback, ("host", host)) == 403
    assert status(loopback, ("host", host), ("origin", f"http://{host}"), kind="websocket") == 1008


def test_a_request_without_a_host_or_with_two_is_refused(loopback: Guard) -> None:
    assert status(loopback) == 403
    assert status(loopback, HERE, ("host", "evil.example")) == 403


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://127.0.0.1:8081", "http://127.0.0.1", "file://", "http://127.0.0.1:8080.evil.example"],
)  # fmt: skip
def test_a_page_of_another_origin_is_refused_on_every_way_in(loopback: Guard, origin: str) -> None:
    for path in ("/", "/live", "/_nicegui_ws/socket.io/", "/assets/workbench.js"):
        assert status(loopback, HERE, ("origin", origin), path=path) == 403
        assert status(loopback, HERE, ("origin", origin), path=path, method="POST") == 403
        assert status(loopback, HERE, ("origin", origin), path=path, kind="websocket") == 1008


def test_a_socket_and_whatever_changes_something_must_say_where_it_comes_from(loopback: Guard) -> None:
    assert status(loopback, HERE, kind="websocket") == 1008
    assert status(loopback, HERE, method="POST") == 403
    assert status(loopback, HERE, OWN, kind="websocket") == 101
    assert status(loopback, HERE, OWN, method="POST") == 200


def test_nothing_may_be_loaded_from_elsewhere_and_nobody_may_frame_the_pages(loopback: Guard) -> None:
    headers = dict(ask(loopback, HERE)["headers"])
    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert not any(word.startswith(("http", "*")) for word in policy.replace(";", " ").split())
    assert headers[b"x-frame-options"] == b"DENY"
    assert b"content-security-policy" in dict(ask(loopback)["headers"])  # a refusal has them too


def test_without_the_token_nothing_is_served(open_to_all: Guard) -> None:
    assert status(open_to_all, HERE) == 401
    assert status(open_to_all, HERE, query="token=wrong+word") == 401
    assert status(open_to_all, HERE, query="token=") == 401
    assert status(open_to_all, HERE, ("cookie", "detent=nothing; x")) == 401
    assert status(open_to_all, HERE, OWN, kind="websocket") == 1008


@pytest.mark.parametrize("token", ["a word of my own", "100 % + 1 & 2 = 3", "where?now#here", "Schl\u00fcssel/1"])
def test_the_address_that_is_printed_lets_in_whatever_the_token_is(token: str) -> None:
    with socket.socket() as bound:
        path, _, query = Listening(bound, "127.0.0.1", 8274).url(token).partition("?")
    assert path == "http://127.0.0.1:8274/"
    assert not set(query) & set(" #"), "as a terminal finds its end, and a browser"
    assert Guard(everything, "127.0.0.1", token).check_token(query, [])


def test_the_token_in_the_address_becomes_a_cookie_and_leaves_the_address(open_to_all: Guard) -> None:
    answer = ask(open_to_all, HERE, path="/scope", query="token=a+word+of+my+own&zoom=2")
    headers = dict(answer["headers"])
    assert (answer["status"], headers[b"location"]) == (303, b"/scope?zoom=2")
    cookie = headers[b"set-cookie"].decode()
    assert TOKEN not in cookie
    assert "HttpOnly" in cookie
    pair = ("cookie", f"other=1; {cookie.partition(';')[0]}")
    assert status(open_to_all, HERE, pair) == 200
    assert status(open_to_all, HERE, OWN, pair, kind="websocket") == 101
    assert status(open_to_all, HERE, ("origin", "http://evil.example"), pair, kind="websocket") == 1008
    assert status(Guard(everything, "0.0.0.0", "another word"), HERE, pair) == 401


def test_a_way_back_with_two_slashes_leads_to_no_other_machine(open_to_all: Guard) -> None:
    answer = ask(open_to_all, HERE, path="//evil.example/", query="token=a+word+of+my+own")
    assert dict(answer["headers"])[b"location"] == b"/evil.example/"


@pytest.mark.parametrize(
    "path", ["/\t/evil.example", "/\n//evil.example", "/\\evil.example", "\\\\evil.example", "/\r\n/x"]
)
def test_a_way_back_holds_nothing_that_a_browser_leaves_out(open_to_all: Guard, path: str) -> None:
    """Browsers drop tabs and line ends in an address, and take backslashes for slashes (URL standard, 4.4)."""
    headers = dict(ask(open_to_all, HERE, path=path, query="token=a+word+of+my+own")["headers"])
    location = headers[b"location"].decode()
    assert location.startswith("/")
    assert location[1:2] not in ("/", "\\")
    assert not set(location) & set("\t\r\n\\")
    assert headers[b"cache-control"] == b"no-store"


@pytest.mark.parametrize("origin", ["http://[", "http://[::1", "http://]", "//", "", "http://127.0.0.1:8080\t", "\x00"])
def test_an_origin_that_cannot_be_understood_is_refused(loopback: Guard, origin: str) -> None:
    message = ask(loopback, HERE, ("origin", origin))
    assert message["status"] == 403
    assert b"content-security-policy" in dict(message["headers"])
    assert status(loopback, HERE, ("origin", origin), kind="websocket") == 1008


def test_with_a_token_the_machine_answers_to_its_addresses_and_its_name_only(open_to_all: Guard) -> None:
    cookie = dict(ask(open_to_all, HERE, query="token=a+word+of+my+own")["headers"])[b"set-cookie"].decode()
    pair = ("cookie", cookie.partition(";")[0])
    for host in ("192.168.1.4:8080", "bench7:8080", "BENCH7", "[fe80::1]:8080", "localhost:8080"):
        assert status(open_to_all, ("host", host), pair) == 200
    assert status(open_to_all, ("host", "evil.example"), pair) == 403


# -- files ------------------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    root = tmp_path / "chosen"
    root.mkdir()
    (root / "bar.gsc").write_text("+250\n")
    (root / "below").mkdir()
    (root / "below" / "drill.gsc").write_text("G0\n")
    (root / ".secret").write_text("x")
    (tmp_path / "outside.gsc").write_text("outside")
    (root / "link.gsc").symlink_to(tmp_path / "outside.gsc")
    (root / "up").symlink_to(tmp_path)
    return Folder(root)


OUTSIDE = ["../outside.gsc", "below/../../outside.gsc", "link.gsc", "up/outside.gsc", "up", ".", "", "below/..",
           ".secret", "a\0b", "..\\outside.gsc", "/etc/passwd"]  # fmt: skip


@pytest.mark.parametrize("name", OUTSIDE)
def test_no_name_leads_out_of_the_chosen_folder(folder: Folder, name: str, tmp_path: Path) -> None:
    tries: list[Callable[[], object]] = [
        lambda: folder.read(name),
        lambda: folder.read_text(name),
        lambda: folder.write(name, b"broken"),
    ]
    for attempt in tries:
        with pytest.raises(OutsideFolder):
            attempt()
    assert (tmp_path / "outside.gsc").read_text() == "outside"


def test_an_absolute_name_is_refused_even_if_it_lies_in_the_folder(folder: Folder) -> None:
    with pytest.raises(OutsideFolder, match="relative"):
        folder.read(str(folder.root / "bar.gsc"))


def test_files_in_the_folder_are_listed_opened_and_saved_whole(folder: Folder) -> None:
    assert folder.names([".gsc"]) == ["bar.gsc", "below/drill.gsc"]
    assert folder.read_text("below/drill.gsc") == "G0\n"
    folder.write("new/one.gsc", b"+1\n")
    assert (folder.root / "new" / "one.gsc").read_bytes() == b"+1\n"
    folder.write("bar.gsc", b"+2\n")
    assert folder.read("bar.gsc") == b"+2\n"
    assert not list(folder.root.glob(".*bar*"))


def test_what_is_no_text_and_what_is_not_there_is_said_in_words(folder: Folder) -> None:
    (folder.root / "image.bin").write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="no text file"):
        folder.read_text("image.bin")
    with pytest.raises(FileNotFoundError, match="no such file"):
        folder.read("nothing.gsc")
    with pytest.raises(OutsideFolder, match="is a folder"):
        folder.write("below", b"")


def test_a_chosen_folder_must_be_one(tmp_path: Path) -> None:
    with pytest.raises(OutsideFolder, match="no folder"):
        Folder(tmp_path / "nothing")


# -- drafts -----------------------------------------------------------------------------------------------------


def test_a_draft_outlives_whoever_kept_it(tmp_path: Path) -> None:
    Drafts(tmp_path, "cell-1").keep("bar", Draft("+250\nµ\n", "bar.gsc"))
    assert Drafts(tmp_path, "cell-1").get("bar") == Draft("+250\nµ\n", "bar.gsc")
    assert Drafts(tmp_path, "cell-1").get("drill") is None
    assert Drafts(tmp_path, "cell-2").get("bar") is None


def test_a_draft_is_one_file_that_nothing_but_forgetting_removes(tmp_path: Path) -> None:
    drafts = Drafts(tmp_path, "cell-1")
    drafts.keep("bar", Draft("one"))
    drafts.keep("bar", Draft("two"))
    assert len(list((tmp_path / "drafts").iterdir())) == 1
    with pytest.raises(ValueError, match="too long"):
        drafts.keep("bar", Draft("x" * (LONGEST + 1)))
    assert drafts.get("bar") == Draft("two")
    drafts.forget("bar")
    drafts.forget("bar")
    assert drafts.get("bar") is None


@pytest.mark.parametrize("name", ["../bar", "a/b", ".", "bar\n", "ä", "b" * 300])
def test_a_draft_of_any_name_stays_in_its_folder(tmp_path: Path, name: str) -> None:
    drafts = Drafts(tmp_path / "state", "cell-1")
    drafts.keep(name, Draft(name))
    assert drafts.get(name) == Draft(name)
    assert [path.name for path in tmp_path.iterdir()] == ["state"]
    assert len(list((tmp_path / "state" / "drafts").iterdir())) == 1


def test_a_damaged_draft_counts_as_none_and_is_not_in_the_way(tmp_path: Path) -> None:
    drafts = Drafts(tmp_path, "cell-1")
    drafts.keep("bar", Draft("one"))
    next((tmp_path / "drafts").iterdir()).write_bytes(b"{")
    assert drafts.get("bar") is None
    drafts.keep("bar", Draft("two"))
    assert drafts.get("bar") == Draft("two")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
def test_a_pipe_in_the_folder_is_not_waited_for(folder: Folder) -> None:
    os.mkfifo(folder.root / "pipe.gsc")
    assert "pipe.gsc" not in folder.names()
    assert folder.content("pipe.gsc") is None
    with pytest.raises(OSError, match="no such file"):
        folder.read("pipe.gsc")
    with pytest.raises(OutsideFolder, match="is a pipe or a device; give the file another name"):
        folder.write("pipe.gsc", b"+250")


def test_a_file_without_an_end_is_told_as_far_as_it_matters(folder: Folder) -> None:
    with (folder.root / "huge.gsc").open("wb") as file:
        file.truncate(1 << 40)
    told = folder.content("huge.gsc")
    assert told is not None
    assert len(told) == LARGEST + 1
    with pytest.raises(ValueError, match="that is no file for the workbench"):
        folder.read("huge.gsc")


def test_a_draft_follows_no_link_and_waits_for_no_pipe(tmp_path: Path) -> None:
    drafts, mine = Drafts(tmp_path, "cell-1"), tmp_path / "mine.txt"
    mine.write_text("of somebody")
    drafts.keep("bar", Draft("+250", "bar.gsc"))
    (kept,) = (tmp_path / "drafts").iterdir()
    for put in (lambda: kept.symlink_to(mine), lambda: kept.symlink_to("/dev/zero"), lambda: os.mkfifo(kept)):
        kept.unlink()
        put()
        assert drafts.get("bar") is None
        drafts.keep("bar", Draft("+251", "bar.gsc"))
        assert drafts.get("bar") == Draft("+251", "bar.gsc")
        assert not kept.is_symlink()
    assert mine.read_text() == "of somebody"
