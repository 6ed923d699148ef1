"""Read a request's body in chunks."""

from collections.abc import AsyncIterator

from starlette.requests import ClientDisconnect
from starlette.types import Receive


async def body_chunks(receive: Receive) -> AsyncIterator[bytes]:
    """Yield the body's bytes. Raises ClientDisconnect, and BodyTooLarge from the request checks."""
    more = True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        more = message.get("more_body", False)
        if content := message.get("body", b""):
            yield content
