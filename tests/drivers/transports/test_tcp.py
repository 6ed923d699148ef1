"""TCP as the driver dials it."""

import asyncio
import socket

import pytest

from drivers.errors import DeviceUnreachable
from drivers.transports.tcp import TcpTransport


async def test_a_dial_that_meets_itself_is_no_connection(monkeypatch):
    """Linux connects a socket to itself when it happens to be given the port it dials, and nobody listens there."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    dial = asyncio.open_connection
    monkeypatch.setattr(asyncio, "open_connection", lambda host, to: dial(host, to, local_addr=(host, to)))
    with pytest.raises(DeviceUnreachable, match="refused"):
        await TcpTransport("127.0.0.1", port).connect()
