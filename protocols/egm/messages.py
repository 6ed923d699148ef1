"""EgmRobot, from bytes and back: of its fields those that tell where the arm is and whether it may move.

Field numbers are facts of ABB's message (package abb.egm, proto2): 1 header {1 seqno, 2 tm, 3 mtype}; 2 feedBack and
3 planned {1 joints, 2 cartesian {1 pos, 2 orient}, 3 externalJoints, 4 time {1 sec, 2 usec}}; 4 motorState; 5 mciState;
8 rapidExecState, each {1 state}. Degrees, millimetres, quaternions (u0, u1, u2, u3) = (w, x, y, z).
"""

from dataclasses import dataclass
from enum import IntEnum

from protocols.egm.protobuf import NotProtobuf, Value, double, doubles, fields, message, tagged_doubles, whole


class MessageType(IntEnum):
    """What a header announces."""

    UNDEFINED = 0
    COMMAND = 1
    DATA = 2
    CORRECTION = 3
    PATH_CORRECTION = 4


class NotEgm(ValueError):
    """The bytes are no message of a robot with a pose in it."""


@dataclass(frozen=True, slots=True)
class RobotSample:
    """One packet. `robot_ms` is the controller's clock, which begins anywhere and wraps."""

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
    """The sample in a packet. Raises NotEgm."""
    try:
        return _decoded(data)
    except (NotProtobuf, TypeError, AttributeError) as error:
        raise NotEgm(str(error)) from error


def _decoded(data: bytes) -> RobotSample:
    parts = _last(data)
    header, feedback = _last(_bytes(parts, 1)), _last(_bytes(parts, 2))
    if header.get(3) != MessageType.DATA:
        raise NotProtobuf(f"a header of type {header.get(3)!r}, not of a robot's data")
    pose = _last(_bytes(feedback, 2))
    x, y, z = _named(_bytes(pose, 1), 3)
    u0, u1, u2, u3 = _named(_bytes(pose, 2), 4)
    clock = _last(_bytes(feedback, 4)) if 4 in feedback else {}
    return RobotSample(
        seqno=_whole(header, 1),
        robot_ms=_whole(header, 2),
        joints_deg=_repeated(_bytes(feedback, 1)),
        position_mm=(x, y, z),
        quaternion_wxyz=(u0, u1, u2, u3),
        external_axes=_repeated(_bytes(feedback, 3)) if 3 in feedback else (),
        time_us=_whole(clock, 1) * 1_000_000 + _whole(clock, 2),
        motors_on=4 in parts and _last(_bytes(parts, 4)).get(1) == 1,
        program_running=8 in parts and _last(_bytes(parts, 8)).get(1) == 2,
    )


def _last(data: bytes) -> dict[int, Value]:
    return dict(fields(data))


def _bytes(parts: dict[int, Value], number: int) -> bytes:
    value = parts.get(number)
    if not isinstance(value, bytes):
        raise NotProtobuf(f"no message in field {number}")
    return value


def _whole(parts: dict[int, Value], number: int) -> int:
    value = parts.get(number, 0)
    if not isinstance(value, int):
        raise NotProtobuf(f"no whole number in field {number}")
    return value


def _named(data: bytes, count: int) -> list[float]:
    """Doubles in fields 1 to `count`, all of which must be there."""
    at_once = tagged_doubles(data, range(1, count + 1))
    if at_once is not None:
        return list(at_once)
    parts = _last(data)
    values = [parts.get(number) for number in range(1, count + 1)]
    if not all(isinstance(value, float) for value in values):
        raise NotProtobuf(f"no {count} numbers")
    return [value for value in values if isinstance(value, float)]


def _repeated(data: bytes) -> tuple[float, ...]:
    """Doubles in field 1, one by one or packed."""
    at_once = tagged_doubles(data, (1,) * (len(data) // 9))
    if at_once is not None:
        return at_once
    values: list[float] = []
    for number, value in fields(data):
        if number == 1:
            values += doubles(value) if isinstance(value, bytes) else [float(value)]
    return tuple(values)


def encode(sample: RobotSample) -> bytes:
    """The packet that a controller sends of it; planned is where it is."""
    axes, extra = ((double(1, value) for value in each) for each in (sample.joints_deg, sample.external_axes))
    where = b"".join(
        (
            message(1, axes),
            message(
                2,
                (
                    message(1, (double(number, value) for number, value in enumerate(sample.position_mm, 1))),
                    message(2, (double(number, value) for number, value in enumerate(sample.quaternion_wxyz, 1))),
                ),
            ),
            message(3, extra),
            message(4, (whole(1, sample.time_us // 1_000_000), whole(2, sample.time_us % 1_000_000))),
        )
    )
    header = (whole(1, sample.seqno), whole(2, sample.robot_ms), whole(3, MessageType.DATA))
    return b"".join(
        (
            message(1, header),
            message(2, (where,)),
            message(3, (where,)),
            message(4, (whole(1, 1 if sample.motors_on else 2),)),
            message(5, (whole(1, 2),)),
            whole(6, 0),
            message(8, (whole(1, 2 if sample.program_running else 1),)),
        )
    )
