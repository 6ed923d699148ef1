"""A cloud through the daemon against a raw socket echo of the same bytes: `python -m benchmarks.daemon.http`.

Daemon and echo are processes of their own; rounds alternate, so that a busy machine slows both. Both have the same
client: one thread sends, one receives, with large buffers.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import shutil
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

POSE = "800,-100,900,0,1,0,0"
PIECE = 1 << 18
RATIO_BAR, FIRST_BYTE_BAR_MS = 0.75, 5.0


@dataclass(frozen=True)
class Round:
    """Seconds to the response's first and last byte."""

    first_s: float
    whole_s: float


def echo_server(ready: Any) -> None:
    """Return received bytes, in one thread with one buffer."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        ready.put(listener.getsockname()[1])
        buffer = memoryview(bytearray(PIECE))
        while True:
            connection, _ = listener.accept()
            with connection:
                while count := connection.recv_into(buffer):
                    connection.sendall(buffer[:count])


def daemon_process(folder: str, ready: Any) -> None:
    """The daemon with its real server, fake devices, and an active calibration."""
    import uvloop

    uvloop.run(_daemon(Path(folder), ready))


async def _daemon(folder: Path, ready: Any) -> None:
    from tests.daemon.calibrations import apply_calibration
    from tests.daemon.cell_under_test import serving, settings_for

    async with serving(settings_for(folder)) as bench:
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


def exchange(port: int, head: bytes, body: memoryview, answer: bytearray, answer_length: int | None) -> Round:
    """Send `head` and `body` while receiving the response."""
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
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


def _send(connection: socket.socket, head: bytes, body: memoryview) -> None:
    connection.sendall(head)
    connection.sendall(body)


def _content_length(head: bytes) -> int:
    lines = dict(line.lower().split(b": ", 1) for line in head.split(b"\r\n")[1:])
    if b"content-length" not in lines:
        raise SystemExit(f"the answer has no length: {head!r}")
    return int(lines[b"content-length"])


def peak_mb(pid: int) -> float:
    """Peak resident memory of a process."""
    return int(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0]) / 1024


def processor_s(pid: int) -> float:
    """Processor time of a process so far, in seconds."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def request(form: str, length: int) -> bytes:
    return (
        f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {form}\r\n"
        f"Content-Length: {length}\r\n\r\n"
    ).encode()


def first_byte_ms(port: int, rounds: int = 50) -> float:
    """Median over small clouds: the daemon's own delay."""
    body = memoryview(np.zeros(300, np.float32).tobytes())
    answer = bytearray(1 << 16)
    head = request("application/octet-stream", len(body))
    return 1000 * statistics.median(exchange(port, head, body, answer, None).first_s for _ in range(rounds))


def cloud(form: str, points: int) -> memoryview:
    content = np.random.default_rng(0).normal(0, 100, 3 * points).astype("<f4").tobytes()
    header = b""
    if form == "application/x-ply":
        names = "".join(f"property float {axis}\n" for axis in "xyz")
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {points}\n{names}end_header\n".encode()
    return memoryview(header + content)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    folder = tempfile.mkdtemp(prefix="handeyed-bench-")
    rows: list[tuple[str, float, str]] = []
    try:
        with process(echo_server) as echo, process(daemon_process, folder) as daemon:
            rows.append(("first byte of a small cloud", first_byte_ms(daemon[0]), f"ms (bar: < {FIRST_BYTE_BAR_MS:g})"))
            idle = peak_mb(daemon[1])
            for form in ("application/octet-stream", "application/x-ply"):
                rows += measure_rounds(form, options.points, options.rounds, daemon, echo)
                rows.append(("  daemon's peak memory above idle", peak_mb(daemon[1]) - idle, "MB"))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if options.json:
        print(json.dumps({what.strip(): value for what, value, _ in rows}))
    else:
        print("\n".join(f"{what:<48}{value:10.2f} {unit}" for what, value, unit in rows))
    return 0


def measure_rounds(
    form: str, points: int, rounds: int, daemon: tuple[int, int], echo: tuple[int, int]
) -> list[tuple[str, float, str]]:
    """Alternating rounds; ratio of the best and of the median times. `daemon`, `echo`: port and process id."""
    body = cloud(form, points)
    head = request(form, len(body))
    answer = bytearray(len(body) + (1 << 16))
    ours, raw = [], []
    before_s = [processor_s(pid) for _, pid in (echo, daemon)]
    for _ in range(rounds):
        raw.append(exchange(echo[0], b"", body, answer, len(body)))
        ours.append(exchange(daemon[0], head, body, answer, None))
    spent_s = [processor_s(pid) - before for (_, pid), before in zip((echo, daemon), before_s, strict=True)]
    fastest = min(each.whole_s for each in raw) / min(each.whole_s for each in ours)
    middle = statistics.median(a.whole_s / b.whole_s for a, b in zip(raw, ours, strict=True))
    speed = len(body) / min(each.whole_s for each in ours) / 1e9
    return [
        (f"{form}, {points:.0e} points", fastest, f"x raw echo, best of each (bar: >= {RATIO_BAR:g})"),
        ("  median of the pairs", middle, "x raw echo"),
        ("  the daemon's processor time for a cloud", 1000 * spent_s[1] / rounds, "ms"),
        ("  the echo's", 1000 * spent_s[0] / rounds, "ms"),
        ("  throughput", speed, "GB/s in, and the same out"),
        ("  first byte, median", 1000 * statistics.median(each.first_s for each in ours), "ms"),
        ("  the echo's first byte, median", 1000 * statistics.median(each.first_s for each in raw), "ms"),
    ]


if __name__ == "__main__":
    sys.exit(main())
