"""An ABB controller over the CB link, by TCP or serial line."""

import asyncio
import contextlib
from dataclasses import replace
from typing import Literal

from calibration.transforms import Array
from drivers.errors import DeviceError, MoveFailed, MoveRefused, MoveStalled
from drivers.interfaces import JointGoal, MoveGoal, PoseReading, RobotCapabilities, RobotSetup, RobotStatus, Standstill
from drivers.robots.abb import cb_wire
from drivers.robots.abb.cb_link import CbLink
from drivers.robots.abb.cb_session import REPLY_LIMIT_S, Answered, CbConversation, OvertakenByStop
from drivers.robots.abb.cb_status_errors import MoveMonitor, move_failure, move_refusal, request_refusal
from drivers.robots.abb.controller_link import LinkedRobot
from drivers.robots.abb.robtarget import POSE_CONVENTION
from drivers.timing import Timing
from drivers.transports.transport import Transport
from protocols.cb.codes import Capability, Output, Status
from protocols.cb.messages import (
    ErrorText,
    GetError,
    GetJoints,
    GetPose,
    GetSetup,
    GetStatus,
    Joints,
    Move,
    MoveJoints,
    Pose,
    Refused,
    Report,
    Request,
    SetArmed,
    SetOutput,
    Setup,
    Stop,
)

POLL_S = 0.06

STOP_WAIT_S = 0.5
"""How long a move that ends on the way waits for its STOP to be answered; sending it goes on. Normally milliseconds."""


class CbRobot(LinkedRobot):
    """drivers.interfaces.Robot. Raises DeviceUnreachable before `start` and while disconnected."""

    _link: CbLink

    def __init__(
        self, transport: Transport, timing: Timing | None = None, *, limit_s: float | None = None, axes: int = 6
    ) -> None:
        self._device = f"robot {transport.address}"
        self._timing, self._axes = timing or Timing(), axes
        self._link = CbLink(self._device, transport, self._timing, REPLY_LIMIT_S if limit_s is None else limit_s)
        self._armed_in: CbConversation | None = None
        self._stopping: set[asyncio.Task[None]] = set()

    @property
    def capabilities(self) -> RobotCapabilities:
        return RobotCapabilities(moves=True, pose_convention=POSE_CONVENTION, pose_frame="world")

    async def read_pose(self) -> PoseReading:
        """Pose of tool0 in wobj0, whatever tool and work object are selected at the controller."""
        answered = await self._read(GetPose(), "reading the pose")
        assert isinstance(answered.reply, Pose)
        return cb_wire.pose_reading(self._device, answered.reply, answered.asked_at_s, self._axes)

    async def read_joints(self) -> Array:
        return cb_wire.joints_rad(self._device, await self._read_jointtarget(), self._axes)

    async def _read_jointtarget(self) -> Joints:
        answered = await self._read(GetJoints(), "reading the axes")
        assert isinstance(answered.reply, Joints)
        return answered.reply

    async def read_status(self) -> RobotStatus:
        answered = await self._read(GetStatus(), "reading the status")
        assert isinstance(answered.reply, Report)
        return cb_wire.robot_status(answered.reply, answered.asked_at_s)

    async def set_armed(self, armed: bool) -> None:
        """Allow or forbid motion in this connection; disarming is urgent. Raises RequestRefused.

        An arming that a STOP overtakes is refused (ABORTED), not repeated.
        """
        conversation = self._link.conversation()
        if not armed:
            await self._read(_set_armed(conversation, False), "disarming", conversation, urgent=True)
            self._armed_in = None
            return
        try:
            answered = await conversation.ask(_set_armed(conversation, True))
        except OvertakenByStop:
            raise request_refusal(self._device, "arming", Refused(Status.ABORTED)) from None
        self._require_accepted(answered, "arming")
        self._armed_in = conversation

    async def stop_and_disarm(self) -> None:
        """Stop and disarm now; overtakes every other request."""
        conversation = self._link.conversation()
        stopped, disarmed = await conversation.ask_in_turn(Stop(), _set_armed(conversation, False))
        self._require_accepted(stopped, "the stop")
        self._require_accepted(disarmed, "disarming")
        self._armed_in = None

    async def read_standstill(self) -> Standstill:
        """Whether the arm stands, without a move in progress or pending, and is disarmed; urgent."""
        report = (await self._read(GetStatus(), "reading the status", urgent=True)).reply
        assert isinstance(report, Report)
        return cb_wire.standstill(report)

    async def move_to(self, goal: MoveGoal) -> None:
        """Move and return when the arm stands at the goal. Cancellation or an error on the way stops the arm, and is
        raised after STOP_WAIT_S at most, whether or not a frozen controller has answered."""
        await self._move(cb_wire.move_of(self._device, goal))

    async def _move(self, move: Move | MoveJoints) -> None:
        # A link that was lost since the arming ends the move as LinkLost; the new one would refuse it as not armed.
        conversation = self._armed_in or self._link.conversation()
        try:
            await self._arrive(conversation, await self._begin(conversation, move))
        except BaseException as error:
            if isinstance(error, MoveRefused | MoveFailed) and not isinstance(error, MoveStalled):
                raise  # nothing is under way
            stopping = asyncio.create_task(_stop_quietly(conversation), name=f"stops {self._device}")
            self._stopping.add(stopping)
            stopping.add_done_callback(self._stopping.discard)
            await self._timing.wait_until_done(stopping, STOP_WAIT_S)
            raise
        finally:
            if conversation.lost.done():
                self._armed_in = None

    async def move_to_joints(self, goal: JointGoal) -> None:
        """Move all axes to their angles (MoveAbsJ); otherwise as `move_to`."""
        if not goal.external_axes:  # of a jointtarget: where a robtarget has the arm angle, it has axis 7
            goal = replace(goal, external_axes=(await self._read_jointtarget()).external_axes)
        await self._move(cb_wire.joint_move_of(self._device, goal, self._axes))

    async def read_setup(self) -> RobotSetup:
        """The load on the flange and the limits that the modules hold moves to. Raises RequestRefused for old ones."""
        setup = (await self._read(GetSetup(), "reading the settings")).reply
        assert isinstance(setup, Setup)
        return cb_wire.robot_setup(setup)

    async def switch_output(self, output: Literal["light", "trigger"], on: bool) -> None:
        """Switch an output that the modules name. Raises RequestRefused when they name none."""
        which = Output.LIGHT if output == "light" else Output.TRIGGER
        await self._read(SetOutput(which, on), f"switching the {output}")

    async def _read(
        self, request: Request, doing: str, conversation: CbConversation | None = None, *, urgent: bool = False
    ) -> Answered:
        """Send a request that may be repeated: it is sent again when a STOP overtook it."""
        conversation = conversation or self._link.conversation()
        while True:
            with contextlib.suppress(OvertakenByStop):
                answered = await conversation.ask(request, urgent=urgent)
                self._require_accepted(answered, doing)
                return answered

    def _require_accepted(self, answered: Answered, doing: str) -> None:
        """Raises RequestRefused."""
        if isinstance(answered.reply, Refused):
            raise request_refusal(self._device, doing, answered.reply)

    async def _begin(self, conversation: CbConversation, move: Move | MoveJoints) -> int:
        """Number of the accepted move. A lost answer is requested again only under the same number."""
        try:
            answered = await conversation.ask(move)
        except OvertakenByStop:
            raise move_failure(self._device, Status.ABORTED) from None
        if isinstance(answered.reply, Refused):
            raise move_refusal(self._device, answered.reply)
        return answered.seq

    async def _arrive(self, conversation: CbConversation, seq: int) -> None:
        """Poll until move `seq` has ended. Bound to its conversation: a reconnect ends it as LinkLost."""
        arrival = MoveMonitor(self._device, seq)
        while True:
            await self._timing.sleep(POLL_S)
            answered = await self._read(GetStatus(), "reading the status", conversation)
            assert isinstance(answered.reply, Report)
            try:
                if arrival.has_arrived(answered.reply, self._timing.clock()):
                    return
            except MoveFailed as failed:
                if failed.status != Status.MOTION_ERROR.name:
                    raise
                raise move_failure(self._device, Status.MOTION_ERROR, await self._error(conversation)) from None

    async def _error(self, conversation: CbConversation) -> ErrorText | None:
        """ABB's number and words about the error of the last move; None from modules that do not give them."""
        if not conversation.session.capabilities & Capability.REPORTS_ERRORS:
            return None
        with contextlib.suppress(DeviceError):
            reply = (await self._read(GetError(), "reading the error", conversation)).reply
            assert isinstance(reply, ErrorText)
            return reply
        return None


def _set_armed(conversation: CbConversation, armed: bool) -> SetArmed:
    session = conversation.session.session
    assert session is not None
    return SetArmed(session, armed)


async def _stop_quietly(conversation: CbConversation) -> None:
    """Send STOP while the link is up; otherwise the controller stops by itself after 2 s of silence."""
    with contextlib.suppress(DeviceError, OvertakenByStop):
        await conversation.ask(Stop())
