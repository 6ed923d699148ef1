"""An answer from a file that is deleted afterwards, also when the client disconnects before its end."""

import asyncio
from functools import partial
from pathlib import Path

from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send


class TemporaryFileResponse(FileResponse):
    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            await asyncio.to_thread(partial(Path(self.path).unlink, missing_ok=True))
