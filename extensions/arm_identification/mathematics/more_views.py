"""What more views of the target, where it stood, would leave of the error of a registered point in a box.

The views taken leave a covariance of X, the target's places and the arm's errors; each further view adds its
information to it. The views are those that lower the mean variance of registered points most, among random ones that
the arm reaches and in which the whole target is in the image.
"""

from dataclasses import dataclass

import numpy as np

from calibration.documents.more_arm_views import BOX_STEPS
from calibration.kinematics.arm_box import box_around, grid_in, joints_at_places, joints_within_reach, middle_of
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.planning.scene_belief import MIN_IMAGE_NOISE_PX
from calibration.planning.viewpoints import ViewpointLimits, flange_poses, random_viewpoints, within_limits
from calibration.planning.what_if import DEFAULT_TILT_RAD, MAX_DISTANCE_FACTOR, MIN_DISTANCE_FACTOR
from calibration.targets import Target
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.identification import ArmFit
from extensions.arm_identification.mathematics.views import ArmExperiment, PointsOfInterest

MORE_VIEWS = (10, 20, 30)
"""Numbers of further views that are reported."""

CANDIDATES = 150
"""Random views of each place; those that are not within reach or sight are left out."""


@dataclass(frozen=True, eq=False)
class MoreArmViews:
    """Further views in the order of their gain, and the RMS error of registered points.

    box_mm : (2, 3) least and largest corner of the registered points in the base.
    interest : those of them that are within reach.
    now_mm, after_mm : (n,) after each of the views.
    joints_rad : (n, 6); places : (n,) position of the place in `ArmFit.anchor_T_target`.
    """

    box_mm: Array
    interest: PointsOfInterest
    now_mm: float
    after_mm: Array
    joints_rad: Array
    places: Array


def plan_more_arm_views(
    fit: ArmFit, target: Target, box_mm: Array | None = None, count: int = MORE_VIEWS[-1], seed: int = 1
) -> MoreArmViews | None:
    """The `count` further views that lower the error of points in the box (2, 3) of the base most.

    Without a box, points around those that the views taken would register.

    Fewer where fewer are possible. A registered point is at the session's distance before the camera, the flange
    turned as in its middle view. None where the fit took no errors up, for a camera that is not on the flange, and for
    a box out of reach.
    """
    if not fit.taken_up or fit.seen.setup != "eye-in-hand":
        return None
    arm, joints = fit.model.arm, fit.seen.postures.joints_rad
    range_rad = (joints.min(axis=0), joints.max(axis=0))
    point = np.array([0.0, 0.0, float(np.median(fit.seen.camera_T_target[:, 2, 3]))])
    middle = middle_of(joints)
    flange_to_point = arm.forward(middle)[:3, :3] @ map_points(fit.mount_T_camera, point[None])[0]
    box_mm = box_around(arm, joints) + flange_to_point if box_mm is None else box_mm
    at = joints_at_places(arm, middle, grid_in(box_mm, BOX_STEPS) - flange_to_point, range_rad)
    levels, seen = fit.variances, fit.seen
    centre = target.points_mm.mean(axis=0, keepdims=True)
    distances = np.linalg.norm(map_points(seen.camera_T_target, centre), axis=-1)
    nearest, furthest = float(MIN_DISTANCE_FACTOR * distances.min()), float(MAX_DISTANCE_FACTOR * distances.max())
    limits = ViewpointLimits(DEFAULT_TILT_RAD, np.pi, (nearest, furthest))
    pixel, rotation, translation = np.sqrt([levels.pixel, levels.rotation, levels.translation]).tolist()
    noise = ExpectedNoise(max(pixel, MIN_IMAGE_NOISE_PX), rotation, translation)
    scenes = [
        Scene("eye-in-hand", target, seen.camera, fit.mount_T_camera, place, noise, seen.intrinsics_free)
        for place in fit.anchor_T_target
    ]
    rng = np.random.default_rng(seed)
    postures = []
    for scene in scenes:
        poses = flange_poses(scene, random_viewpoints(limits, CANDIDATES, rng))
        poses = poses[within_limits(scene, limits, poses)]
        postures.append(fit.postures(joints_within_reach(arm, poses, range_rad)))
    if not len(at) or not all(len(each) for each in postures):
        return None
    interest = PointsOfInterest(fit.postures(at), np.tile(point, (len(at), 1)))
    experiment = ArmExperiment(fit.model, scenes, postures, interest, fit.model.sigmas, fit.covariance_with_all)
    views, after_mm = experiment.choose(count)
    joints_rad = np.array([postures[place].joints_rad[row] for place, row in views])
    places = np.array([place for place, _ in views])
    return MoreArmViews(box_mm, interest, experiment.point_mm([]), after_mm, joints_rad, places)
