"""Requests over a socket whose client hangs up when a test wants it to."""

import asyncio
from urllib.parse import urlsplit

from tests.daemon.cell_under_test import Bench


class RawRequest:
    """One request on a connection of its own."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self._writer = reader, writer

    @classmethod
    async def send(cls, bench: Bench, head: str, body: bytes = b"", length: int | None = None) -> "RawRequest":
        """Send `head`, such as "GET /robot" with further lines, and `body` of a Content-Length of `length`."""
        url = urlsplit(bench.url)
        reader, writer = await asyncio.open_connection(url.hostname, url.port)
        first, *lines = head.split("\n")
        size = len(body) if length is None else length
        lines = [f"{first} HTTP/1.1", f"Host: {url.netloc}", *lines, f"Content-Length: {size}"] if size else [
            f"{first} HTTP/1.1", f"Host: {url.netloc}", *lines]  # fmt: skip
        writer.write("\r\n".join([*lines, "", ""]).encode() + body)
        await writer.drain()
        return cls(reader, writer)

    async def hang_up(self) -> None:
        """Close the connection."""
        self._writer.close()
        await self._writer.wait_closed()
