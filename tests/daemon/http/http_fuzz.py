"""Byte streams for HTTP connections: requests by their grammar, damaged ones, noise, and a client that sends them."""

import asyncio
import random
import re
import ssl
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field

STATUS = re.compile(rb"HTTP/1\.1 (\d{3}) ")

METHODS = (
    "GET",
    "GET",
    "GET",
    "POST",
    "POST",
    "HEAD",
    "OPTIONS",
    "PUT",
    "DELETE",
    "PATCH",
    "TRACE",
    "CONNECT",
    "get",
    "",
)
TARGETS = (
    "/", "/health", "/health", "/setup", "/ready", "/metrics", "/runs", "/runs?limit=500", "/runs/x", "/runs/x?wait=9",
    "/calibrations", "/calibrations/current", "/drift", "/robot", "/camera/frame.png", "/events", "/scans", "/scans/x",
    "/audit", "/calibrate", "/openapi.json", "/register?pose=now", "/runs/x/abort", "//", "/%00", "/%2f..", "*",
    "http://[::1/", "http://localhost/health", "localhost:80", "/health?" + "x=1&" * 300, "/" + "y" * 3000, "/ä",
)  # fmt: skip
VERSIONS = ("HTTP/1.1", "HTTP/1.1", "HTTP/1.1", "HTTP/1.1", "HTTP/1.0", "HTTP/2.0", "HTTP/0.9", "HTTX/1.1", "")
HEADERS = (
    "Host: localhost", "Host: evil.example", "Host: 127.0.0.1:1", "Origin: http://evil.example", "Origin: null",
    "Connection: close", "Connection: keep-alive", "Connection: Upgrade", "Upgrade: websocket", "Upgrade: h2c",
    "Expect: 100-continue", "Content-Encoding: gzip", "Range: bytes=0-1,5-", "Accept: text/plain", "Accept: */*;q=x",
    "Authorization: Bearer x", "Authorization: Basic eDp5", "Idempotency-Key: k", 'If-None-Match: "x"', "Cookie: a=b",
    "Content-Length: 0", "Content-Length: 5", "Content-Length: 99999999999999999999", "Content-Length: -1",
    "Transfer-Encoding: chunked", "Transfer-Encoding: gzip, chunked", "Content-Type: application/json", "a:",
    "Content-Type: application/octet-stream", " folded", "No colon", "X: " + "z" * 2000, "X-Null: \0",
    "Last-Event-ID: 0", "Sec-Fetch-Site: cross-site", "X-Request-Id: \x1b[31m", "Trailer: Host", "TE: trailers",
)  # fmt: skip
CHUNKS = (
    b"2\r\n{}\r\n", b"2;ext=1\r\n{}\r\n", b"0\r\n\r\n", b"0\r\n\r\n", b"0\r\nHost: localhost\r\n\r\n", b"5\r\n{}\r\n",
    b"ffffffffffffffffff\r\n", b"-1\r\n", b"1\r\nx\r\n" * 500, b"0;" + b"e" * 3000, b"0\r\nX: " + b"t" * 3000, b"\r\n",
)  # fmt: skip


def stream(chance: random.Random, key: str) -> list[bytes]:
    """One connection's bytes, as pieces that are sent one after the other. `key`: a valid one, sent by a third."""
    if chance.random() < 0.05:
        content = chance.randbytes(chance.choice((1, 100, 5000, 200_000)))
    else:
        content = b"".join(_request(chance, key) for _ in range(chance.choice((1, 1, 1, 2, 3, 20))))
        if chance.random() < 0.05:
            content *= 50
        if chance.random() < 0.5:
            content = _damaged(chance, content)
    cuts = sorted(chance.randrange(len(content) + 1) for _ in range(chance.choice((0, 0, 1, 3, 30))))
    return [content[a:b] for a, b in zip([0, *cuts], [*cuts, len(content)], strict=True)]


def _request(chance: random.Random, key: str) -> bytes:
    if chance.random() < 0.3:
        line = f"{chance.choice(METHODS[:5])} {chance.choice(TARGETS)} HTTP/1.1"
        return f"{line}\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\n\r\n".encode()
    lines = [" ".join(chance.choice(parts) for parts in (METHODS, TARGETS, VERSIONS)).strip()]
    if chance.random() < 0.8:
        lines.append("Host: localhost")
    if chance.random() < 0.33:
        lines.append(f"Authorization: Bearer {key}")
    lines += chance.choices(HEADERS, k=chance.choice((0, 1, 2, 4, 150)))
    body = b""
    match chance.randrange(4):
        case 0:
            body = chance.choice((b"{}", b'{"code": "x"}', b"[" * 2000, b"\xff" * 40_000, b"{" + b" " * 3000))
            lines.append(f"Content-Length: {len(body) + chance.choice((0, 0, 0, 1, -1))}")
        case 1:
            body = b"".join(chance.choices(CHUNKS, k=chance.randrange(6))) + chance.choice((b"", b"0\r\n\r\n"))
            lines.append("Transfer-Encoding: chunked")
    return "\r\n".join((*lines, "", "")).encode("utf-8") + body


def _damaged(chance: random.Random, content: bytes) -> bytes:
    """Bytes changed, removed, put in, repeated or cut off, in up to five places."""
    damaged = bytearray(content)
    for _ in range(chance.randrange(1, 6)):
        at = chance.randrange(len(damaged) + 1)
        match chance.randrange(5):
            case 0:
                damaged[at : at + 1] = chance.randbytes(1)
            case 1:
                del damaged[at : at + chance.randrange(1, 20)]
            case 2:
                damaged[at:at] = chance.choice((b"\r\n", b"\r", b"\n", b"\0", b"\r\n\r\n", b":", b" ", b"\xff\xff"))
            case 3:
                damaged[at:at] = damaged[at : at + 200]
            case 4:
                del damaged[at + 500 :]
    return bytes(damaged)


@dataclass
class Target:
    """Where the streams go. `tls` None: without TLS."""

    port: int
    key: str
    tls: ssl.SSLContext | None = None


@dataclass
class Answers:
    """What came back: streams sent, answers by status, and an example of each answer with 500 and above."""

    streams: int = 0
    by_status: Counter[int] = field(default_factory=Counter)
    failures: dict[int, bytes] = field(default_factory=dict)

    def note(self, answer: bytes) -> None:
        """Count one connection's answers."""
        self.streams += 1
        for found in STATUS.finditer(answer):
            status = int(found[1])
            self.by_status[status] += 1
            if status >= 500:
                self.failures.setdefault(status, answer[found.start() : found.start() + 600])


async def send_streams(targets: list[Target], numbers: Iterable[int], seed: int, answers: Answers) -> None:
    """Send the streams of these numbers, over 1 to 50 connections at once."""
    waiting = iter(numbers)
    while batch := [number for _, number in zip(range(random.Random(seed).randint(200, 400)), waiting, strict=False)]:
        seed += 1
        places = asyncio.Semaphore(random.Random(seed).choice((1, 5, 20, 50, 50, 50)))
        await asyncio.gather(*(_send(targets[number % len(targets)], number, places, answers) for number in batch))


async def _send(target: Target, number: int, places: asyncio.Semaphore, answers: Answers) -> None:
    chance = random.Random(number)
    answer = bytearray()
    async with places:
        with suppress(OSError, TimeoutError):
            reader, writer = await asyncio.open_connection("127.0.0.1", target.port, ssl=target.tls)
            try:
                for piece in stream(chance, target.key):
                    writer.write(piece)
                    await asyncio.wait_for(writer.drain(), 0.2)
                    await asyncio.sleep(0)
                if chance.random() < 0.2 and writer.can_write_eof():
                    writer.write_eof()
                patience_s = chance.choice((0.0, 0.01, 0.05))
                while patience_s and (piece := await asyncio.wait_for(reader.read(65_536), patience_s)):
                    answer += piece
            finally:
                writer.transport.abort()
    answers.note(bytes(answer))
