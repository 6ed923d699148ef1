"""Floods of a daemon: hung-up readers, viewers, slow bodies, lists: `python -m benchmarks.daemon.floods PORT`.

Writes a line to standard output when all have begun, and goes on until it is killed. Its processes yield to the daemon,
since floods come from other machines and take none of the cell PC's time.
"""

import argparse
import asyncio
import contextlib
import multiprocessing
import os
import socket
import sys
from collections.abc import Awaitable, Callable

Flood = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]

RAMP_UP_S = 3.0
CROWDS = 2
"""Processes, which belong to the group of this one."""


async def hang_up(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Ask for the robot, and leave before the answer."""
    writer.write(b"GET /robot HTTP/1.1\r\nHost: localhost\r\n\r\n")
    await writer.drain()
    await asyncio.sleep(0.002)


async def view(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Read the robot every second."""
    while not reader.at_eof():
        writer.write(b"GET /robot HTTP/1.1\r\nHost: localhost\r\n\r\n")
        head = await reader.readuntil(b"\r\n\r\n")
        length = int(head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0] or 0)
        await reader.readexactly(length)
        await asyncio.sleep(1.0)


async def send_slowly(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send a body at a byte every five seconds."""
    writer.write(b"POST /setup HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n")
    for _ in range(1000):
        writer.write(b" ")
        await writer.drain()
        await asyncio.sleep(5.0)


async def pipeline(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Ask for twenty lists at once."""
    writer.write(b"GET /runs?limit=500 HTTP/1.1\r\nHost: localhost\r\n\r\n" * 20)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(5.0):
            while await reader.read(65536):
                pass


async def see(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Read the camera's frame."""
    writer.write(b"GET /camera/frame.png HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    while await reader.read(65536):
        pass


async def read_from_a_page(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Ask for the robot as a page of another origin."""
    writer.write(
        b"GET /robot HTTP/1.1\r\nHost: localhost\r\nOrigin: http://elsewhere.example\r\nConnection: close\r\n\r\n"
    )
    while await reader.read(65536):
        pass


async def send_trailers(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send trailers without end after a chunked body."""
    writer.write(b"POST /setup HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n")
    while not reader.at_eof():
        writer.write(b"A: b\r\n" * 1000)
        await writer.drain()
        await asyncio.sleep(0.01)


async def repeat(port: int, flood: Flood) -> None:
    """A new connection whenever the last one has ended."""
    while True:
        with contextlib.suppress(OSError, EOFError, asyncio.LimitOverrunError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            try:
                await flood(reader, writer)
            finally:
                writer.close()
        await asyncio.sleep(0.005)


def crowd(port: int) -> None:
    """Connect, ask for the robot and leave, as fast as it goes."""
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=5.0) as connection:
            connection.sendall(b"GET /robot HTTP/1.1\r\nHost: localhost\r\n\r\n")


async def run(port: int, viewers: int) -> None:
    async with asyncio.TaskGroup() as group:
        for flood, clients in (
            (hang_up, 6),
            (view, viewers),
            (send_slowly, 200),
            (pipeline, 4),
            (see, 4),
            (read_from_a_page, 4),
            (send_trailers, 4),
        ):
            for _ in range(clients):
                group.create_task(repeat(port, flood))
        await asyncio.sleep(RAMP_UP_S)
        print("flooding", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("port", type=int)
    parser.add_argument("viewers", type=int, nargs="?", default=1500)
    options = parser.parse_args()
    os.nice(19)
    for _ in range(CROWDS):
        multiprocessing.Process(target=crowd, args=(options.port,), daemon=True).start()
    asyncio.run(run(options.port, options.viewers))
    return 0


if __name__ == "__main__":
    sys.exit(main())
