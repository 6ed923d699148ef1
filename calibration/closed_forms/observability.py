"""Whether the robot's motions determine X, and in which direction they determine it least.

Rotations about one axis leave the translation along it free, pure translations leave all of it free: Tsai & Lenz 1989,
lemmas 2 and 3. Motions that do not determine X are refused with the reason and what to do. An arm that cannot tilt (a
palletiser, a SCARA) leaves that translation alone open, if it also travels across its axis (docs/decisions/0042).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.motions import MIN_TURN_RAD
from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, rotation_angle_rad, vector_from_rotation

MIN_ROTATION_RAD = np.radians(10.0)
"""Least largest rotation between views; below it the usual robot and pixel noise give centimetres of error in X."""

MIN_AXIS_ANGLE_RAD = np.radians(1.0)
"""Axes closer than this differ only by noise. The original session's axes, 2.8 degrees apart, are just solvable."""

MIN_AXIS_SPREAD = float(np.tan(MIN_AXIS_ANGLE_RAD / 2))
"""Axis spread of two equal turns with axes MIN_AXIS_ANGLE_RAD apart; weighted, so that small noisy turns count less."""

SAME_POSE_MM, SAME_POSE_RAD = 0.5, np.radians(0.05)
"""Two stations closer than this count as one; the order of a robot's repeatability."""

MIN_TRAVEL_MM = 20.0
"""Least travel across the only axis of rotation; with less, X's rotation about it is uncertain by degrees."""

PARALLEL_AXES = "parallel-axes"
"""Code of the refusal of turns about one axis."""

MAX_VIEWS_IN_PAIRS = 24
"""More views than this are thinned before all pairs are formed."""


@dataclass(frozen=True, eq=False)
class MotionSummary:
    """Rotations between the robot's poses.

    distinct : number of distinct stations.
    max_rotation_rad : the largest rotation between two of them.
    axis_spread : 0 when all rotation axes are parallel, 1 when evenly spread over two directions.
    axis_angle_rad : the largest angle between the axes of any two rotations.
    main_axis : (3,) the direction about which the rotations turn most, in the flange's frame.
    """

    distinct: int
    max_rotation_rad: float
    axis_spread: float
    axis_angle_rad: float
    main_axis: Array


def distinct_stations(base_T_flange: Array) -> list[int]:
    """Rows of the poses (n, 4, 4) that do not repeat an earlier one."""
    return [row for row, pose in enumerate(base_T_flange) if not np.any(at_station(base_T_flange[:row], pose))]


def at_station(base_T_flange: Array, pose: Array) -> NDArray[np.bool_]:
    """Mask (n,) of the poses (n, 4, 4) that are this one (4, 4), as exactly as an arm comes back."""
    same: NDArray[np.bool_] = np.sum((base_T_flange[:, :3, 3] - pose[:3, 3]) ** 2, axis=1) <= SAME_POSE_MM**2
    same[same] = rotation_angle_rad(base_T_flange[same, :3, :3] @ pose[:3, :3].T) < SAME_POSE_RAD
    return same


def summarise_motion(base_T_flange: Array) -> MotionSummary:
    """Rotations between all pairs of the robot's poses (n, 4, 4), with axes in the flange's frame."""
    distinct = base_T_flange[distinct_stations(base_T_flange)]
    if len(distinct) < 2:
        return MotionSummary(len(distinct), 0.0, 0.0, 0.0, np.zeros(3))
    thin = distinct[np.unique(np.linspace(0, len(distinct) - 1, MAX_VIEWS_IN_PAIRS).astype(int))]
    i, j = np.triu_indices(len(thin), 1)
    turns = vector_from_rotation(np.swapaxes(thin[i, :3, :3], 1, 2) @ thin[j, :3, :3]).reshape(-1, 3)
    angles = np.linalg.norm(turns, axis=1)
    largest = float(angles.max(initial=0.0))
    turns, angles = turns[angles > MIN_TURN_RAD], angles[angles > MIN_TURN_RAD]
    if len(turns) < 1:
        return MotionSummary(len(distinct), largest, 0.0, 0.0, np.zeros(3))
    # A point off the axis moves in proportion to sin(angle / 2), so that weighs the axes.
    axes = turns / angles[:, None]
    weighted = axes * np.sin(angles / 2)[:, None]
    values, vectors = np.linalg.eigh(weighted.T @ weighted)
    spread = float(np.sqrt(max(values[1], 0.0) / values[2]))
    widest = np.arccos(min(float(np.abs(axes @ axes.T).min()), 1.0))
    return MotionSummary(len(distinct), largest, spread, float(widest), vectors[:, 2])


def only_axis(base_T_flange: Array) -> Array | None:
    """The axis (3,), in the flange's frame, of poses (n, 4, 4) that leave X's translation along it open and no more."""
    try:
        require_observable(base_T_flange)
    except UndeterminedError as undetermined:
        axis = summarise_motion(base_T_flange).main_axis
        alone = undetermined.code == PARALLEL_AXES and travel_across_mm(axis, base_T_flange) >= MIN_TRAVEL_MM
        return axis if alone else None
    return None


def require_observable(base_T_flange: Array, *, offset_given: bool = False) -> None:
    """Raises UndeterminedError when the motions between poses (n, 4, 4) do not determine X.

    Codes: `too-few-poses`, `pure-translation`, `too-little-rotation`, `parallel-axes`. `offset_given`: X's translation
    along the only axis of rotation is known.
    """
    motion = summarise_motion(base_T_flange)
    if motion.distinct < 3:
        raise UndeterminedError(
            "too-few-poses",
            Sentence("too-few-poses", poses=motion.distinct),
            Sentence("add-poses"),
        )
    if motion.max_rotation_rad < MIN_TURN_RAD:
        raise UndeterminedError("pure-translation", Sentence("pure-translation"), Sentence("turn-about-two-axes"))
    if motion.max_rotation_rad < MIN_ROTATION_RAD:
        raise UndeterminedError(
            "too-little-rotation",
            Sentence("too-little-rotation", angle_deg=np.degrees(motion.max_rotation_rad)),
            Sentence("turn-about-two-axes"),
        )
    if motion.axis_angle_rad < MIN_AXIS_ANGLE_RAD or motion.axis_spread < MIN_AXIS_SPREAD:
        moved = travel_across_mm(motion.main_axis, base_T_flange) >= MIN_TRAVEL_MM
        if not (moved and offset_given):
            raise _parallel_axes(motion.main_axis, base_T_flange, moved=moved)


def _parallel_axes(axis_flange: Array, base_T_flange: Array, *, moved: bool) -> UndeterminedError:
    """The refusal of turns about one axis (3,): which part of X is missing, and what to do."""
    axis = describe_axis(axis_flange, base_T_flange)
    x, y, z = np.round(axis_flange * np.sign(axis_flange[np.argmax(np.abs(axis_flange))]), 2) + 0.0  # no -0.00
    return UndeterminedError(
        PARALLEL_AXES,
        Sentence("parallel-axes-with-travel" if moved else "parallel-axes-without-travel", axis=axis, x=x, y=y, z=z),
        Sentence("turn-across" if moved else "turn-across-or-travel", axis=axis),
    )


def travel_across_mm(axis_flange: Array, base_T_flange: Array) -> float:
    """RMS distance, across the axis (3,), of the flanges (n, 4, 4) from where turns about one fixed line put them.

    X's rotation about the only axis of rotation shows in this travel alone.
    """
    turns = base_T_flange[:, :3, :3]
    across = np.linalg.svd((turns @ axis_flange).mean(axis=0)[None])[2][1:]
    centre_and_arm = np.concatenate([np.broadcast_to(across, (len(turns), 2, 3)), across @ turns], axis=2)
    design, places = centre_and_arm.reshape(-1, 6), (base_T_flange[:, :3, 3] @ across.T).ravel()
    missed = places - design @ np.linalg.lstsq(design, places)[0]
    return float(np.sqrt(np.sum(missed**2) / len(turns)))


def describe_axis(direction_flange: Array, base_T_flange: Array) -> str:
    """A direction (3,) of the flange's frame in words: in the base where all poses (n, 4, 4) agree, else the flange."""
    in_base = base_T_flange[:, :3, :3] @ direction_flange
    mean = in_base.mean(axis=0)
    if np.linalg.norm(mean) > np.cos(np.radians(5.0)) * np.linalg.norm(direction_flange):
        return describe_direction("base", mean)
    return describe_direction("flange", direction_flange)


def describe_direction(frame: str, direction: Array) -> str:
    """A direction (3,) of this frame in words."""
    direction = direction / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > np.cos(np.radians(15.0)):
        return f"the {frame}'s {'xyz'[axis]}"
    x, y, z = direction * np.sign(direction[axis])
    return f"({x:.2f}, {y:.2f}, {z:.2f}) of the {frame}"
