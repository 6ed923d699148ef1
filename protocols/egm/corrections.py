"""EgmSensor and EgmSensorPathCorr messages: what a sensor sends to a controller that it guides.

Field numbers are facts of ABB's messages (package abb.egm, proto2). EgmSensor: 1 header {1 seqno, 2 tm, 3 mtype},
2 planned {1 joints, 2 cartesian {1 pos, 2 orient}}. EgmSensorPathCorr: 1 header, 2 pathCorr {1 pos, 2 age}. Degrees,
millimetres, quaternions (u0, u1, u2, u3) = (w, x, y, z). Euler angles and speed references are not read.
"""

from dataclasses import dataclass

from protocols.egm.messages import MessageType, NotEgm
from protocols.egm.protobuf import NotProtobuf, Value, doubles, fields


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


def _numbers(data: bytes) -> tuple[float, ...]:
    """Doubles in the order of their fields, repeated singly or packed."""
    values: list[float] = []
    for _, value in fields(data):
        values += doubles(value) if isinstance(value, bytes) else [float(value)]
    return tuple(values)
