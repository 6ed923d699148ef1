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

from protocols.egm.protobuf import (
    NotProtobuf,
    Value,
    double_field,
    doubles,
    doubles_by_tags,
    fields,
    integer_field,
    message_field,
)


class MessageType(IntEnum):
    UNDEFINED = 0
    COMMAND = 1
    DATA = 2
    CORRECTION = 3
    PATH_CORRECTION = 4


class NotEgm(ValueError):
    """The bytes are not an EgmRobot message with a pose; `why`: what packets of this kind are."""

    def __init__(self, what: str, why: str = "that are no EGM data of a robot") -> None:
        super().__init__(what)
        self.why = why


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
    try:
        return _decode(data)
    except (NotProtobuf, TypeError, AttributeError) as error:
        raise NotEgm(str(error)) from error


def _decode(data: bytes) -> RobotSample:
    parts = dict(fields(data))
    header, feedback = dict(fields(_message_field(parts, 1))), dict(fields(_message_field(parts, 2)))
    if header.get(3) != MessageType.DATA:
        raise NotProtobuf(f"a header of type {header.get(3)!r}, not of a robot's data")
    if 2 not in feedback:
        raise NotEgm("joints only", "without a Cartesian pose")
    pose = dict(fields(_message_field(feedback, 2)))
    x, y, z = _doubles_by_field(_message_field(pose, 1), 3)
    u0, u1, u2, u3 = _doubles_by_field(_message_field(pose, 2), 4)
    clock = dict(fields(_message_field(feedback, 4))) if 4 in feedback else {}
    return RobotSample(
        seqno=_integer_field(header, 1),
        robot_ms=_integer_field(header, 2),
        joints_deg=_double_list(_message_field(feedback, 1)),
        position_mm=(x, y, z),
        quaternion_wxyz=(u0, u1, u2, u3),
        external_axes=_double_list(_message_field(feedback, 3)) if 3 in feedback else (),
        time_us=_integer_field(clock, 1) * 1_000_000 + _integer_field(clock, 2),
        motors_on=4 in parts and dict(fields(_message_field(parts, 4))).get(1) == 1,
        program_running=8 in parts and dict(fields(_message_field(parts, 8))).get(1) == 2,
    )


def _message_field(parts: dict[int, Value], number: int) -> bytes:
    value = parts.get(number)
    if not isinstance(value, bytes):
        raise NotProtobuf(f"field {number} holds no message")
    return value


def _integer_field(parts: dict[int, Value], number: int) -> int:
    value = parts.get(number, 0)
    if not isinstance(value, int):
        raise NotProtobuf(f"no whole number in field {number}")
    return value


def _doubles_by_field(data: bytes, count: int) -> list[float]:
    """Doubles of fields 1 to `count`, each of which must be present."""
    at_once = doubles_by_tags(data, range(1, count + 1))
    if at_once is not None:
        return list(at_once)
    parts = dict(fields(data))
    values = [parts.get(number) for number in range(1, count + 1)]
    if not all(isinstance(value, float) for value in values):
        raise NotProtobuf(f"no {count} numbers")
    return [value for value in values if isinstance(value, float)]


def _double_list(data: bytes) -> tuple[float, ...]:
    """Doubles of field 1, repeated singly or packed."""
    at_once = doubles_by_tags(data, (1,) * (len(data) // 9))
    return _numbers(data, only=1) if at_once is None else at_once


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
    try:
        parts = dict(fields(data))
        header, planned = dict(fields(_bytes(parts.get(1)))), dict(fields(_bytes(parts.get(2))))
        seqno = header.get(1, 0)
        if header.get(3) == MessageType.PATH_CORRECTION:
            return Correction(int(seqno), across_path_mm=_numbers(_bytes(planned.get(1))))
        if header.get(3) != MessageType.CORRECTION:
            raise NotProtobuf(f"a header of type {header.get(3)!r}, not of a correction")
        pose = dict(fields(_bytes(planned.get(2))))
        return Correction(
            int(seqno), _numbers(_bytes(planned.get(1))), _numbers(_bytes(pose.get(1))), _numbers(_bytes(pose.get(2)))
        )
    except (NotProtobuf, TypeError, ValueError) as error:
        raise NotEgm(str(error)) from error


def _bytes(value: Value | None) -> bytes:
    """A nested message; an empty one where there is none."""
    return value if isinstance(value, bytes) else b""


def _numbers(data: bytes, only: int | None = None) -> tuple[float, ...]:
    """Doubles in the order of their fields, repeated singly or packed; `only`: of that field alone."""
    values = (value for number, value in fields(data) if only in (None, number))
    return tuple(x for value in values for x in (doubles(value) if isinstance(value, bytes) else (float(value),)))
