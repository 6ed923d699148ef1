"""EgmRobot messages, encoded and decoded, as far as pose, motors and program state need; and what a sensor
sends to a controller that it guides: EgmSensor and EgmSensorPathCorr.

Field numbers are facts of ABB's message (package abb.egm, proto2): 1 header {1 seqno, 2 tm, 3 mtype}; 2 feedBack and
3 planned {1 joints, 2 cartesian {1 pos, 2 orient}, 3 externalJoints, 4 time {1 sec, 2 usec}}; 4 motorState; 5 mciState;
8 rapidExecState, each {1 state}. Degrees, millimetres, quaternions (u0, u1, u2, u3) = (w, x, y, z).

EgmSensor: 1 header {1 seqno, 2 tm, 3 mtype}, 2 planned {1 joints, 2 cartesian {1 pos, 2 orient}}. EgmSensorPathCorr:
1 header, 2 pathCorr {1 pos, 2 age}. Euler angles and speed references are not read.
"""

from dataclasses import dataclass
from enum import IntEnum

from protocols.egm.protobuf import Message, NotEgm, double_field, integer_field, message_field


class MessageType(IntEnum):
    UNDEFINED = 0
    COMMAND = 1
    DATA = 2
    CORRECTION = 3
    PATH_CORRECTION = 4


@dataclass(frozen=True, slots=True)
class RobotSample:
    """One packet. `robot_ms` is the controller's clock, of arbitrary origin; it wraps."""

    seqno: int
    robot_ms: int
    joints_deg: tuple[float, ...]
    position_mm: tuple[float, float, float]
    quaternion_wxyz: tuple[float, float, float, float]
    external_axes: tuple[float, ...] = ()
    time_us: int = 0
    motors_on: bool = False
    program_running: bool = False


def decode(data: bytes) -> RobotSample:
    """Decode a packet. Raises NotEgm."""
    packet = Message(data)
    header, feedback = packet.message(1), packet.message(2)
    if header.integer(3) != MessageType.DATA:
        raise NotEgm(f"a header of type {header.integer(3)}, not of a robot's data")
    if 2 not in feedback:
        raise NotEgm("joints only", "without a Cartesian pose")
    position, rotation = feedback.message(2).message(1), feedback.message(2).message(2)
    clock = feedback.optional(4)
    return RobotSample(
        seqno=header.integer(1),
        robot_ms=header.integer(2),
        joints_deg=feedback.message(1).doubles(only=1),
        position_mm=(position.double(1), position.double(2), position.double(3)),
        quaternion_wxyz=(rotation.double(1), rotation.double(2), rotation.double(3), rotation.double(4)),
        external_axes=feedback.optional(3).doubles(only=1),
        time_us=clock.integer(1) * 1_000_000 + clock.integer(2),
        motors_on=packet.optional(4).integer(1) == 1,
        program_running=packet.optional(8).integer(1) == 2,
    )


def encode(sample: RobotSample) -> bytes:
    """Encode a packet as a controller sends it; the planned pose equals the feedback."""
    seconds, microseconds = divmod(sample.time_us, 1_000_000)
    where = (
        message_field(1, (double_field(1, value) for value in sample.joints_deg)),
        message_field(2, (_numbered(1, sample.position_mm), _numbered(2, sample.quaternion_wxyz))),
        message_field(3, (double_field(1, value) for value in sample.external_axes)),
        message_field(4, (integer_field(1, seconds), integer_field(2, microseconds))),
    )
    header = (integer_field(1, sample.seqno), integer_field(2, sample.robot_ms), integer_field(3, MessageType.DATA))
    return b"".join(
        (
            message_field(1, header),
            message_field(2, where),
            message_field(3, where),
            message_field(4, (integer_field(1, 1 if sample.motors_on else 2),)),
            message_field(5, (integer_field(1, 2),)),
            integer_field(6, 0),
            message_field(8, (integer_field(1, 2 if sample.program_running else 1),)),
        )
    )


def _numbered(number: int, values: tuple[float, ...]) -> bytes:
    """A field with a message of doubles in its fields 1, 2, ..."""
    return message_field(number, (double_field(at, value) for at, value in enumerate(values, 1)))


@dataclass(frozen=True, slots=True)
class Correction:
    """One packet of a sensor, with what it names: axes in degrees, a pose in mm and wxyz, or mm across the path."""

    seqno: int
    joints_deg: tuple[float, ...] = ()
    position_mm: tuple[float, ...] = ()
    quaternion_wxyz: tuple[float, ...] = ()
    across_path_mm: tuple[float, ...] = ()


def decode_correction(data: bytes) -> Correction:
    """Decode a packet. Raises NotEgm."""
    packet = Message(data)
    header, planned = packet.message(1), packet.optional(2)
    first = planned.optional(1).doubles()
    if header.integer(3) == MessageType.PATH_CORRECTION:
        return Correction(header.integer(1), across_path_mm=first)
    if header.integer(3) != MessageType.CORRECTION:
        raise NotEgm(f"a header of type {header.integer(3)}, not of a correction")
    pose = planned.optional(2)
    return Correction(header.integer(1), first, pose.optional(1).doubles(), pose.optional(2).doubles())
