"""A cloud through the daemon against a raw socket echo of the same bytes: `python -m benchmarks.daemon.http`.

Daemon and echo are processes of their own; rounds alternate, so that a busy machine slows both. Both have the same
client: one thread sends, one receives, with large buffers. With --tls both speak TLS.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import socket
import ssl
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import numpy as np

POSE = "800,-100,900,0,1,0,0"
PIECE = 1 << 18
RATIO_BAR, PROCESSOR_BAR, FIRST_BYTE_BAR_MS = 0.85, 1.5, 3.0


@dataclass(frozen=True)
class Round:
    """Seconds to the response's first and last byte."""

    first_s: float
    whole_s: float


class Connection(Protocol):
    """What a client needs of a socket."""

    def sendall(self, data: bytes | memoryview, /) -> object: ...
    def recv_into(self, buffer: memoryview, /) -> int: ...


class SecuredConnection:
    """A client's TLS over a socket, of which one thread sends and another receives."""

    def __init__(self, connection: socket.socket, context: ssl.SSLContext) -> None:
        self._socket, self._lock = connection, threading.Lock()
        self._arrived, self._to_send = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._arrived, self._to_send, server_hostname="localhost")
        while True:
            try:
                self._tls.do_handshake()
            except ssl.SSLWantReadError:
                connection.sendall(self._to_send.read())
                self._arrived.write(connection.recv(PIECE))
            else:
                connection.sendall(self._to_send.read())
                return

    def sendall(self, data: bytes | memoryview, /) -> None:
        for start in range(0, len(data), PIECE):
            with self._lock:
                self._tls.write(data[start : start + PIECE])
                sealed = self._to_send.read()
            self._socket.sendall(sealed)

    def recv_into(self, buffer: memoryview, /) -> int:
        while True:
            with contextlib.suppress(ssl.SSLWantReadError), self._lock:
                return self._tls.read(len(buffer), buffer)  # type: ignore[return-value]
            if not (sealed := self._socket.recv(PIECE)):
                return 0
            with self._lock:
                self._arrived.write(sealed)


def echo_server(ready: Any, certificates: dict[str, str] | None = None) -> None:
    """Return received bytes, in one thread with one buffer."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER) if certificates else None
    if context is not None and certificates is not None:
        context.load_cert_chain(certificates["certificate"], certificates["private_key"])
    with socket.create_server(("127.0.0.1", 0)) as listener:
        ready.put(listener.getsockname()[1])
        buffer = memoryview(bytearray(PIECE))
        while True:
            accepted, _ = listener.accept()
            secured = context.wrap_socket(accepted, server_side=True) if context else accepted
            with contextlib.suppress(OSError), secured as connection:
                while count := connection.recv_into(buffer):
                    connection.sendall(buffer[:count])


def daemon_process(folder: str, ready: Any, certificates: dict[str, str] | None = None) -> None:
    """The daemon with its real server, fake devices, and an active calibration."""
    import uvloop

    uvloop.run(_daemon(Path(folder), ready, certificates))


async def _daemon(folder: Path, ready: Any, certificates: dict[str, str] | None) -> None:
    from tests.daemon.calibrations import apply_calibration
    from tests.daemon.cell_under_test import serving, settings_for

    async with serving(settings_for(folder, server=certificates or {})) as bench:
        await apply_calibration(bench)
        ready.put(urlsplit(bench.url).port)
        await asyncio.Event().wait()


@contextlib.contextmanager
def process(target: Any, *arguments: Any) -> Iterator[tuple[int, int]]:
    """A server in a process; yields its port and process id."""
    context = multiprocessing.get_context("spawn")
    ready = context.Queue()
    child = context.Process(target=target, args=(*arguments, ready), daemon=True)
    child.start()
    try:
        yield ready.get(timeout=60), child.pid or 0
    finally:
        child.kill()  # nothing to keep
        child.join()


@dataclass(frozen=True)
class Server:
    """A server's port and process id, and the TLS context of its clients."""

    port: int
    pid: int
    trusting: ssl.SSLContext | None = None

    def exchange(self, head: bytes, body: memoryview, answer: bytearray, answer_length: int | None) -> Round:
        """Send `head` and `body` while receiving the response."""
        with socket.create_connection(("127.0.0.1", self.port)) as opened:
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection: Connection = SecuredConnection(opened, self.trusting) if self.trusting else opened
            began = time.perf_counter()
            sending = threading.Thread(target=_send, args=(connection, head, body))
            sending.start()
            into, first, received = memoryview(answer), 0.0, 0
            expected = answer_length
            while expected is None or received < expected:
                count = connection.recv_into(into[received : received + PIECE])
                if not count:
                    break
                first = first or time.perf_counter() - began
                received += count
                if expected is None and (end := answer.find(b"\r\n\r\n", 0, received)) >= 0:
                    expected = end + 4 + _content_length(bytes(answer[:end]))
            whole = time.perf_counter() - began
            sending.join()
        if received != expected:
            raise SystemExit(f"{received} bytes came back where {expected} were promised: {bytes(answer[:300])!r}")
        return Round(first, whole)

    def peak_mb(self) -> float:
        """Peak resident memory."""
        return int(Path(f"/proc/{self.pid}/status").read_text().split("VmHWM:")[1].split()[0]) / 1024

    def processor_s(self) -> float:
        """Processor time so far, in seconds."""
        user, system = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _send(connection: Connection, head: bytes, body: memoryview) -> None:
    if head:
        connection.sendall(head)
    connection.sendall(body)


def _content_length(head: bytes) -> int:
    lines = dict(line.lower().split(b": ", 1) for line in head.split(b"\r\n")[1:])
    if b"content-length" not in lines:
        raise SystemExit(f"the answer has no length: {head!r}")
    return int(lines[b"content-length"])


def request(form: str, length: int) -> bytes:
    return (
        f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {form}\r\n"
        f"Content-Length: {length}\r\n\r\n"
    ).encode()


def first_byte_ms(server: Server, rounds: int = 50) -> float:
    """Median over small clouds: the daemon's own delay."""
    body = memoryview(np.zeros(300, np.float32).tobytes())
    answer = bytearray(1 << 16)
    head = request("application/octet-stream", len(body))
    return 1000 * statistics.median(server.exchange(head, body, answer, None).first_s for _ in range(rounds))


def cloud(form: str, points: int) -> memoryview:
    content = np.random.default_rng(0).normal(0, 100, 3 * points).astype("<f4").tobytes()
    header = b""
    if form == "application/x-ply":
        names = "".join(f"property float {axis}\n" for axis in "xyz")
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {points}\n{names}end_header\n".encode()
    return memoryview(header + content)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=float, nargs="+", default=[1e7])
    parser.add_argument("--rounds", type=int, default=25, help="of the first number of points; of others as many bytes")
    parser.add_argument("--tls", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows: list[tuple[str, float, str]] = []
    with tempfile.TemporaryDirectory(prefix="handeyed-bench-") as folder:
        certificates = trusted = None
        if options.tls:
            from tests.daemon.http.tls_files import certificate, trusting

            certificates, trusted = certificate(Path(folder) / "tls"), trusting(Path(folder) / "tls")
        echoing = process(partial(echo_server, certificates=certificates))
        answering = process(partial(daemon_process, certificates=certificates), folder)
        with echoing as one, answering as other:
            echo, daemon = Server(*one, trusted), Server(*other, trusted)
            rows.append(("first byte of a small cloud", first_byte_ms(daemon), f"ms (bar: < {FIRST_BYTE_BAR_MS:g})"))
            idle = daemon.peak_mb()
            for points in options.points:
                rounds = min(1000, max(3, round(options.rounds * options.points[0] / points)))
                for form in ("application/octet-stream", "application/x-ply"):
                    rows += measure_rounds(form, int(points), rounds, daemon, echo)
                    rows.append(("  daemon's peak memory above idle", daemon.peak_mb() - idle, "MB"))
    if options.json:
        print(json.dumps({what.strip(): value for what, value, _ in rows}))
    else:
        print("\n".join(f"{what:<48}{value:10.2f} {unit}" for what, value, unit in rows))
    return 0


def measure_rounds(form: str, points: int, rounds: int, daemon: Server, echo: Server) -> list[tuple[str, float, str]]:
    """Alternating rounds; ratio of the best and of the median times, and of the processor times."""
    body = cloud(form, points)
    head = request(form, len(body))
    answer = bytearray(len(body) + (1 << 16))
    ours, raw = [], []
    before_s = [server.processor_s() for server in (echo, daemon)]
    for _ in range(rounds):
        raw.append(echo.exchange(b"", body, answer, len(body)))
        ours.append(daemon.exchange(head, body, answer, None))
    echo_s, daemon_s = (server.processor_s() - before for server, before in zip((echo, daemon), before_s, strict=True))
    fastest = min(each.whole_s for each in raw) / min(each.whole_s for each in ours)
    middle = statistics.median(a.whole_s / b.whole_s for a, b in zip(raw, ours, strict=True))
    speed = len(body) / min(each.whole_s for each in ours) / 1e9
    return [
        (f"{form}, {points:.0e} points", fastest, f"x raw echo, best of each (bar: >= {RATIO_BAR:g})"),
        ("  median of the pairs", middle, "x raw echo"),
        ("  the daemon's processor time for a cloud", 1000 * daemon_s / rounds, "ms"),
        ("  over the echo's", daemon_s / max(echo_s, 0.01), f"(bar: <= {PROCESSOR_BAR:g})"),
        ("  throughput", speed, "GB/s in, and the same out"),
        ("  first byte, median", 1000 * statistics.median(each.first_s for each in ours), "ms"),
        ("  the echo's first byte, median", 1000 * statistics.median(each.first_s for each in raw), "ms"),
    ]


if __name__ == "__main__":
    sys.exit(main())
