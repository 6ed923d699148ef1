"""Read a request's body in chunks."""

from collections.abc import AsyncGenerator

from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope

from daemon.http.connections import LEND_BODY


def lend_body(scope: Scope) -> None:
    """From here on the pieces of a large body come as views, each valid until the next one is asked for."""
    if (lend := scope.get("state", {}).get(LEND_BODY)) is not None:
        lend()


async def body_chunks(receive: Receive) -> AsyncGenerator[bytes | memoryview]:
    """The body's bytes; a view of a lent body is valid until the next one. Raises ClientDisconnect, BodyTooLarge."""
    more = True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        more = message.get("more_body", False)
        if content := message.get("body", b""):
            yield content
