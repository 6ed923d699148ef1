"""Server-sent events: GET /events, which are stored, and GET /live, the cell as it is now, which are not."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Header, Request, Response
from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from daemon.api.dependencies import App, api_router, in_content
from daemon.api.live.live_feed import Listener, LiveFeed
from daemon.runtime.event_bus import EventBus

router = api_router(tags=["events"])

KEEPALIVE_S = 15.0
"""A comment is sent after this long without an event, so that both ends detect a broken connection."""


@router.get("/events", **in_content("Events with ids", {"text/event-stream": {}}))
async def events(app: App, last_event_id: Annotated[str, Header(max_length=32, pattern=r"^[0-9]*$")] = "") -> Response:
    """Events from now on; with Last-Event-ID also those after it. Ends when the daemon stops.

    Numbers increase, also over restarts, and may skip some. Events no longer stored are replaced by one `lost`.
    """
    last = app.events.last
    after = min(int(last_event_id), last) if last_event_id else last
    return StreamingResponse(
        _stream(app.events, after), media_type="text/event-stream", headers={"Cache-Control": "no-store"}
    )


async def _stream(events: EventBus, after: int) -> AsyncIterator[str]:
    yield ": what happens in the cell\n\n"
    async for event in events.listen(after, KEEPALIVE_S):
        if event is None:
            yield ": nothing new\n\n"
        else:
            yield f"id: {event.number}\nevent: {event.kind}\ndata: {json.dumps(event.data)}\n\n"
        await asyncio.sleep(0)  # lets a disconnect be noticed between two events


@router.get("/live", **in_content("Events `live` without ids", {"text/event-stream": {}}, 503))
async def live(request: Request) -> Response:
    """The cell now: `robot`, `run` in progress, `devices`, `ready`, `holder`, `software`, each null if unknown; `look`
    at the target, while a run waits for its operator; `ready_of` has each further camera's readiness by its name.

    The first message is whole, later ones have `at` and what has changed: at most 5/s while the arm moves, else 1/s,
    and one each second in any case. Ends when the daemon stops or the key ends. At most 64 listeners share one poller,
    32 of one address.
    """
    feed: LiveFeed = request.app.state.live
    return _LiveResponse(feed, feed.admit(request.client.host if request.client else "unknown"))


class _LiveResponse(StreamingResponse):
    """Sends the messages of one listener, and gives its place free."""

    def __init__(self, feed: LiveFeed, listener: Listener) -> None:
        super().__init__(feed.messages(listener), media_type="text/event-stream")
        self._feed, self._listener = feed, listener

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._feed.release(self._listener)
