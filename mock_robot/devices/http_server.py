"""Serves an ASGI application on the running event loop."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

KEEP_ALIVE_S = 75
"""nginx's default. Clients give up a connection idle for 5 s: if the server ends it then, a request meets the end."""


class _Server(uvicorn.Server):
    """uvicorn without signal handlers; the cell installs its own."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the process's signal handlers unchanged."""
        yield


class HttpServer:
    def __init__(self, application: Any, **options: Any) -> None:
        """`options`: further arguments of uvicorn.Config, such as a certificate."""
        options = {"ws": "none", "timeout_keep_alive": KEEP_ALIVE_S, "timeout_graceful_shutdown": 1, **options}
        config = uvicorn.Config(application, log_level="error", access_log=False, lifespan="off", **options)
        self._scheme = "https" if config.is_ssl else "http"
        self._server = _Server(config)
        self._serving: asyncio.Task[None] | None = None

    async def start(self, host: str, port: int) -> str:
        """Start serving; returns the base URL without a trailing slash."""
        listening = socket.create_server((host, port))
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a body waits 40 ms for its header's ACK
        chosen = listening.getsockname()[1]
        self._serving = asyncio.create_task(self._server.serve(sockets=[listening]))
        while not self._server.started:
            if self._serving.done():
                self._serving.result()
            await asyncio.sleep(0.005)
        return f"{self._scheme}://{host}:{chosen}"

    async def close(self) -> None:
        """Stop serving; requests in progress get one second to finish."""
        self._server.should_exit = True
        if self._serving is not None:
            await asyncio.gather(self._serving, return_exceptions=True)
