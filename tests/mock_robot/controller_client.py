"""A client on a wire without a socket at the mock controller; time passes when the test says so."""

from dataclasses import dataclass, field

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.transforms import Array, quaternion_from_rotation
from mock_robot.arm.simulated_arm import ArmNoise, SimulatedArm
from mock_robot.cabinet.cabinet import MotionBox
from mock_robot.cabinet.wire_steps import Close, Send, WireStep
from mock_robot.faults.board import FaultBoard
from mock_robot.faults.tables import FAULTS
from mock_robot.links.cb_program import Controller
from mock_robot.links.servers import ControllerLink
from protocols.cb import messages as cb
from protocols.cb.client import ClientEvent, ClientSession, ReplyReceived
from protocols.cb.codes import MoveKind, Status

ARM = find_arm("IRB 1600-6/1.45")
HOME = np.radians([0.0, 15.0, 0.0, 0.0, 65.0, 0.0])
AWAY = np.radians([30.0, 10.0, 10.0, 20.0, 50.0, 40.0])
UNUSED = (9e9,) * 6


def move_to(joints: Array, speed_mm_s: float = 250.0, kind: MoveKind = MoveKind.JOINT) -> cb.Move:
    """The request that brings the flange where these joints have it."""
    pose = ARM.forward(joints)
    x, y, z = (float(value) for value in pose[:3, 3])
    q1, q2, q3, q4 = (float(value) for value in quaternion_from_rotation(pose[:3, :3]))
    return cb.Move((x, y, z), (q1, q2, q3, q4), ARM.configuration(joints), UNUSED, speed_mm_s, kind)


def fastest_mm_s(arm: SimulatedArm, points_mm: Array, step_s: float = 0.02) -> float:
    """Largest speed of points (k, 3), given in the flange's frame, during the current move or the last one."""
    motion = arm._motion
    times = np.arange(motion.start_s, motion.end_s + step_s, step_s)
    flanges = arm.arm.forward(np.array([motion.joints_at(float(time)) for time in times]))
    points = points_mm @ np.swapaxes(flanges[:, :3, :3], -1, -2) + flanges[:, None, :3, 3]
    return float(np.linalg.norm(np.diff(points, axis=0), axis=-1).max(initial=0.0) / step_s)


def bare_controller(joints: Array = HOME, noise: ArmNoise | None = None, time_scale: float = 1.0) -> Controller:
    arm = SimulatedArm(ARM, joints, noise or ArmNoise())
    return Controller(arm, session=77, box=MotionBox(), time_scale=time_scale)


@dataclass
class ControllerClient:
    """One client at the controller; `now_s` is the clock."""

    controller: Controller = field(default_factory=bare_controller)
    serial: bool = False
    now_s: float = 0.0
    closed: bool = False

    def __post_init__(self) -> None:
        self.faults = FaultBoard(FAULTS, seed=1)
        self.connects()

    def connects(self) -> None:
        self.link = ControllerLink(self.controller, self.faults, serial=self.serial, now_s=self.now_s)
        self.session = ClientSession(resynchronise=self.serial)
        self.closed = False

    def passes(self, seconds: float, step_s: float = 0.05) -> list[ClientEvent]:
        """Time passes; what the client hears meanwhile."""
        events: list[ClientEvent] = []
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s = min(self.now_s + step_s, end_s)
            events += self._hear(self.link.tick(self.now_s))
        return events

    def sends(self, data: bytes) -> list[ClientEvent]:
        return self._hear(self.link.receive_data(data, self.now_s))

    def asks(self, request: cb.Request) -> cb.Reply:
        """Send a request; its reply, which must be the only one."""
        events = self.sends(self.session.request(request))
        replies = [event.reply for event in events if isinstance(event, ReplyReceived)]
        assert len(replies) == 1, events
        return replies[0]

    def is_greeted(self) -> "ControllerClient":
        welcome = self.asks(cb.Hello(1, 1, 5))
        assert isinstance(welcome, cb.Welcome)
        return self

    def is_armed(self) -> "ControllerClient":
        self.is_greeted()
        assert self.asks(cb.SetArmed(self.controller.session, True)) == cb.ArmingDone()
        return self

    def report(self) -> cb.Report:
        report = self.asks(cb.GetStatus())
        assert isinstance(report, cb.Report)
        return report

    def pose(self) -> cb.Pose:
        pose = self.asks(cb.GetPose())
        assert isinstance(pose, cb.Pose)
        return pose

    def finishes(self, seq: int, within_s: float = 60.0) -> Status:
        """Ask for STATUS, as a daemon does, until the move has ended; its result."""
        for _ in range(int(within_s / 0.5)):
            self.passes(0.5)
            report = self.report()
            if report.finished_seq == seq:
                return Status(report.finished_status)
        raise AssertionError(f"move {seq} did not finish: {report}")

    def _hear(self, steps: list[WireStep]) -> list[ClientEvent]:
        heard: list[ClientEvent] = []
        for step in steps:
            if isinstance(step, Send):
                heard += self.session.receive_data(step.data)
            if isinstance(step, Close):
                self.closed = True
                self.controller.disconnect(self.now_s)
        return heard


def joints_now(client: ControllerClient) -> Array:
    return client.controller.arm.joints_at(client.controller.robot_s(client.now_s))
