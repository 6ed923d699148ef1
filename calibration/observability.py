"""Can these motions determine X at all, and what do they tell least about?

Rotations about one axis leave the translation along it free, pure translations leave all of it free: Tsai & Lenz 1989,
lemma 2 and 3. What is not determined is refused with the reason, in words an operator can act on.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from calibration.closed_forms.motions import SMALLEST_TURN_RAD
from calibration.errors import UndeterminedError
from calibration.transforms import Array, rotation_angle_rad, vector_from_rotation

LEAST_TURN_RAD = np.radians(10.0)
"""Below this, robot and pixel noise turn into centimetres of X."""

LEAST_AXIS_ANGLE_RAD = np.radians(1.0)
"""Axes closer than this differ by noise, not by intent: the seed's, at 2.8 degrees, are just solvable."""

LEAST_AXIS_SPREAD = float(np.tan(LEAST_AXIS_ANGLE_RAD / 2))
"""Of two turns whose axes are that close. Weighted by the turns, it is not fooled by the axis of a small, noisy one."""

SAME_POSE_MM, SAME_POSE_RAD = 0.5, np.radians(0.05)
"""Two stations closer than this are one: it is the order of the robot's own repeatability."""

MOST_VIEWS_IN_PAIRS = 24
"""More views are thinned to this many before looking at every pair of them."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What the robot's orientations offer. `axis_angle_rad`: the largest angle between the axes of any two turns."""

    distinct: int
    max_rotation_rad: float
    axis_spread: float
    axis_angle_rad: float
    main_axis: Array


def distinct_stations(base_T_flange: Array) -> list[int]:
    """Rows of the poses (n, 4, 4) that are not a repetition of an earlier one."""
    if not len(base_T_flange):
        return []
    near = cKDTree(base_T_flange[:, :3, 3]).query_pairs(SAME_POSE_MM, output_type="ndarray")
    earlier, later = np.sort(near, axis=1).T
    turn = rotation_angle_rad(base_T_flange[earlier, :3, :3] @ np.swapaxes(base_T_flange[later, :3, :3], 1, 2))
    repetitions = set(later[np.asarray(turn) < SAME_POSE_RAD].tolist()) if len(near) else set()
    return [row for row in range(len(base_T_flange)) if row not in repetitions]


def motion_of(base_T_flange: Array) -> Motion:
    """Turns between all pairs of the robot's poses (n, 4, 4); their axes in the flange's frame."""
    distinct = base_T_flange[distinct_stations(base_T_flange)]
    if len(distinct) < 2:
        return Motion(len(distinct), 0.0, 0.0, 0.0, np.zeros(3))
    thin = distinct[np.unique(np.linspace(0, len(distinct) - 1, MOST_VIEWS_IN_PAIRS).astype(int))]
    i, j = np.triu_indices(len(thin), 1)
    turns = vector_from_rotation(np.swapaxes(thin[i, :3, :3], 1, 2) @ thin[j, :3, :3]).reshape(-1, 3)
    angles = np.linalg.norm(turns, axis=1)
    largest = float(angles.max(initial=0.0))
    turns, angles = turns[angles > SMALLEST_TURN_RAD], angles[angles > SMALLEST_TURN_RAD]
    if len(turns) < 1:
        return Motion(len(distinct), largest, 0.0, 0.0, np.zeros(3))
    # sin(angle / 2) is how far a turn moves what is not on its axis.
    axes = turns / angles[:, None]
    weighted = axes * np.sin(angles / 2)[:, None]
    values, vectors = np.linalg.eigh(weighted.T @ weighted)
    spread = float(np.sqrt(max(values[1], 0.0) / values[2]))
    widest = np.arccos(min(float(np.abs(axes @ axes.T).min()), 1.0))
    return Motion(len(distinct), largest, spread, float(widest), vectors[:, 2])


def require_determined(base_T_flange: Array) -> None:
    """Raises UndeterminedError when no method could find X from the motions between poses (n, 4, 4)."""
    motion = motion_of(base_T_flange)
    if motion.distinct < 3:
        raise UndeterminedError(
            "too-few-poses",
            f"{motion.distinct} distinct robot poses with the target in view; X needs at least three",
            "add poses that differ by 30 degrees or more about different axes",
        )
    if motion.max_rotation_rad < SMALLEST_TURN_RAD:
        raise UndeterminedError(
            "pure-translation",
            "the flange moves without turning: X's translation is not determined in any direction",
            "turn the flange by 30 degrees or more about two different axes between views",
        )
    if motion.max_rotation_rad < LEAST_TURN_RAD:
        raise UndeterminedError(
            "too-little-rotation",
            f"the flange turns by at most {np.degrees(motion.max_rotation_rad):.1f} degrees; X needs 10 or more",
            "turn the flange by 30 degrees or more about two different axes between views",
        )
    if motion.axis_angle_rad < LEAST_AXIS_ANGLE_RAD or motion.axis_spread < LEAST_AXIS_SPREAD:
        axis = axis_in_words(motion.main_axis, base_T_flange)
        raise UndeterminedError(
            "parallel-axes",
            f"all turns are about one axis: translation along {axis} is not determined",
            f"add poses turned by 30 degrees or more about an axis across {axis}",
        )


def axis_in_words(direction_flange: Array, base_T_flange: Array) -> str:
    """A direction of the flange's frame for people: the base's where all views agree on it, else the flange's."""
    in_base = base_T_flange[:, :3, :3] @ direction_flange
    mean = in_base.mean(axis=0)
    if np.linalg.norm(mean) > np.cos(np.radians(5.0)) * np.linalg.norm(direction_flange):
        return _named("base", mean)
    return _named("flange", direction_flange)


def _named(frame: str, direction: Array) -> str:
    direction = direction / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > np.cos(np.radians(15.0)):
        return f"the {frame}'s {'xyz'[axis]}"
    x, y, z = direction * np.sign(direction[axis])
    return f"({x:.2f}, {y:.2f}, {z:.2f}) of the {frame}"
