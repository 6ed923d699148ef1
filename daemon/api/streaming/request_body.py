"""Read a request's body in chunks."""

from collections.abc import AsyncGenerator

from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope

from daemon.http.connections import LEND_BODY, TAKE_SOCKET
from daemon.http.taken_socket import TakenSocket


def lend_body(scope: Scope) -> None:
    """From here on the pieces of a large body come as views, each valid until the next one is asked for."""
    if (lend := scope.get("state", {}).get(LEND_BODY)) is not None:
        lend()


def take_socket(scope: Scope) -> TakenSocket | None:
    """The socket, for the rest of a large body and its answer, which begins next; None where no thread can have it."""
    take = scope.get("state", {}).get(TAKE_SOCKET)
    return take() if take is not None else None


async def body_chunks(receive: Receive) -> AsyncGenerator[bytes | memoryview]:
    """Yield the body's bytes; a view of a lent body is valid until the next one.

    Raises ClientDisconnect, and BodyTooLarge from the request checks.
    """
    more = True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        more = message.get("more_body", False)
        if content := message.get("body", b""):
            yield content
