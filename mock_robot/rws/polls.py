"""WebSockets of subscriptions. In RWS 2.0 any message from the client closes the socket with code 1008."""

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rws.sessions import Session
from mock_robot.rws.subscriptions import PERIODS_S, SubscriptionGroup, Subscriptions

SUBPROTOCOLS = {1: "robapi2_subscription", 2: "rws_subscription"}
POLICY_VIOLATION, GOING_AWAY = 1008, 1001
POLL_S = PERIODS_S[2]
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]


@dataclass
class Polls:
    """Open sockets of one service."""

    subscriptions: Subscriptions
    clock: Callable[[], float]
    _nudge: asyncio.Event = field(default_factory=asyncio.Event, init=False)

    def nudge(self) -> None:
        """Check for changes now."""
        self._nudge.set()

    async def serve(self, scope: Scope, receive: Receive, send: Send, session: Session | None) -> None:
        """Serve one socket from handshake to close."""
        await receive()  # websocket.connect
        wanted = SUBPROTOCOLS[self.subscriptions.version]
        number = scope["path"].removeprefix("/poll/")
        group = self.subscriptions.groups.get(int(number)) if number.isdecimal() else None
        refused = self._refusal(scope, wanted, group, session)
        if refused is not None or group is None:
            await _deny(send, refused or 404)
            return
        group.taken = True
        await send({"type": "websocket.accept", "subprotocol": wanted})
        try:
            await self._report(group, receive, send)
        finally:
            self.subscriptions.delete(group.number)

    def _refusal(
        self, scope: Scope, wanted: str, group: SubscriptionGroup | None, session: Session | None
    ) -> int | None:
        """HTTP status that refuses a handshake; None when it is accepted."""
        if wanted not in scope["subprotocols"]:
            return 400
        if session is None:
            return 403 if self.subscriptions.version == 1 else 401
        if group is None or group.session is not session or group.taken:
            return 404
        return None

    async def _report(self, group: SubscriptionGroup, receive: Receive, send: Send) -> None:
        hearing = asyncio.ensure_future(receive())
        try:
            while group.number in self.subscriptions.groups:
                for message in group.events(self.clock()):
                    await send({"type": "websocket.send", "text": message})
                await asyncio.wait({hearing}, timeout=POLL_S)
                if not hearing.done():
                    continue
                if hearing.result()["type"] == "websocket.disconnect":
                    return
                if self.subscriptions.version == 2:
                    await _close(send, POLICY_VIOLATION, "Client cannot send data.")
                    return
                hearing = asyncio.ensure_future(receive())  # RWS 1.0 ignores messages
            await _close(send, GOING_AWAY, "")
        finally:
            hearing.cancel()


async def _close(send: Send, code: int, reason: str) -> None:
    await send({"type": "websocket.close", "code": code, "reason": reason})


async def _deny(send: Send, status: int) -> None:
    await send(
        {"type": "websocket.http.response.start", "status": status, "headers": [(b"content-type", b"text/html")]}
    )
    await send({"type": "websocket.http.response.body", "body": b"<html>Refused</html>"})
