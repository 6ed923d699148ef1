"""GET /live: the cell as it is now, as server-sent events that are not stored."""

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from daemon.api.live.live_feed import Listener, LiveFeed
from daemon.api.problems import problem_responses

router = APIRouter(tags=["events"])


@router.get(
    "/live",
    response_class=Response,
    responses={200: {"description": "Events `live` without ids", "content": {"text/event-stream": {}}},
               **problem_responses(503)},
)  # fmt: skip
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
