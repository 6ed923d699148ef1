"""One connection of the acceptance: the driver's conversation with a controller, without its heartbeat."""

import asyncio
from contextlib import suppress

from drivers.errors import DeviceError, LinkLost
from drivers.robots.abb.cb_link import hang_up
from drivers.robots.abb.cb_session import REPLY_LIMIT_S, Answered, CbConversation, CbLimits
from drivers.timing import Timing
from drivers.transports.transport import Connection, Transport
from protocols.cb.client import ClientSession
from protocols.cb.codes import VERSION
from protocols.cb.messages import Bye, Hello, Refused, Request, Welcome

CLIENT_ID = 2


class Wire:
    """Greeted by `open`; sends nothing by itself. `counts`: what passed since then. `session`: the controller's."""

    def __init__(self, transport: Transport, connection: Connection, timing: Timing) -> None:
        self.device = f"robot {transport.address}"
        self._connection = connection
        self._session = ClientSession(resynchronise=transport.resynchronise)
        limits = CbLimits(REPLY_LIMIT_S, transport.half_frame_limit_s, silence_ends=False)
        self._conversation = CbConversation(
            self.device, connection, self._session, timing, limits, on_lost=lambda error: None
        )
        self._listening = asyncio.create_task(self._conversation.listen(), name=f"listens to {self.device}")
        self.counts, self.session = self._conversation.counts, 0

    @classmethod
    async def open(cls, transport: Transport, timing: Timing) -> "Wire":
        """Connect and greet. Raises DeviceError; LinkLost names the status of a refused greeting."""
        wire = cls(transport, await transport.connect(), timing)
        try:
            reply = (await wire.ask(Hello(VERSION, VERSION, CLIENT_ID))).reply
            if isinstance(reply, Refused):
                raise LinkLost(wire.device, f"the greeting was refused: {reply.name}", "close every other client")
        except DeviceError:
            await wire.close(politely=False)
            raise
        assert isinstance(reply, Welcome)
        wire.session = reply.session
        return wire

    @property
    def last_seq(self) -> int:
        """Number of the newest request."""
        return self._session.last_seq

    async def ask(self, request: Request) -> Answered:
        """Send a request, again while no answer comes, and return its answer. Raises LinkLost, GarbledAnswer.

        After REPLY_LIMIT_S without one the next request may be answered again: a person stops and starts the program.
        """
        return await self._conversation.ask(request)

    async def close(self, *, politely: bool = True) -> None:
        """Close, after BYE and its answer when `politely`; otherwise as a PC that is switched off."""
        if politely:
            with suppress(DeviceError):
                await self.ask(Bye())
        self._conversation.lose(LinkLost(self.device, "the connection was closed here", "open another one"))
        self._listening.cancel()
        await hang_up(self._connection, self._listening)
