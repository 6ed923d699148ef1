"""GET /health beside 900 connections with endless requests: `python -m benchmarks.daemon.half_open`."""

import argparse
import shutil
import socket
import statistics
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.daemon.http import daemon_process, process

BAR_MS = 500.0
HALF = b"GET /health HTTP/1.1\r\nHost: localhost\r\nX-Half: "
WHOLE = b"GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


def health_ms(port: int) -> float:
    """Time of one request on a new connection."""
    began = time.perf_counter()
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        connection.sendall(WHOLE)
        answer = b""
        while piece := connection.recv(65536):
            answer += piece
    if not answer.startswith(b"HTTP/1.1 200"):
        raise SystemExit(f"health answered {answer[:80]!r}")
    return 1000 * (time.perf_counter() - began)


def row(name: str, took_ms: list[float]) -> str:
    ordered = sorted(took_ms)
    p99 = ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]
    return f"{name:<48}{statistics.median(ordered):8.1f} ms median {p99:8.1f} ms p99"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--connections", type=int, default=900)
    parser.add_argument("--requests", type=int, default=500)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="handeyed-half-open-"))
    try:
        with process(daemon_process, str(folder)) as (port, _):
            alone = [health_ms(port) for _ in range(options.requests)]
            held = [socket.create_connection(("127.0.0.1", port)) for _ in range(options.connections)]
            for connection in held:
                connection.sendall(HALF)
            beside = []
            for k in range(options.requests):
                held[k % len(held)].sendall(b"x")
                beside.append(health_ms(port))
            for connection in held:
                connection.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(row("GET /health, alone", alone))
    print(row(f"GET /health beside {options.connections} half-open connections", beside), f"(bar: < {BAR_MS:g})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
