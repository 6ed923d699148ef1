"""Predicted uncertainty of X for given poses, before any view is taken.

The maximum-likelihood estimate has the covariance of the Cramér-Rao bound, the inverse of the information

    F = sum_i A_i' V_i^-1 A_i + P        V_i = s_px² I + U_i D U_i'        A by (X, target's pose, nuisances)

where U_i D U_i' is the robot's error in view i: the same sums as in the estimator, at the planned poses. P holds what
is known of lens and target beforehand, without its tails. Sources:
Strobl & Hirzinger, IROS 2006 (the model); Nahvi & Hollerbach, ICRA 1996 (the choice of poses by it).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibration.camera import BROWN, CameraModel
from calibration.closed_forms.observability import describe_axis, summarise_motion
from calibration.knowledge import NOTHING_STATED, Knowledge
from calibration.likelihood.chain import Chain
from calibration.likelihood.mapped_points import named_points_uncertainty, point_rows, working_volume_uncertainty
from calibration.likelihood.mixed_model import Variances, linearise_model, per_view_equations, solve
from calibration.likelihood.nuisances import Nuisances
from calibration.linear_algebra import covariance_or_inf
from calibration.observations.observations import Observations
from calibration.observations.pose_model import predicted_camera_T_target
from calibration.problem import Setup, anchor_T_mount_of
from calibration.solution import NamedPoint, Observability, Uncertainty
from calibration.targets import Target
from calibration.transforms import Array, map_points


@dataclass(frozen=True)
class ExpectedNoise:
    """One standard deviation per axis: pixels, robot rotation, robot translation."""

    image_px: float
    robot_rotation_rad: float
    robot_translation_mm: float

    def variances(self) -> Variances:
        """px², rad², mm²"""
        return Variances(self.image_px**2, self.robot_rotation_rad**2, self.robot_translation_mm**2)


@dataclass(frozen=True, eq=False)
class Scene:
    """The scene that is planned for: known or guessed. Frames as in `calibration.problem`.

    `points`: where the uncertainty counts; the working volume without any. `knowledge`: of target, camera and arm.
    `described`: the camera as it was described, where `camera` is one that was found.
    """

    setup: Setup
    target: Target
    camera: CameraModel
    mount_T_camera: Array
    anchor_T_target: Array
    noise: ExpectedNoise
    intrinsics_free: bool = False
    points: tuple[NamedPoint, ...] = ()
    knowledge: Knowledge = NOTHING_STATED
    described: CameraModel | None = None

    @cached_property
    def nuisances(self) -> Nuisances:
        """What is unknown of lens and target."""
        camera, free = self.described or self.camera, self.intrinsics_free
        of_description = Nuisances.of(camera, self.target.points_mm, self.knowledge, estimated=free)
        return replace(of_description, camera=self.camera)

    @property
    def unknowns(self) -> int:
        """Number of unknowns: X, the target's pose, and the nuisances."""
        return 12 + len(self.nuisances)

    def prior_information(self) -> Array:
        """Information (k, k) on all unknowns before any view."""
        known = np.zeros(self.unknowns)
        known[12 + self.nuisances.first_known :] = self.nuisances.prior.usual
        return np.diag(known)

    def camera_T_target(self, base_T_flange: Array) -> Array:
        """(n, 4, 4) from robot poses (n, 4, 4)."""
        anchor_T_mount = anchor_T_mount_of(self.setup, base_T_flange)
        return predicted_camera_T_target(anchor_T_mount, self.mount_T_camera, self.anchor_T_target)


def predict(scene: Scene, base_T_flange: Array) -> Uncertainty:
    """The predicted uncertainty of X from views at the poses (n, 4, 4); infinite where they do not determine it."""
    information = scene.prior_information() + view_information(scene, base_T_flange).sum(axis=0)
    predicted = prediction_of(scene, information, median_distance_mm(scene, base_T_flange))
    if not scene.points:
        return predicted
    poses, x = anchor_T_mount_of(scene.setup, base_T_flange), scene.mount_T_camera
    at = named_points_uncertainty(predicted.covariance, scene.points, scene.setup, x, poses, scene.camera)
    return replace(predicted, points=at)


def prediction_of(scene: Scene, information: Array, distance_mm: float) -> Uncertainty:
    """The prediction of a summed information matrix (k, k)."""
    points_mm = working_points_mm(scene.camera, distance_mm)
    return uncertainty_of(covariance_or_inf(information, 6), scene.mount_T_camera, points_mm)


def uncertainty_of(covariance: Array, mount_T_camera: Array, points_mm: Array) -> Uncertainty:
    """From the covariance (6, 6) of [rotation rad, translation mm] of mount_T_camera @ exp(.); it may be infinite.

    `points_mm` (n, 3) in the camera frame: where `point_mm` and `points` are taken.
    """
    mount_R_camera = mount_T_camera[:3, :3]
    by_camera = covariance[3:, 3:]
    by_mount = mount_R_camera @ by_camera @ mount_R_camera.T if np.all(np.isfinite(by_camera)) else by_camera
    return Uncertainty(
        translation_mm=np.sqrt(np.diagonal(by_mount)),
        rotation_rad=np.sqrt(np.diagonal(covariance)[:3]),
        point_mm=float(np.sqrt(np.sum(point_weights(points_mm) * covariance))),
        covariance=covariance,
        points=working_volume_uncertainty(covariance, points_mm),
    )


def observability_of(setup: Setup, base_T_flange: Array, mount_T_camera: Array, covariance: Array) -> Observability:
    """How well the robot's poses (n, 4, 4) determine X, and where it is weakest by its covariance (6, 6)."""
    motion = summarise_motion(base_T_flange)
    direction = mount_T_camera[:3, :3] @ np.linalg.eigh(covariance[3:, 3:])[1][:, -1]
    if setup == "eye-to-hand":
        direction = anchor_T_mount_of(setup, base_T_flange[0])[:3, :3] @ direction
    words = describe_axis(direction, base_T_flange)
    return Observability(len(base_T_flange), motion.max_rotation_rad, motion.axis_spread, f"translation along {words}")


def view_information(scene: Scene, base_T_flange: Array) -> Array:
    """Information (n, k, k) that each view carries on (X, target's pose, nuisances)."""
    if not len(base_T_flange):
        return np.zeros((0, scene.unknowns, scene.unknowns))
    nothing_corrected = np.zeros((len(base_T_flange), 6))
    chain = Chain(scene.setup, base_T_flange, scene.mount_T_camera, scene.anchor_T_target, nothing_corrected)
    camera_T_target = chain.camera_T_target()
    as_described = np.zeros(len(scene.nuisances))
    statistics = scene.nuisances.statistics(observe_whole_target(scene, base_T_flange), camera_T_target, as_described)
    model, variances = linearise_model(statistics, chain, camera_T_target), scene.noise.variances()
    return per_view_equations(model, variances, solve(model, variances))[0]


def observe_whole_target(scene: Scene, base_T_flange: Array) -> Observations:
    """Observations of every point of the target in every view; the pixels are not used and set to 0."""
    n, m = len(base_T_flange), len(scene.target.points_mm)
    points = np.broadcast_to(scene.target.points_mm, (n, m, 3))
    ids = np.broadcast_to(np.arange(m), (n, m))
    ones = np.ones((n, m))
    return Observations(
        np.arange(n), base_T_flange, ids, points, np.zeros((n, m, 2)), ones, ones, np.zeros((n, m, 3, 0))
    )


def median_distance_mm(scene: Scene, base_T_flange: Array) -> float:
    """Median distance from the camera to the middle of the target."""
    centre = scene.target.points_mm.mean(axis=0, keepdims=True)
    return float(np.median(np.linalg.norm(map_points(scene.camera_T_target(base_T_flange), centre), axis=-1)))


def working_points_mm(camera: CameraModel, distance_mm: float) -> Array:
    """The 27 points (27, 3) in the camera frame at which `point_mm` is taken.

    3×3 over the central 80 % of the image, at 0.9, 1.0 and 1.1 times the distance (along the optical axis). An
    estimated lens may have no inverse where no target was seen; the direction is then that without distortion.
    """
    width, height = camera.image_size
    u, v = np.meshgrid(np.array([0.1, 0.5, 0.9]) * (width - 1), np.array([0.1, 0.5, 0.9]) * (height - 1))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    found = camera.normalise(pixels)
    if not np.all(np.isfinite(found)):
        found = np.where(
            np.isfinite(found), found, CameraModel(camera.matrix, np.zeros(BROWN), (width, height)).normalise(pixels)
        )
    rays = np.column_stack([found, np.ones(9)])
    points: Array = (np.array([0.9, 1.0, 1.1])[:, None, None] * distance_mm * rays).reshape(-1, 3)
    return points


def point_weights(points_mm: Array) -> Array:
    """W (6, 6) with trace(W cov) = the mean variance of points (n, 3) mapped through X (covariance [rad, mm])."""
    by_x = point_rows(points_mm)
    weights: Array = np.mean(np.swapaxes(by_x, -1, -2) @ by_x, axis=0)
    return weights
