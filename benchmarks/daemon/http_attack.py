"""Memory of the daemon, and how soon an abort is answered, beside connections without a key that cost the most.

`python -m benchmarks.daemon.http_attack`, and with `--tls`; with `--at-once` the connections of each attack stay while
the next ones come, until all of them are there. The arm stands: abort is asked for a run that is not there,
with a viewer's key, and must be answered 403.
"""

import argparse
import asyncio
import resource
import shutil
import ssl
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from benchmarks.daemon.http import process
from benchmarks.daemon.http_fuzz import daemon_process, resident_mb, stall_ms

BAR_MB = 600.0
ADDRESSES = 200
AT_ONCE = 50

CHUNKED = b"POST /setup HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n"
ATTACKS = {
    "slow bodies": (b"POST /setup HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n{", 4100, 1500),
    "heads that never end": (b"GET / HTTP/1.1\r\nX: " + b"y" * 60_000, 4100, 1500),
    "requests ahead": (b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n" * 25_000, 60, 60),
    "trailers": (CHUNKED + b"0\r\nX: " + b"t" * 1_000_000, 60, 60),
}
"""What each connection sends, and how many connections without and with TLS."""


async def opened(port: int, tls: ssl.SSLContext | None, content: bytes, source: str) -> asyncio.StreamWriter | None:
    """A connection that has sent `content`; None when it was refused."""
    with suppress(OSError, TimeoutError):
        async with asyncio.timeout(20):
            _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=tls, local_addr=(source, 0))
        writer.write(content)
        return writer
    return None


async def abort_s(port: int, tls: ssl.SSLContext | None, key: str) -> float:
    """Time of one abort on a new connection, in seconds."""
    began_s = time.monotonic()
    reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=tls)
    head = f"POST /runs/x/abort HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\nConnection: close\r\n\r\n"
    writer.write(head.encode())
    answer = await asyncio.wait_for(reader.read(), 60)
    writer.transport.abort()
    if not answer.startswith(b"HTTP/1.1 403"):
        raise SystemExit(f"abort was answered {answer[:80]!r}")
    return time.monotonic() - began_s


async def attack(port: int, key: str, tls: ssl.SSLContext | None, pid: int, folder: Path, *, at_once: bool) -> float:
    """Attack after attack, or `at_once`; returns the largest memory in MB."""
    print(f"before                 {resident_mb(pid):6.0f} MB")
    most_mb, writers = 0.0, list[asyncio.StreamWriter | None]()
    for name, (content, plain_count, tls_count) in ATTACKS.items():
        aborts_s = []
        for first in range(0, tls_count if tls else plain_count, AT_ONCE):
            sources = [f"127.0.0.{1 + (first + k) % ADDRESSES}" for k in range(AT_ONCE)]
            writers += await asyncio.gather(*(opened(port, tls, content, source) for source in sources))
            aborts_s.append(await abort_s(port, tls, key))
        most_mb = max(most_mb, resident_mb(pid))
        print(f"{name:<22} {resident_mb(pid):6.0f} MB, slowest of {len(aborts_s)} aborts {max(aborts_s):.2f} s, "
              f"longest turn {stall_ms(folder):.0f} ms of processor time")  # fmt: skip
        if not at_once:
            hang_up(writers)
            writers.clear()
    hang_up(writers)
    return most_mb


def hang_up(writers: Iterable[asyncio.StreamWriter | None]) -> None:
    """Close every connection that was opened."""
    for writer in writers:
        if writer is not None:
            writer.transport.abort()


def main() -> int:
    from tests.daemon.http.tls_files import trusting

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tls", action="store_true")
    parser.add_argument("--at-once", action="store_true", help="all attacks together, not one after the other")
    options = parser.parse_args()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 16_384) if hard >= 0 else 16_384, hard))
    folder = Path(tempfile.mkdtemp(prefix="handeyed-http-attack-"))
    try:
        with process(daemon_process, str(folder), options.tls) as (started, pid):
            port, key = started  # type: ignore[misc] # of daemon_process
            tls = trusting(folder / "tls") if options.tls else None
            most_mb = asyncio.run(attack(port, key, tls, pid, folder, at_once=options.at_once))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"at most {most_mb:.0f} MB (bar {BAR_MB:g})")
    return int(most_mb > BAR_MB)


if __name__ == "__main__":
    sys.exit(main())
