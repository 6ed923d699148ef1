"""The joints of a session's views: of poses without any, whether they are those of each pose, and whence axes came."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import AXES
from calibration.kinematics.joint_check import (
    LEVER_MM,
    MIN_FRAME_VIEWS,
    JointMistake,
    JointsDisagree,
    axes_in_words,
    distances_mm,
    in_another_frame,
    require_consistent_joints,
)
from calibration.sentences.sentence import pictures
from calibration.transforms import Array, inverse, vector_from_transform

MAX_VIEW_OFF_MM = 0.1
"""Largest distance in one view that an arm's errors are identified from: controllers agree with the drawing to 0.02."""

SHIFT_ROUNDS, MIN_SHIFT_RAD = 3, float(np.radians(1e-3))

MIN_APPROACH_RAD = float(np.radians(0.05))
"""Travel beyond which an axis has taken up its play."""

Confdata = tuple[int, int, int, int]


def joints_of_poses(
    arm: Arm, base_T_flange: Sequence[Array], known_rad: Sequence[Array | None], confdata: Sequence[Confdata | None]
) -> list[Array | None]:
    """Joints (6,) of each pose (4, 4): the known ones, else those of its confdata, else None.

    A pose has up to eight solutions, of which pictures show none to be the right one: with axis 5 turned over and axes
    4 and 6 by half a turn all of them fit alike, with other errors of the arm. Raises UnreachablePoseError.
    """
    found: list[Array | None] = []
    for pose, known, posture in zip(base_T_flange, known_rad, confdata, strict=True):
        joints = known
        if known is None and posture is not None:
            before = found[-1] if found else None
            goes_on = before is not None and tuple(arm.configuration(before)) == posture
            joints = arm.matching(pose, posture, before if goes_on else None)
        found.append(joints)
    return found


def approach_sides(joints_rad: Array) -> Array:
    """Sides (n, 6) as of Postures, of an arm that goes from each of the postures (n, 6) straight to the next.

    Not known of the first, nor of an axis that has hardly moved.
    """
    moved = np.diff(joints_rad, axis=0, prepend=joints_rad[:1])
    sides: Array = np.where(np.abs(moved) > MIN_APPROACH_RAD, np.sign(moved), 0.0)
    return sides


def require_joints_of_each_view(
    arm: Arm, joints_rad: Array, base_T_flange: Array, others: Mapping[str, Arm], views: Sequence[int]
) -> None:
    """As `require_consistent_joints`, and where the joints of any one of the `views`, by their indices, do not."""
    drawn = arm.forward(joints_rad)
    off_mm = distances_mm(drawn, base_T_flange)
    wrong = np.flatnonzero(off_mm > MAX_VIEW_OFF_MM)
    if not len(wrong):
        return
    mistake = None
    if len(views) - len(wrong) >= MIN_FRAME_VIEWS:
        mistake = _of_swapped_views(drawn, base_T_flange, wrong, views)
    if mistake is None:
        require_consistent_joints(arm, joints_rad, base_T_flange, others)
        mistake = _of_all_views(arm, joints_rad, base_T_flange) if 2 * len(wrong) > len(views) else None
    raise JointsDisagree(
        mistake
        or JointMistake(
            "joints-contradict-poses",
            f"{pictures([views[row] for row in wrong.tolist()])}: the joints do not give the pose",
            "record both at the same moment, with three decimals and without corrections by the controller",
        ),
        float(off_mm.max()),
    )


def _of_swapped_views(drawn: Array, poses: Array, wrong: NDArray[np.intp], views: Sequence[int]) -> JointMistake | None:
    """The mistake where each view in the places `wrong` has the joints of some other."""
    off_mm = np.array([distances_mm(np.broadcast_to(drawn[row], poses.shape), poses) for row in wrong])
    if off_mm.min(axis=1).max() > MAX_VIEW_OFF_MM:
        return None
    here, there = (pictures([views[row] for row in rows]) for rows in (wrong, off_mm.argmin(axis=1)))
    what = f"{here}: the joints are those of {there}"
    return JointMistake("joints-of-another-view", what, "give each view its own joints")


def _of_all_views(arm: Arm, joints: Array, poses: Array) -> JointMistake | None:
    """The mistake that most views have in common and that moves the flange by millimetres at most."""
    shift = _shift_rad(arm, joints, poses)
    if distances_mm(arm.forward(joints + shift), poses).max() <= MAX_VIEW_OFF_MM:
        axes = np.flatnonzero(np.abs(shift) > MIN_SHIFT_RAD)
        sizes = " and ".join(f"{-size:.3f}°" for size in np.degrees(shift[axes]))
        what = f"the zeros of {axes_in_words([int(axis) + 1 for axis in axes])} are shifted by {sizes}"
        return JointMistake("joints-with-shifted-zeros", what, "take joints and poses from one controller")
    degrees = np.degrees(joints)
    for decimals in range(3):
        if np.allclose(degrees, np.round(degrees, decimals), rtol=0, atol=1e-6):
            what = f"the joints are rounded to {10.0**-decimals:g}°"
            fix = "record them with three decimals, or leave them out and record the confdata"
            return JointMistake("joints-rounded", what, fix)
    return in_another_frame(arm.forward(joints), poses, MAX_VIEW_OFF_MM)


def _shift_rad(arm: Arm, joints: Array, poses: Array) -> Array:
    """The constant (6,) that, added to the joints, gives the poses best."""
    shift, steps = np.zeros(AXES), 1e-6 * np.eye(AXES)
    for _ in range(SHIFT_ROUNDS):
        drawn = arm.forward(joints + shift)
        slopes = [_off_by(drawn, arm.forward(joints + shift + step)) / 1e-6 for step in steps]
        shift = shift + np.linalg.lstsq(np.array(slopes).T, _off_by(drawn, poses), rcond=None)[0]
    return shift


def _off_by(poses: Array, others: Array) -> Array:
    """Motions (6 n,) from poses to others, rotations as those of a point at LEVER_MM."""
    return np.ravel(vector_from_transform(inverse(poses) @ others) * np.repeat([LEVER_MM, 1.0], 3))
