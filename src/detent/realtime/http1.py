"""HTTP/1.1 as far as the control port needs it: one request of a client, and the bytes of one answer to it.

What a client may send has a bound in everything: the head, its lines, the body. What breaks a bound or the rules is
`Unreadable`, with the status to answer.
"""

import asyncio
import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import Final, NamedTuple

LONGEST_HEAD: Final = 32 << 10  # bytes; readers must be made with this limit
MOST_HEADERS: Final = 100
LONGEST_BODY: Final = 64 << 10  # bytes
MOST_IGNORED: Final = 1 << 20  # bytes of a longer one that are read before it is turned away

_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
_FIGURES = re.compile(r"[0-9]{1,18}")
_ONCE = ("host", "origin", "authorization", "content-length", "transfer-encoding")  # said twice they mean nothing


class Unreadable(Exception):
    """A request that is none, or too much of one: the status, what is wrong, the remedy."""

    def __init__(
        self, status: HTTPStatus, what: str, remedy: str = "send HTTP/1.1 requests: GET / lists the verbs"
    ) -> None:
        super().__init__(what)
        self.status, self.what, self.remedy = status, what, remedy


class Request(NamedTuple):
    """A request; the names of its headers are in small letters. `target` is as it was sent."""

    method: str
    target: str
    headers: Mapping[str, str]
    body: bytes


async def read(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Request:
    """The request of a client. Raises Unreadable; OSError or EOFError if the client goes before it is whole."""
    method, target, headers = _head(await _read_head(reader))
    return Request(method, target, headers, await _read_body(reader, writer, headers))


async def _read_head(reader: asyncio.StreamReader) -> bytes:
    try:
        return await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError:
        raise Unreadable(
            HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, f"more than {LONGEST_HEAD} bytes of head"
        ) from None
    except asyncio.IncompleteReadError as error:
        if error.partial.strip():
            raise Unreadable(HTTPStatus.BAD_REQUEST, "the request is not whole") from None
        raise


def _head(data: bytes) -> tuple[str, str, dict[str, str]]:
    first, *lines = data.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
    words = first.split(" ")
    if len(words) != 3 or not _TOKEN.fullmatch(words[0]) or not words[1]:
        raise Unreadable(HTTPStatus.BAD_REQUEST, "the first line is no request")
    method, target, version = words
    if version not in ("HTTP/1.1", "HTTP/1.0"):
        raise Unreadable(HTTPStatus.HTTP_VERSION_NOT_SUPPORTED, f"version {version[:20]!r} is not spoken here")
    if len(lines) > MOST_HEADERS:
        raise Unreadable(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, f"more than {MOST_HEADERS} headers")
    headers: dict[str, str] = {}
    for line in lines:
        name, colon, value = line.partition(":")
        if not colon or not _TOKEN.fullmatch(name) or "\n" in value or "\0" in value:
            raise Unreadable(HTTPStatus.BAD_REQUEST, f"{line[:40]!r} is no header")
        name = name.lower()
        if name in headers and name in _ONCE:
            raise Unreadable(HTTPStatus.BAD_REQUEST, f"the header {name} is there twice")
        headers[name] = value.strip(" \t")
    return method, target, headers


async def _read_body(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, headers: Mapping[str, str]) -> bytes:
    if "transfer-encoding" in headers:
        raise Unreadable(HTTPStatus.LENGTH_REQUIRED, "the body is chunked", "send a Content-Length")
    text = headers.get("content-length", "0")
    if not _FIGURES.fullmatch(text):
        raise Unreadable(HTTPStatus.BAD_REQUEST, "Content-Length is no number", "leave it to your library")
    length = int(text)
    if length > LONGEST_BODY:
        left = min(length, MOST_IGNORED)  # a client that has not got rid of it does not hear the answer
        while left > 0 and (ignored := await reader.read(min(left, LONGEST_BODY))):
            left -= len(ignored)
        what = f"a body of {length} bytes is too long"
        raise Unreadable(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, what, f"at most {LONGEST_BODY} bytes")
    if length and headers.get("expect", "").lower() == "100-continue":
        writer.write(b"HTTP/1.1 100 Continue\r\n\r\n")
    return await reader.readexactly(length)


def answer(status: HTTPStatus, headers: Mapping[str, str], body: bytes, *, with_body: bool = True) -> bytes:
    """An answer behind which the connection ends; to HEAD `with_body` is false."""
    told = {**headers, "Content-Length": str(len(body)), "Connection": "close"}
    head = "".join(f"{name}: {value}\r\n" for name, value in told.items())
    return f"HTTP/1.1 {status.value} {status.phrase}\r\n{head}\r\n".encode("latin-1") + (body if with_body else b"")
