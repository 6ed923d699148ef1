"""Instructions for an operator who jogs the arm: one or two turns of the flange about its axes, and a shift.

A planner's best pose is hard to reach with a joystick. The most informative pose among those that are one or two such
turns away, with the target moved back to the middle of the image, near, far, or as far as now, is nearly as good.
"""

from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np

from calibration.closed_forms.observability import summarise_motion
from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import Scene, median_distance_mm, predict, view_information
from calibration.linear_algebra import covariance_or_inf
from calibration.planning.next_view import StoppingRule
from calibration.planning.point_criterion import point_matrices, worst_variances
from calibration.planning.scene_belief import ScenePrior, infer_scene
from calibration.planning.viewpoint_selection import Reachable
from calibration.planning.viewpoints import ViewpointLimits, within_limits
from calibration.problem import Problem
from calibration.targets import outline_mm
from calibration.transforms import Array, map_points, rotation_from_vector, transform

Axis = Literal["x", "y", "z"]

Turn = tuple[Axis, float]
"""Axis of the flange, and angle in degrees."""

AXES: dict[Axis, tuple[float, float, float]] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ANGLES_DEG = (15.0, 30.0, 45.0, 60.0)
ANGLES_OF_TWO_DEG = (20.0, 40.0, 60.0)

MIN_GAIN_OF_TWO_TURNS = 1.15
"""Two turns are advised only when they divide the uncertainty that one leaves by more than this."""

FIRST_TURN: Turn = ("z", 30.0)
"""The first turn without an X: most cameras look along z, and a turn about z keeps the target in the image."""

EXPLORING_TURN_DEG = 30.0
MIN_TURN_DEG = 20.0
"""Least turn advised when the limits allow none of the poses searched."""

ACROSS_MM = 100.0
"""Travel across the only axis of rotation, from view to view."""

GOAL_REACHED = "that is enough: finish the run; or go on: "


@dataclass(frozen=True, eq=False)
class Advice:
    """The next view for the operator.

    instruction : a sentence.
    base_T_flange : (4, 4) the pose it leads to, None when only the turn is determined.
    now_mm, planned_mm : U (k = 2) at the worst of the points that matter from the views so far, and with that view;
        None before X is determined.
    turns : what to turn the flange by, one after the other.
    shift_mm : (3,) what to move it by in the base then; None when only the turn is determined.
    outline_px : (4, 2) where the outline of the target's points is in the picture then; None likewise.
    """

    instruction: str
    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None
    turns: tuple[Turn, ...] = ()
    shift_mm: Array | None = None
    outline_px: Array | None = None


def advise(
    prior: ScenePrior,
    problem: Problem,
    limits: ViewpointLimits,
    stop: StoppingRule,
    *,
    base_T_flange_now: Array,
    reachable: Reachable | None = None,
) -> Advice:
    """The next view to take, from the flange's pose `base_T_flange_now` (4, 4). Eye-in-hand only."""
    if problem.axis_offset is not None:
        return _advise_about_one_axis(problem)
    try:
        belief = infer_scene(prior, problem)
    except UndeterminedError:
        return _advise_without_x(problem)
    now_mm = belief.now_mm
    goal = stop.uncertainty_mm is not None or stop.tolerance_mm is not None
    met = now_mm is not None and (stop.met_by(belief) if goal else stop.views_left <= 0)
    enough = GOAL_REACHED if met else ""
    taken = np.array([view.base_T_flange for view in problem.views if view.detection is not None])
    found = _best_jog(belief.scene, prior.covariance(), limits, taken, base_T_flange_now, reachable)
    if found is None:
        axes = " and ".join(_axes_by_variation(taken))
        words = (
            f"turn the flange by {MIN_TURN_DEG:g} deg or more about its {axes}, with the whole target in the picture"
        )
        return Advice(enough + words, None, now_mm, None)
    turns, pose, planned_mm = found
    shift_mm = pose[:3, 3] - base_T_flange_now[:3, 3]
    outline = map_points(belief.scene.camera_T_target(pose[None])[0], outline_mm(problem.target.points_mm))
    outline_px = belief.scene.camera.project(outline)
    turned = ", then ".join(f"{angle:+g} deg about its {axis}" for axis, angle in turns)
    shift = ", ".join(f"{value:+.0f}" for value in shift_mm)
    words = f"turn the flange by {turned}, and move it by ({shift}) mm in the base: the target is in the middle then"
    return Advice(enough + words, pose, now_mm, planned_mm, turns, shift_mm, outline_px)


def _best_jog(
    scene: Scene,
    prior_covariance: Array,
    limits: ViewpointLimits,
    taken: Array,
    base_T_flange_now: Array,
    reachable: Reachable | None,
) -> tuple[tuple[Turn, ...], Array, float | None] | None:
    """The best turns, the pose (4, 4) they lead to, and its predicted mm; None when the limits allow none."""
    here_mm = float(np.clip(median_distance_mm(scene, base_T_flange_now[None]), *limits.distance_mm))
    choices = tuple(product(_turn_choices(), (here_mm, *limits.distance_mm)))
    poses = np.array([_turn_and_centre(scene, base_T_flange_now, turns, far_mm) for turns, far_mm in choices])
    # Between the board's normal and the ray to the camera, which is the optical axis for a target in the middle.
    tilts_rad = np.arccos(np.clip(np.abs(scene.camera_T_target(poses)[:, 2, 2]), 0.0, 1.0))
    keep = within_limits(scene, limits, poses) & (tilts_rad <= limits.tilt_rad)
    if reachable is not None:
        keep[keep] = reachable(poses[keep])
    if not keep.any():
        return None
    known = scene.prior_information() + view_information(scene, taken).sum(axis=0)
    information = known + view_information(scene, poses[keep])
    distance_mm = median_distance_mm(scene, taken)
    regularised = information.copy()
    regularised[:, :6, :6] += np.linalg.inv(prior_covariance)  # two views do not determine X
    matrices = point_matrices(scene, distance_mm, taken)
    sigma_mm = np.sqrt(worst_variances(matrices, covariance_or_inf(regularised, 6)))
    single = np.array([len(choices[row][0]) == 1 for row in np.flatnonzero(keep)])
    best = int(np.argmin(np.where(single, sigma_mm, MIN_GAIN_OF_TWO_TURNS * sigma_mm)))
    row = int(np.flatnonzero(keep)[best])
    return choices[row][0], poses[row], predict(scene, np.array([*taken, poses[row]])).expanded_mm


def _turn_choices() -> "list[tuple[Turn, ...]]":
    signs = (1.0, -1.0)
    single: list[tuple[Turn, ...]] = [((axis, sign * angle),) for axis, angle, sign in product(AXES, ANGLES_DEG, signs)]
    double: list[tuple[Turn, ...]] = [
        ((first, one * angle), (second, other * further))
        for first, second in combinations(AXES, 2)
        for angle, further, one, other in product(ANGLES_OF_TWO_DEG, ANGLES_OF_TWO_DEG, signs, signs)
    ]
    return single + double


def _turn_and_centre(scene: Scene, base_T_flange_now: Array, turns: tuple[Turn, ...], distance_mm: float) -> Array:
    """The flange's pose (4, 4) after `turns` about its own axes, shifted to have the target in the image's middle."""
    rotation = base_T_flange_now[:3, :3]
    for axis, angle_deg in turns:
        rotation = rotation @ rotation_from_vector(np.radians(angle_deg) * np.array(AXES[axis]))
    centre = map_points(scene.anchor_T_target, scene.target.points_mm.mean(axis=0, keepdims=True))[0]
    camera_R = rotation @ scene.mount_T_camera[:3, :3]
    camera_at = centre - distance_mm * camera_R[:, 2]
    return transform(rotation, camera_at - rotation @ scene.mount_T_camera[:3, 3])


def _advise_without_x(problem: Problem) -> Advice:
    """Advice before X is known: turns about different axes, which determine it."""
    taken = np.array([view.base_T_flange for view in problem.views if view.detection is not None])
    axis, angle_deg = FIRST_TURN if len(taken) < 2 else (_axes_by_variation(taken)[0], EXPLORING_TURN_DEG)
    words = (
        f"turn the flange by about {angle_deg:g} deg about its {axis}, and bring the whole target back into the picture"
    )
    return Advice(words, None, None, None, ((axis, angle_deg),))


def _advise_about_one_axis(problem: Problem) -> Advice:
    """Advice for an arm that turns its flange about the flange's z only."""
    # Half of the package; the first views are taken without it.
    from calibration.solve import solve_hand_eye

    found = solve_hand_eye(problem).uncertainty if len(problem.views) > 2 else None
    words = (
        f"turn the flange by {EXPLORING_TURN_DEG:g} deg or more about its z, and move it by {ACROSS_MM:g} mm or more"
        " across that axis, every second time also along it, with the whole target in the picture"
    )
    turn: Turn = ("z", EXPLORING_TURN_DEG)
    return Advice(words, None, None if found is None else found.point_mm, None, (turn,))


def _axes_by_variation(taken: Array) -> list[Axis]:
    """The flange's axes, in ascending order of the rotation between views about them."""
    motion = summarise_motion(taken)
    along = np.abs(motion.main_axis)
    return [tuple(AXES)[index] for index in np.argsort(along, kind="stable")]
