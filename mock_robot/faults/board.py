"""Named faults, and the board that switches those of a cell.

A fault of controller and link acts in up to four places: on the controller's state when it begins (`begin`), on a
reply before encoding (`reply`), on encoded bytes sent (`send`) and on bytes received (`receive`). One of camera or
scanner acts before the capture (`delay_s`, `status`), in the scene (`hides_target`), on captured data (`picture`,
`points`) or on the encoded file (`content`). New faults are new rows of `tables`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.cabinet.wire_steps import Send, WireStep
from mock_robot.errors import NoSuchState, UnknownFault
from protocols.cb.codes import Command
from protocols.cb.messages import Reply

SendFault = Callable[[bytes, Random], tuple[WireStep, ...]]
ReceiveFault = Callable[[bytes, Random], bytes]
ReplyFault = Callable[[Reply], Reply]
StateFault = Callable[[Cabinet, float], None]
Picture = NDArray[np.uint8]
Points = NDArray[np.float32]


@dataclass(frozen=True)
class Fault:
    """One fault. `strikes`: how many times it acts by default; None: until cleared."""

    name: str
    summary: str
    strikes: int | None = 1
    begin: StateFault | None = None
    end: StateFault | None = None
    reply: ReplyFault | None = None
    send: SendFault | None = None
    receive: ReceiveFault | None = None

    @property
    def area(self) -> str:
        """link, serial, robot, rws, egm, camera or scanner: the first word of its name."""
        return self.name.partition("-")[0]


@dataclass(frozen=True, kw_only=True)
class DeviceFault(Fault):
    """One of camera or scanner, whose strikes are captures.

    `repeats`: the previous file is sent again, with its true age (`honest`) or as if new (`lying`).
    """

    delay_s: float = 0.0
    status: int = 200
    hides_target: bool = False
    repeats: Literal["no", "honest", "lying"] = "no"
    picture: Callable[[Picture], Picture] | None = None
    points: Callable[[Points], Points] | None = None
    content: Callable[[bytes], bytes] | None = None


@dataclass
class ActiveFault:
    """A fault that is switched on. It stays inactive until `from_move` moves have been accepted."""

    fault: Fault
    strikes_left: int | None
    only: Command | None
    from_move: int
    awake: bool = False
    cleared: bool = False


@dataclass
class FaultBoard:
    """The faults that are on. Flipped bits and garbage depend only on the seed."""

    table: Mapping[str, Fault]
    seed: int = 0
    _active: dict[str, ActiveFault] = field(default_factory=dict, init=False)
    _random: Random = field(init=False)

    def __post_init__(self) -> None:
        self._random = Random(self.seed)

    @property
    def active(self) -> dict[str, ActiveFault]:
        return dict(self._active)

    def switch_on(
        self,
        name: str,
        controller: Cabinet,
        now_s: float,
        *,
        strikes: int | None = None,
        only: Command | None = None,
        after_moves: int = 0,
    ) -> None:
        """Switch a fault on: for `strikes` replies, only for replies to `only`, after `after_moves` further moves.

        Raises UnknownFault, and NoSuchState for a condition that camera and scanner lack.
        """
        if name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        fault = self.table[name]
        if isinstance(fault, DeviceFault) and (only is not None or after_moves):
            raise NoSuchState("condition of a camera or scanner fault", "only or after_moves", ("strikes",))
        from_move = controller.moves_accepted + after_moves
        self._active[name] = ActiveFault(fault, strikes or fault.strikes, only, from_move)
        self.wake(controller, now_s)

    def clear(self, controller: Cabinet, now_s: float, name: str | None = None) -> None:
        if name is not None and name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        for cleared in [name] if name is not None else list(self._active):
            active = self._active.pop(cleared, None)
            if active is None:
                continue
            active.cleared = True
            if active.awake and active.fault.end is not None:
                active.fault.end(controller, now_s)

    def wake(self, controller: Cabinet, now_s: float) -> None:
        """Begin the faults whose move has come."""
        for active in list(self._active.values()):
            if active.awake or controller.moves_accepted < active.from_move:
                continue
            active.awake = True
            if active.fault.begin is not None:
                active.fault.begin(controller, now_s)
                self._count_strike(active)
            if active.cleared and active.fault.end is not None:  # cleared by another thread before it began
                active.fault.end(controller, now_s)

    def is_on(self, name: str) -> bool:
        """Whether a fault is on and active."""
        return name in self._active and self._active[name].awake

    def strike(self, name: str) -> bool:
        """Whether a fault is on and active; counts as one strike."""
        on = self.is_on(name)
        if on:
            self._count_strike(self._active[name])
        return on

    def strike_device(self, device: str) -> tuple[DeviceFault, ...]:
        """Faults that affect this capture of the camera or the scanner; each loses one strike."""
        struck = []
        for active in list(self._active.values()):
            if isinstance(active.fault, DeviceFault) and active.fault.area == device:
                struck.append(active.fault)
                self._count_strike(active)
        return tuple(struck)

    def alter_incoming(self, data: bytes) -> bytes:
        for active in self._awake("receive"):
            assert active.fault.receive is not None
            data = active.fault.receive(data, self._random)
            self._count_strike(active)
        return data

    def alter_reply(self, command: Command | None, reply: Reply) -> Reply:
        for active in self._awake("reply", command):
            assert active.fault.reply is not None
            altered = active.fault.reply(reply)
            if altered is not reply:
                self._count_strike(active)
            reply = altered
        return reply

    def outgoing(self, command: Command | None, data: bytes) -> tuple[WireStep, ...]:
        """Wire steps for encoded bytes; the first active fault that applies decides."""
        for active in self._awake("send", command):
            assert active.fault.send is not None
            self._count_strike(active)
            return active.fault.send(data, self._random)
        return (Send(data),)

    def _awake(self, place: Literal["receive", "reply", "send"], command: Command | None = None) -> list[ActiveFault]:
        return [
            active
            for active in list(self._active.values())  # a copy, since a program's thread may iterate, too
            if active.awake
            and getattr(active.fault, place) is not None
            and (active.only is None or active.only == command or place == "receive")
        ]

    def _count_strike(self, active: ActiveFault) -> None:
        if active.strikes_left is not None:
            active.strikes_left -= 1
            if active.strikes_left <= 0:
                self._active.pop(active.fault.name, None)
