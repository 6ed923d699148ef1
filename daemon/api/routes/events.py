"""GET /events: server-sent events."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Response
from fastapi.responses import StreamingResponse

from daemon.api.dependencies import App
from daemon.runtime.event_bus import EventBus

router = APIRouter(tags=["events"])

KEEPALIVE_S = 15.0
"""A comment is sent after this long without an event, so that both ends detect a broken connection."""


@router.get(
    "/events",
    response_class=Response,
    responses={200: {"description": "Events with ids", "content": {"text/event-stream": {}}}},
)
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
