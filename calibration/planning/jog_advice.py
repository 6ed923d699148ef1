"""What somebody who jogs the arm by hand should do next: one turn or two of the flange, and a shift.

A planner's best pose is hard to reach with a joystick. Among poses that are a turn or two about the flange's own axes
away, with the target brought back to the middle of the picture, the one that tells most is nearly as good.
"""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import (
    Scene,
    covariance_of,
    median_distance_mm,
    point_weights,
    prediction_of,
    view_information,
    working_points_mm,
)
from calibration.observability import summarise_motion
from calibration.planning.next_view import Wish
from calibration.planning.scene_belief import Belief, Guess, learnt
from calibration.planning.viewpoint_selection import Reachable
from calibration.planning.viewpoints import Limits, allowed
from calibration.problem import Problem
from calibration.transforms import Array, map_points, rotation_from_vector, transform

Turn = tuple[str, float]
"""About which of the flange's axes, and by how many degrees."""

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ANGLES_DEG = (15.0, 30.0, 45.0, 60.0)
ANGLES_OF_TWO_DEG = (20.0, 40.0, 60.0)

SINGLE_IS_AS_GOOD = 1.15
"""Two turns must leave this much less than one to be worth jogging."""

FIRST_TURN = ("z", 30.0)
"""Before anything is known: most cameras look along z, and a turn about it keeps the target in the picture."""

BLIND_DEG = 30.0
LEAST_DEG = 20.0
"""Turns about an axis by less than this count as not made."""

ENOUGH = "that is enough: finish the run; or go on: "


@dataclass(frozen=True, eq=False)
class Advice:
    """`words` for the operator. `base_T_flange` (4, 4): where that leads, None when only the turn is known.

    `now_mm`, `planned_mm`: what the views so far tell of a mapped point, and what they and that view will; None before
    they determine X.
    """

    words: str
    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None


def advise(
    guess: Guess, problem: Problem, limits: Limits, wish: Wish, *, here: Array, reachable: Reachable | None = None
) -> Advice:
    """The next view for an operator whose flange stands at `here` (4, 4). Eye-in-hand."""
    try:
        belief = learnt(guess, problem)
    except UndeterminedError:
        return _blind(problem)
    now_mm = float(belief.predicted_mm) if np.isfinite(belief.predicted_mm) else None
    enough = ENOUGH if now_mm is not None and _enough(belief, wish) else ""
    taken = np.array([view.base_T_flange for view in problem.views if view.detection is not None])
    found = _best(belief.scene, guess.prior(), limits, taken, here, reachable)
    if found is None:
        axes = " and ".join(_least_turned(taken))
        words = f"turn the flange by {LEAST_DEG:g} deg or more about its {axes}, with the whole target in the picture"
        return Advice(enough + words, None, now_mm, None)
    turns, pose, planned_mm = found
    return Advice(enough + _in_words(turns, pose[:3, 3] - here[:3, 3]), pose, now_mm, planned_mm)


def _enough(belief: Belief, wish: Wish) -> bool:
    known_mm = max(belief.reached_mm, belief.predicted_mm)
    return wish.views_left <= 0 if wish.uncertainty_mm is None else known_mm <= wish.uncertainty_mm


def _best(
    scene: Scene, prior: Array, limits: Limits, taken: Array, here: Array, reachable: Reachable | None
) -> tuple[tuple[Turn, ...], Array, float | None] | None:
    """The turns to make, where they lead, and what is known then; None when the limits allow none."""
    choices = tuple(_choices())
    poses = np.array([_turned(scene, limits, here, turns) for turns in choices])
    keep = allowed(scene, limits, poses) & (_tilts_rad(scene, poses) <= limits.tilt_rad)
    if reachable is not None:
        keep[keep] = reachable(poses[keep])
    if not keep.any():
        return None
    known = view_information(scene, taken).sum(axis=0)
    information = known + view_information(scene, poses[keep])
    distance_mm = median_distance_mm(scene, taken)
    weights = point_weights(working_points_mm(scene.camera, distance_mm))
    doubtful = information.copy()
    doubtful[:, :6, :6] += np.linalg.inv(prior)  # two views determine nothing, yet some tell more than others
    left = np.sqrt(np.einsum("ij,nji->n", weights, covariance_of(doubtful)))
    single = np.array([len(choices[row]) == 1 for row in np.flatnonzero(keep)])
    best = int(np.argmin(np.where(single, left, SINGLE_IS_AS_GOOD * left)))
    row = int(np.flatnonzero(keep)[best])
    planned_mm = prediction_of(scene, information[best], distance_mm).point_mm
    return choices[row], poses[row], float(planned_mm) if np.isfinite(planned_mm) else None


def _choices() -> "list[tuple[Turn, ...]]":
    signs = (1.0, -1.0)
    single: list[tuple[Turn, ...]] = [((axis, sign * angle),) for axis, angle, sign in product(AXES, ANGLES_DEG, signs)]
    double: list[tuple[Turn, ...]] = [
        ((first, one * angle), (second, other * further))
        for first, second in combinations(AXES, 2)
        for angle, further, one, other in product(ANGLES_OF_TWO_DEG, ANGLES_OF_TWO_DEG, signs, signs)
    ]
    return single + double


def _turned(scene: Scene, limits: Limits, here: Array, turns: tuple[Turn, ...]) -> Array:
    """The flange (4, 4) turned about its own axes, one after the other, the target then in the picture's middle."""
    rotation = here[:3, :3]
    for axis, angle_deg in turns:
        rotation = rotation @ rotation_from_vector(np.radians(angle_deg) * np.array(AXES[axis]))
    distance_mm = float(np.clip(median_distance_mm(scene, here[None]), *limits.distance_mm))
    centre = map_points(scene.anchor_T_target, scene.target.points_mm.mean(axis=0, keepdims=True))[0]
    camera_R = rotation @ scene.mount_T_camera[:3, :3]
    camera_at = centre - distance_mm * camera_R[:, 2]
    return transform(rotation, camera_at - rotation @ scene.mount_T_camera[:3, 3])


def _tilts_rad(scene: Scene, poses: Array) -> Array:
    """Between the board's normal and the ray to the camera (n,), for targets in the picture's middle."""
    normals = scene.camera_T_target(poses)[:, :3, 2]
    tilts: Array = np.arccos(np.clip(np.abs(normals[:, 2]), 0.0, 1.0))
    return tilts


def _blind(problem: Problem) -> Advice:
    """Nothing is known of where the camera sits: turns about different axes will tell."""
    taken = np.array([view.base_T_flange for view in problem.views if view.detection is not None])
    axis, angle_deg = FIRST_TURN if len(taken) < 2 else (_least_turned(taken)[0], BLIND_DEG)
    words = (
        f"turn the flange by about {angle_deg:g} deg about its {axis}, and bring the whole target back into the picture"
    )
    return Advice(words, None, None, None)


def _least_turned(taken: Array) -> list[str]:
    """The flange's axes, the one about which the views differ least first."""
    motion = summarise_motion(taken)
    along = np.abs(motion.main_axis)
    return [tuple(AXES)[index] for index in np.argsort(along, kind="stable")]


def _in_words(turns: tuple[Turn, ...], shift_mm: Array) -> str:
    turned = ", then ".join(f"{angle:+g} deg about its {axis}" for axis, angle in turns)
    shift = ", ".join(f"{value:+.0f}" for value in shift_mm)
    return f"turn the flange by {turned}, and move it by ({shift}) mm in the base: the target is in the middle then"
