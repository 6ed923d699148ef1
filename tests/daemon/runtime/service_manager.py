"""systemd's end of the notification socket."""

import asyncio
import socket

from tests.support.waiting import LIMIT_S


class Manager:
    """systemd's end of NOTIFY_SOCKET."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.socket.bind(address)

    async def hears(self, limit_s: float = LIMIT_S, of: str = "") -> str:
        """The next message that begins with `of`."""
        async with asyncio.timeout(limit_s):
            while True:
                message = (await asyncio.get_running_loop().sock_recv(self.socket, 4096)).decode()
                if message.startswith(of):
                    return message
