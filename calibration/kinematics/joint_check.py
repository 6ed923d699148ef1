"""Whether joints and poses of a session are of the same arm, and what is likely wrong where they are not.

The controller computes poses from joints with the drawing's kinematics, so that both agree to the rounding. Where they
do not, the changes that people and programs make are tried one by one: unit, order, signs, zeros, another arm, poses of
a tool or in a work object. Nothing of that is an error of the arm, and none of it must be fitted as one.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from calibration.errors import CalibrationError
from calibration.kinematics.arm import Arm
from calibration.sentences.sentence import pictures
from calibration.transforms import Array, inverse, rotation_angle_rad, vector_from_rotation

MAX_OFF_MM = 3.0
"""Largest median distance of joints' and reported poses: a controller with its own corrections differs by less."""

MAX_VIEW_OFF_MM = 0.1
"""Largest distance in one view that an arm's errors are identified from: controllers agree with the drawing to 0.02."""

LEVER_MM = 500.0
"""A difference of rotation counts as that of a point so far from the flange."""

MAX_TRIED_VIEWS = 12
MIN_FRAME_VIEWS = 3
"""Any single view has some constant transform between its pose and its joints: fewer show no other frame."""
AXES, SHIFT_ROUNDS, MIN_SHIFT_RAD = 6, 3, float(np.radians(1e-3))
_SHIFTS_DEG = (90.0, -90.0, 180.0)


@dataclass(frozen=True)
class JointMistake:
    """A stable `code`, what is wrong, and what to do."""

    code: str
    what: str
    fix: str


class JointsDisagree(CalibrationError):
    """Joints and poses of a session are not of that arm; `mistake` is the likely cause, `off_mm` the distance."""

    def __init__(self, mistake: JointMistake, off_mm: float) -> None:
        self.mistake, self.off_mm = mistake, off_mm
        super().__init__(f"{mistake.what} (joints and poses differ by {off_mm:.4g} mm): {mistake.fix}")


def require_consistent_joints(
    arm: Arm, joints_rad: Array, base_T_flange: Array, others: Mapping[str, Arm] | None = None
) -> None:
    """Raises JointsDisagree where joints (n, 6) do not give the poses (n, 4, 4).

    `others`: arms by name that it may be instead.
    """
    off_mm = _off_mm(arm, joints_rad, base_T_flange)
    if off_mm <= MAX_OFF_MM:
        return
    if mistake := _of_another_view(arm, joints_rad, base_T_flange):
        raise JointsDisagree(mistake, off_mm)
    rows = np.linspace(0, len(joints_rad) - 1, min(len(joints_rad), MAX_TRIED_VIEWS)).astype(int)
    raise JointsDisagree(_likely_mistake(arm, joints_rad[rows], base_T_flange[rows], others or {}), off_mm)


def require_joints_of_each_view(
    arm: Arm, joints_rad: Array, base_T_flange: Array, others: Mapping[str, Arm], views: Sequence[int]
) -> None:
    """As `require_consistent_joints`, and where the joints of any one of the `views`, by their indices, do not."""
    drawn = arm.forward(joints_rad)
    off_mm = _distances_mm(drawn, base_T_flange)
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
    off_mm = np.array([_distances_mm(np.broadcast_to(drawn[row], poses.shape), poses) for row in wrong])
    if off_mm.min(axis=1).max() > MAX_VIEW_OFF_MM:
        return None
    here, there = (pictures([views[row] for row in rows]) for rows in (wrong, off_mm.argmin(axis=1)))
    what = f"{here}: the joints are those of {there}"
    return JointMistake("joints-of-another-view", what, "give each view its own joints")


def _of_all_views(arm: Arm, joints: Array, poses: Array) -> JointMistake | None:
    """The mistake that most views have in common and that moves the flange by millimetres at most."""
    shift = _shift_rad(arm, joints, poses)
    if _distances_mm(arm.forward(joints + shift), poses).max() <= MAX_VIEW_OFF_MM:
        axes = np.flatnonzero(np.abs(shift) > MIN_SHIFT_RAD)
        sizes = " and ".join(f"{-size:.3f}°" for size in np.degrees(shift[axes]))
        what = f"the zeros of {_axes([int(axis) + 1 for axis in axes])} are shifted by {sizes}"
        return JointMistake("joints-with-shifted-zeros", what, "take joints and poses from one controller")
    degrees = np.degrees(joints)
    for decimals in range(3):
        if np.allclose(degrees, np.round(degrees, decimals), rtol=0, atol=1e-6):
            what = f"the joints are rounded to {10.0**-decimals:g}°"
            fix = "record them with three decimals, or leave them out and record the confdata"
            return JointMistake("joints-rounded", what, fix)
    return _in_another_frame(arm.forward(joints), poses, MAX_VIEW_OFF_MM)


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
    between = inverse(poses) @ others
    turned = LEVER_MM * vector_from_rotation(between[:, :3, :3])
    return np.concatenate([turned, between[:, :3, 3]], axis=1).ravel()


def any_arm_fits(arms: Iterable[Arm], joints_rad: Sequence[Array], base_T_flange: Array) -> bool:
    """Whether the joints, (6,) of each pose, give the poses (n, 4, 4) with one of the arms."""
    if any(len(joints) != 6 for joints in joints_rad):
        return False
    return any(_off_mm(arm, np.array(joints_rad), base_T_flange) <= MAX_OFF_MM for arm in arms)


def _likely_mistake(arm: Arm, joints: Array, poses: Array, others: Mapping[str, Arm]) -> JointMistake:
    for changed, mistake in _changes(joints):
        if _off_mm(arm, changed, poses) <= MAX_OFF_MM:
            return mistake
    for other in others.values():
        if _off_mm(other, joints, poses) <= MAX_OFF_MM:
            return JointMistake(
                "joints-of-another-arm", f"the session is of an {other.name}, not of an {arm.name}", "name that arm"
            )
    return _in_another_frame(arm.forward(joints), poses, MAX_OFF_MM) or JointMistake(
        "joints-contradict-poses",
        f"no usual mistake explains the joints as those of an {arm.name}",
        "check the arm's name, and that joints and pose of a picture are of the same moment",
    )


def _in_another_frame(drawn: Array, poses: Array, max_off_mm: float) -> JointMistake | None:
    """The mistake where poses as drawn and as reported have a constant between them."""
    before, behind = poses @ inverse(drawn), inverse(drawn) @ poses
    for constant, where in ((before, "in a work object"), (behind, "of a tool")):
        same = _distance_mm(constant, np.broadcast_to(constant[:1], constant.shape)) <= max_off_mm
        if same and len(poses) >= MIN_FRAME_VIEWS:
            return JointMistake(
                "poses-in-another-frame",
                f"the poses are {where}, not of the flange in the base",
                "record base_T_flange with tool0 and wobj0",
            )
    return None


def _of_another_view(arm: Arm, joints: Array, poses: Array) -> JointMistake | None:
    """The mistake where each picture has the joints of its neighbour."""
    if len(joints) < MIN_FRAME_VIEWS:
        return None
    for late, where in ((1, "before"), (-1, "behind")):
        moved = slice(late, None) if late > 0 else slice(None, late)
        rest = slice(None, -late) if late > 0 else slice(-late, None)
        if _off_mm(arm, joints[moved], poses[rest]) <= MAX_OFF_MM:
            return JointMistake(
                "joints-of-another-view",
                f"each picture has the joints of the one {where} it",
                "record joints and pose of a picture at the same moment",
            )
    return None


def _changes(joints: Array) -> Iterator[tuple[Array, JointMistake]]:
    """Joints (n, 6) as they would be without a mistake, and the mistake; simple mistakes first."""
    yield np.degrees(joints), JointMistake("joints-in-radians", "the joints are in radians", "give degrees")
    for turned in product((1.0, -1.0), repeat=6):
        axes = [axis + 1 for axis, sign in enumerate(turned) if sign < 0]
        if axes:
            what = f"the signs of {_axes(axes)} are those of another maker"
            yield joints * turned, JointMistake("joints-with-other-signs", what, "turn them to ABB's direction")
    for count in (1, 2):
        for axes_off in combinations(range(6), count):
            for shifts in product(_SHIFTS_DEG, repeat=count):
                changed = joints.copy()
                changed[:, axes_off] -= np.radians(shifts)
                sizes = " and ".join(f"{shift:.0f}°" for shift in shifts)
                what = f"the zeros of {_axes([axis + 1 for axis in axes_off])} are shifted by {sizes}"
                yield changed, JointMistake("joints-with-shifted-zeros", what, "subtract it from the joints")
    for order in permutations(range(6)):
        if order != tuple(range(6)):
            what = f"the joints are in another order ({', '.join(str(axis + 1) for axis in np.argsort(order))})"
            yield joints[:, order], JointMistake("joints-in-other-order", what, "give axes 1 to 6 in this order")
    for sign in (1.0, -1.0):
        coupled = joints.copy()
        coupled[:, 2] += sign * joints[:, 1]
        what = "axis 3 is measured from the horizontal, not from the lower arm"
        yield coupled, JointMistake("joints-with-other-signs", what, "add or subtract axis 2")
    yield from _other_makers(joints)


def _other_makers(joints: Array) -> Iterator[tuple[Array, JointMistake]]:
    """Other signs together with zeros of the upper and lower arm a quarter turn off, and axis 3 from the horizontal."""
    for turned in product((1.0, -1.0), repeat=6):
        for coupling, *quarters in product((0.0, 1.0, -1.0), repeat=3):
            changed = joints * turned
            changed[:, 2] += coupling * changed[:, 1]
            changed[:, 1:3] += np.radians(90.0) * np.array(quarters)
            axes = [axis + 1 for axis, sign in enumerate(turned) if sign < 0]
            parts = [f"the signs of {_axes(axes)}"] if axes else []
            parts += ["axis 3 from the horizontal"] if coupling else []
            shifted = [axis for axis, quarter in zip((2, 3), quarters, strict=True) if quarter]
            parts += [f"the zeros of {_axes(shifted)} a quarter turn off"] if shifted else []
            what = f"the joints are counted as another maker does: {', '.join(parts)}"
            yield changed, JointMistake("joints-of-another-maker", what, "convert them to ABB's")


def _axes(axes: list[int]) -> str:
    return f"axis {axes[0]}" if len(axes) == 1 else f"axes {', '.join(map(str, axes))}"


def _off_mm(arm: Arm, joints: Array, poses: Array) -> float:
    return _distance_mm(arm.forward(joints), poses)


def _distance_mm(poses: Array, others: Array) -> float:
    """Median over the views of `_distances_mm`."""
    return float(np.median(_distances_mm(poses, others)))


def _distances_mm(poses: Array, others: Array) -> Array:
    """Distances (n,) of two poses (n, 4, 4)."""
    apart = np.linalg.norm(poses[:, :3, 3] - others[:, :3, 3], axis=-1)
    turned = rotation_angle_rad(np.swapaxes(poses[:, :3, :3], 1, 2) @ others[:, :3, :3])
    return np.asarray(np.maximum(apart, LEVER_MM * turned))
