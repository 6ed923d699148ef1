"""An arm as one line of text: name, lengths in mm, limits and speeds in degrees, separated by `|`.

`My arm | 150 486.5 700 0 600 65 | 180 -90/120 -245/65 200 115 400 | 150 160 170 320 400 450`: base to axis 2
forward and up, lower arm, axis 4 above axis 3, forearm, wrist to flange, and a seventh for an arm whose axis 6 runs
above axis 4; limits of axes 1 to 6 (`170` means -170 to
170); speeds per second, which only the mock uses and which may be left out.
"""

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.offset_wrist import OffsetWristArm

SLOWEST = "90 60 60 100 100 190"
"""Speeds in deg/s of an arm whose speeds are not known."""

MAX_LENGTH_MM = 10_000.0
MAX_LIMIT_DEG = 3600.0


def read_arm_row(row: str) -> Arm:
    """The arm of a line. Raises GeometryError that names the part which is wrong."""
    parts = [part.strip() for part in row.split("|")]
    if len(parts) not in (3, 4) or not parts[0]:
        raise GeometryError(f"an arm is 'name | 6 lengths in mm | 6 limits in deg', got {row!r}")
    name, lengths, limits = parts[:3]
    given = lengths.split()
    forward, height, lower_arm, elbow_up, forearm, flange = _numbers(name, "lengths", given[:6])
    (offset,) = _numbers(name, "lengths", given[6:] or ["0"], 1)
    ranges = [_range(name, limit) for limit in limits.split()]
    if len(ranges) != 6:
        raise GeometryError(f"arm {name}: its limits are six, as 170 or -75/125, got {len(ranges)}")
    if not (0 < lower_arm <= MAX_LENGTH_MM and 0 < np.hypot(forearm, elbow_up) <= MAX_LENGTH_MM):
        raise GeometryError(f"arm {name}: lower arm and forearm are longer than 0 and at most {MAX_LENGTH_MM:g} mm")
    lower, upper = zip(*ranges, strict=True)
    speeds = _numbers(name, "speeds", (parts[3] if len(parts) == 4 else SLOWEST).split())
    if min(speeds) <= 0:
        raise GeometryError(f"arm {name}: its speeds are above 0 deg/s")
    arm = Arm(
        name=name,
        shoulder_forward_mm=forward,
        shoulder_height_mm=height,
        lower_arm_mm=lower_arm,
        elbow_up_mm=elbow_up,
        forearm_mm=forearm,
        flange_mm=flange,
        lower_rad=_radians(lower),
        upper_rad=_radians(upper),
        speed_rad_s=_radians(speeds),
    )
    return with_wrist_offset(arm, offset)


def with_wrist_offset(arm: Arm, offset_mm: float) -> Arm:
    """The arm with axis 6 that far above axis 4; 0 leaves it as it is."""
    lengths_and_limits = {field.name: getattr(arm, field.name) for field in fields(Arm)}
    return arm if offset_mm == 0 else OffsetWristArm(**lengths_and_limits, wrist_offset_mm=offset_mm)


def write_arm_row(arm: Arm) -> str:
    """The line of an arm, which `read_arm_row` reads; lengths to 0.0001 mm, angles to 0.0001 deg."""
    lengths = (
        arm.shoulder_forward_mm, arm.shoulder_height_mm, arm.lower_arm_mm, arm.elbow_up_mm, arm.forearm_mm,
        arm.flange_mm, *([arm.wrist_offset_mm] if arm.wrist_offset_mm else []),
    )  # fmt: skip
    limits = [
        _number(high) if low == -high else f"{_number(low)}/{_number(high)}"
        for low, high in np.degrees([arm.lower_rad, arm.upper_rad]).round(4).T.tolist()
    ]
    speeds = [_number(speed) for speed in np.degrees(arm.speed_rad_s).round(4).tolist()]
    return f"{arm.name} | {' '.join(map(_number, lengths))} | {' '.join(limits)} | {' '.join(speeds)}"


def _number(value: float) -> str:
    return f"{round(value, 4) + 0.0:.10g}"


def _range(name: str, limit: str) -> tuple[float, float]:
    """Lower and upper limit: `170` means ± 170, `-75/125` from -75 to 125."""
    try:
        lower, _, upper = limit.partition("/")
        low, high = (float(lower), float(upper)) if upper else (-float(lower), float(lower))
    except ValueError:
        raise GeometryError(f"arm {name}: {limit!r} is no limit: write 170 or -75/125") from None
    if not -MAX_LIMIT_DEG <= low < high <= MAX_LIMIT_DEG:
        raise GeometryError(f"arm {name}: the limit {limit!r} is empty or beyond {MAX_LIMIT_DEG:g} deg")
    return low, high


def _numbers(name: str, what: str, texts: list[str], count: int = 6) -> list[float]:
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.all(np.abs(numbers) <= MAX_LENGTH_MM):
        raise GeometryError(f"arm {name}: its {what} are six numbers, got {' '.join(texts)!r}")
    return numbers


def _radians(degrees: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(np.radians(angle)) for angle in degrees)
