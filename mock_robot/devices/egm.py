"""EGM of the mock controller: 250 packets per second of the simulated arm's state to a client's port."""

import asyncio
from collections.abc import Callable
from math import pi, sin

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cabinet.panel import robot_sample
from mock_robot.faults.board import FaultBoard
from protocols.egm.messages import encode

PERIOD_S = 0.004
VIBRATION_MM, VIBRATION_HZ = 0.3, 12.0
"""Amplitude and frequency of the fault `egm-vibration`."""
LOST_EVERY = 5


class EgmSender(asyncio.DatagramProtocol):
    """The controller's side of EGM, a UDP client that sends from a port of its own."""

    def __init__(self, cabinet: Cabinet, faults: FaultBoard, clock: Callable[[], float]) -> None:
        self._cabinet, self._faults, self._clock = cabinet, faults, clock
        self._seqno = self.corrections = 0
        self._sending: asyncio.Task[None] | None = None
        self._transport: asyncio.DatagramTransport | None = None

    def datagram_received(self, data: bytes, address: object) -> None:
        """Count a packet that a client sends back; one that only monitors sends none."""
        self.corrections += 1

    async def start(self, host: str, port: int) -> None:
        """Send to that address until `close`."""
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=(host, port))
        self._sending = asyncio.create_task(self._send(), name="EGM")

    async def close(self) -> None:
        if self._sending is not None:
            self._sending.cancel()
            await asyncio.gather(self._sending, return_exceptions=True)
        if self._transport is not None:
            self._transport.close()

    def packet(self, now_s: float) -> bytes:
        robot_s, panel = self._cabinet.robot_s(now_s), self._cabinet.panel
        pose = self._cabinet.world_T_base @ self._cabinet.arm.reported_base_T_flange(robot_s)
        if self._faults.is_on("egm-vibration"):
            pose[2, 3] += VIBRATION_MM * sin(2 * pi * VIBRATION_HZ * now_s)
        self._seqno += 1
        return encode(robot_sample(self._seqno, now_s, self._cabinet.arm.joints_at(robot_s), pose, panel))

    async def _send(self) -> None:
        assert self._transport is not None
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            packet = self.packet(self._clock())
            silent = self._faults.is_on("egm-silent")
            lost = self._faults.is_on("egm-loss") and self._seqno % LOST_EVERY == 0
            if not (silent or lost):
                self._transport.sendto(b"\x00" + packet[:40] if self._faults.is_on("egm-garbage") else packet)
            due_s = max(due_s + PERIOD_S, loop.time() - 10 * PERIOD_S)
            await asyncio.sleep(max(due_s - loop.time(), 0.0))
