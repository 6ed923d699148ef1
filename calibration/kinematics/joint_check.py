"""Whether joints and poses of a session are of the same arm, and what is likely wrong where they are not.

The controller computes poses from joints with the drawing's kinematics, so that both agree to the rounding. Where they
do not, the changes that people and programs make are tried one by one: unit, order, signs, zeros, another arm, poses of
a tool or in a work object. Nothing of that is an error of the arm, and none of it must be fitted as one.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from calibration.errors import CalibrationError
from calibration.kinematics.arm import Arm
from calibration.transforms import Array, inverse, rotation_angle_rad

MAX_OFF_MM = 3.0
"""Largest median distance of joints' and reported poses: a controller with its own corrections differs by less."""

LEVER_MM = 500.0
"""A difference of rotation counts as that of a point so far from the flange."""

MAX_TRIED_VIEWS = 12
MIN_FRAME_VIEWS = 3
"""Any single view has some constant transform between its pose and its joints: fewer show no other frame."""
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
    return in_another_frame(arm.forward(joints), poses, MAX_OFF_MM) or JointMistake(
        "joints-contradict-poses",
        f"no usual mistake explains the joints as those of an {arm.name}",
        "check the arm's name, and that joints and pose of a picture are of the same moment",
    )


def in_another_frame(drawn: Array, poses: Array, max_off_mm: float) -> JointMistake | None:
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
            what = f"the signs of {axes_in_words(axes)} are those of another maker"
            yield joints * turned, JointMistake("joints-with-other-signs", what, "turn them to ABB's direction")
    for count in (1, 2):
        for axes_off in combinations(range(6), count):
            for shifts in product(_SHIFTS_DEG, repeat=count):
                changed = joints.copy()
                changed[:, axes_off] -= np.radians(shifts)
                sizes = " and ".join(f"{shift:.0f}°" for shift in shifts)
                what = f"the zeros of {axes_in_words([axis + 1 for axis in axes_off])} are shifted by {sizes}"
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
            parts = [f"the signs of {axes_in_words(axes)}"] if axes else []
            parts += ["axis 3 from the horizontal"] if coupling else []
            shifted = [axis for axis, quarter in zip((2, 3), quarters, strict=True) if quarter]
            parts += [f"the zeros of {axes_in_words(shifted)} a quarter turn off"] if shifted else []
            what = f"the joints are counted as another maker does: {', '.join(parts)}"
            yield changed, JointMistake("joints-of-another-maker", what, "convert them to ABB's")


def axes_in_words(axes: list[int]) -> str:
    """Such as "axis 2" or "axes 2, 3"."""
    return f"axis {axes[0]}" if len(axes) == 1 else f"axes {', '.join(map(str, axes))}"


def _off_mm(arm: Arm, joints: Array, poses: Array) -> float:
    return _distance_mm(arm.forward(joints), poses)


def _distance_mm(poses: Array, others: Array) -> float:
    """Median over the views of `distances_mm`."""
    return float(np.median(distances_mm(poses, others)))


def distances_mm(poses: Array, others: Array) -> Array:
    """Distances (n,) of two poses (n, 4, 4)."""
    apart = np.linalg.norm(poses[:, :3, 3] - others[:, :3, 3], axis=-1)
    turned = rotation_angle_rad(np.swapaxes(poses[:, :3, :3], 1, 2) @ others[:, :3, :3])
    return np.asarray(np.maximum(apart, LEVER_MM * turned))
