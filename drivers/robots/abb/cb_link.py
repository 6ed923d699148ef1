"""The link to a controller: connects in the background, greets, sends heartbeats, reconnects after a loss."""

import asyncio

from drivers.errors import DeviceError, LinkLost
from drivers.robots.abb.cb_session import CbConversation, CbLimits
from drivers.robots.abb.controller_link import ControllerLink
from drivers.timing import Timing, shorten_switch_interval
from drivers.transports.transport import Connection, Transport
from protocols.cb.client import ClientSession
from protocols.cb.messages import Bye

BYE_LIMIT_S = 0.5


class CbLink(ControllerLink):
    """Owns the connection. `conversation` is the current one; each reconnect creates a new one."""

    again = "it is dialled again by itself"

    def __init__(self, device: str, transport: Transport, timing: Timing, reply_limit_s: float) -> None:
        super().__init__(device, timing)
        self._transport, self._limits = transport, CbLimits(reply_limit_s, transport.half_frame_limit_s)
        self._conversation: CbConversation | None = None
        self._known_session: int | None = None
        self._last_seq = 0
        self._hanging_up: set[asyncio.Task[None]] = set()

    def start(self) -> None:
        shorten_switch_interval()
        super().start()

    def conversation(self) -> CbConversation:
        """The current conversation; raises DeviceUnreachable."""
        if self._conversation is None:
            raise self._unreachable()
        return self._conversation

    async def close(self) -> None:
        """Send BYE when connected, and stop connecting."""
        if self._conversation is not None:
            bye = asyncio.ensure_future(self._conversation.ask(Bye()))
            await self._timing.wait_until_done(bye, BYE_LIMIT_S)
            bye.cancel()
            await asyncio.gather(bye, return_exceptions=True)
        await super().close()
        await asyncio.gather(*self._hanging_up)

    async def _look(self) -> None:
        while True:
            try:
                connection = await self._transport.connect()
                error = await self._converse(connection)
            except DeviceError as unreachable:
                error = unreachable
            self._end_conversation(error)
            await self._timing.sleep(self._backoff.next_wait_s())

    async def _converse(self, connection: Connection) -> DeviceError:
        """Run one connection from greeting to loss; returns the reason of the loss."""
        session = ClientSession(resynchronise=self._transport.resynchronise, last_seq=self._last_seq)
        conversation = CbConversation(
            self.device, connection, session, self._timing, self._limits, self._end_conversation
        )
        listening = asyncio.create_task(conversation.listen(), name=f"listens to {self.device}")
        beating = asyncio.create_task(self._greet_and_keep_alive(conversation), name=f"heartbeat to {self.device}")
        try:
            return await asyncio.shield(conversation.lost)
        finally:
            conversation.lose(LinkLost(self.device, "the link was closed here", "open it again to go on"))
            self._last_seq = session.last_seq
            for task in (listening, beating):
                task.cancel()
            hanging_up = asyncio.create_task(hang_up(connection, listening, beating), name=f"leaves {self.device}")
            self._hanging_up.add(hanging_up)
            hanging_up.add_done_callback(self._hanging_up.discard)
            await asyncio.shield(hanging_up)  # shielded, so that a concurrent close cannot leave the port open

    async def _greet_and_keep_alive(self, conversation: CbConversation) -> None:
        try:
            welcome = await conversation.greet()
        except DeviceError as error:
            conversation.lose(error)
            return
        restarted = self._known_session not in (None, welcome.session)
        self._known_session = welcome.session
        self._backoff.reset()
        self._conversation = conversation
        news = "the controller restarted since the last connection, " if restarted else ""
        self._report.up(f"{news}connected in session {welcome.session}, disarmed")
        self._connected.set()
        await conversation.keep_alive()

    def _end_conversation(self, error: DeviceError) -> None:
        self._conversation = None
        self._connected.clear()
        self._report.down(f"{error.what}: {error.fix}")


async def hang_up(connection: Connection, *tasks: "asyncio.Task[None]") -> None:
    """Close the connection once the cancelled tasks have left it."""
    await asyncio.gather(*tasks, return_exceptions=True)
    await connection.close()
