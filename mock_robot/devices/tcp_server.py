"""A TCP server of the mock: each connection is a conversation that ends with the server."""

import asyncio
from abc import ABC, abstractmethod
from contextlib import suppress


class TcpServer(ABC):
    """Listens, converses with whoever connects, and closes each connection afterwards."""

    def __init__(self) -> None:
        self._server: asyncio.Server | None = None
        self._conversations: set[asyncio.Task[None]] = set()

    async def start(self, host: str, port: int) -> tuple[str, int]:
        """Listen; returns the address (port 0: chosen by the system)."""
        self._server = await asyncio.start_server(self._accept, host, port)
        address = self._server.sockets[0].getsockname()
        return str(address[0]), int(address[1])

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
        for conversation in list(self._conversations):
            conversation.cancel()
        await asyncio.gather(*self._conversations, return_exceptions=True)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._conversations.add(task)
        try:
            with suppress(ConnectionError, asyncio.CancelledError):
                await self._converse(task, reader, writer)
        finally:
            self._conversations.discard(task)
            writer.close()

    @abstractmethod
    async def _converse(
        self, task: asyncio.Task[None], reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Talk until one of the two has enough; `task` is this conversation."""
