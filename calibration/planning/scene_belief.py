"""Estimate of the scene for planning: a prior before the first view, updated by every view.

With one view the target's pose follows from the prior of X; with two, X is fitted so that both agree on the target;
from three views that determine it, X is the estimator's. Alternative scenes cover the uncertainty.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
import scipy

from calibration.camera import CameraModel
from calibration.closed_forms.kronecker import kronecker
from calibration.closed_forms.observability import summarise_motion
from calibration.errors import DetectionError, UndeterminedError
from calibration.intrinsics.zhang_init import DEFAULT_FOCAL_OF_WIDTH
from calibration.kinematics.external_axis import ExternalAxis
from calibration.knowledge import NOTHING_STATED, Knowledge
from calibration.likelihood.mapped_points import with_points
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene, predict, view_information
from calibration.linear_algebra import covariance_or_inf
from calibration.observations.observations import observe
from calibration.observations.view_poses import target_pose
from calibration.problem import MOUNTS, Problem, Setup, View
from calibration.sentences.sentence import Sentence
from calibration.solution import NamedPoint, Solution
from calibration.targets import Target
from calibration.transforms import Array, inverse, map_points, transform_from_vector, vector_from_transform

PRIOR_SIGMA_RAD, PRIOR_SIGMA_MM = float(np.radians(5.0)), 25.0
"""Default standard deviation per axis of a prior: a guess good to about 50 mm and 10 degrees."""

UNINFORMED_SIGMA_RAD, UNINFORMED_SIGMA_MM = np.radians(20.0), 150.0
"""The same without any guess of X."""

MIN_EXPLORING_AXIS_ANGLE_RAD = np.radians(20.0)
"""Least angle between the axes of exploring turns, for which a closed form gives a first X."""

MIN_DISTANCE_RATIO, MIN_ROLL_RAD = 1.4, float(np.radians(30.0))
"""Views at distances and rolls that differ so much separate focal length, size and X."""

MIN_IMAGE_NOISE_PX = 0.01
SIGMA_FACTOR = 2.0
"""Standard deviations between the best scene and its alternatives."""

LEVER_ARM_MM = 600.0
"""Millimetres that a radian counts as when the principal axes of a pose's covariance are computed."""

MIN_SIGMA_RAD, MIN_SIGMA_MM = np.radians(0.1), 1.0
"""Floor of the standard deviations of a pose."""


@dataclass(frozen=True, eq=False)
class ScenePrior:
    """What is stated of the scene before the first view; None where nothing is. Frames as in `calibration.problem`.

    `rotation_rad`, `translation_mm`: one standard deviation per axis of the two poses (4, 4).
    `points`: where the uncertainty counts; the working volume without any. `knowledge`: of target, camera and arm.
    `lens_before`: of an earlier calibration, where planning begins; the views decide, as they do in the run's result.
    """

    setup: Setup
    target: Target
    camera: CameraModel | None
    mount_T_camera: Array | None
    anchor_T_target: Array | None
    noise: ExpectedNoise
    rotation_rad: float = PRIOR_SIGMA_RAD
    translation_mm: float = PRIOR_SIGMA_MM
    points: tuple[NamedPoint, ...] = ()
    knowledge: Knowledge = NOTHING_STATED
    lens_before: CameraModel | None = None

    def at_reading(self, axis: ExternalAxis, reading: float) -> "ScenePrior":
        """What is stated with the axis at its zero, in the base where it stands at this reading."""
        back = inverse(axis.motion(reading))
        if self.setup == "eye-in-hand":
            return replace(self, anchor_T_target=None if self.anchor_T_target is None else back @ self.anchor_T_target)
        return replace(self, mount_T_camera=None if self.mount_T_camera is None else back @ self.mount_T_camera)

    def covariance(self) -> Array:
        """Covariance (6, 6) of [rad, mm] of either pose."""
        return _diagonal_covariance(self.rotation_rad, self.translation_mm)


@dataclass(frozen=True, eq=False)
class SceneBelief:
    """The most likely scene, and alternatives within its uncertainty.

    estimated_mm : uncertainty of a measured point by a calibration from these views; infinite before X is determined.
    predicted_mm : the same, predicted from the noise of the scene.
    estimated_worst_mm, predicted_worst_mm : U (k = 2) at the worst of the points that matter.
    views : by which it is known. varied : whether these have two distances and three rolls.
    """

    scene: Scene
    alternatives: tuple[Scene, ...]
    estimated_mm: float
    predicted_mm: float
    estimated_worst_mm: float = inf
    predicted_worst_mm: float = inf
    views: int = 0
    varied: bool = False

    @property
    def now_mm(self) -> float | None:
        """U (k = 2) at the worst of the points that matter, that a goal is held against; None before there is an X."""
        now_mm = max(self.estimated_worst_mm, self.predicted_worst_mm)
        return now_mm if np.isfinite(now_mm) else None


def infer_scene(prior: ScenePrior, problem: Problem, *, caution: float = 1.0, diagnosed: bool = False) -> SceneBelief:
    """The scene from the prior and the views of `problem` so far. `caution`: factor on the spread of the alternatives.

    `diagnosed`: the uncertainty is widened by what a diagnosis finds, which takes twice the time.
    Raises UndeterminedError when prior and views together do not determine where camera and target are.
    """
    seen = [problem.views[position] for position in observe(problem)[0].positions]
    before = prior.lens_before if prior.lens_before and prior.lens_before.image_size == problem.image_size else None
    camera = prior.camera or before or default_camera(problem.image_size)
    if not seen:
        return _belief_of_prior(prior, camera, caution)
    if len(seen) >= 3:
        from calibration.solve import estimate_hand_eye, solve_hand_eye  # half of the package: not for the first views

        whole = diagnosed or problem.in_space
        solution = (solve_hand_eye if whole else estimate_hand_eye)(replace(problem, camera=prior.camera))
        if solution.mount_T_camera is not None and solution.uncertainty is not None:
            return _belief_of_solution(prior, problem, seen, solution, caution)
    return _rough_belief(prior, problem, seen, camera, caution)


def sigma_points(a_T_b: Array, covariance: Array) -> list[Array]:
    """Twelve poses (4, 4) at ± SIGMA_FACTOR along the principal axes of `covariance` (6, 6), [rad, mm] of exp(.)."""
    scale = np.repeat([LEVER_ARM_MM, 1.0], 3)
    floor = np.diag(np.repeat([MIN_SIGMA_RAD**2, MIN_SIGMA_MM**2], 3))
    values, axes = np.linalg.eigh((covariance + floor) * np.outer(scale, scale))
    steps = SIGMA_FACTOR * np.sqrt(values)[:, None] * axes.T / scale
    return [a_T_b @ transform_from_vector(step) for step in np.concatenate([steps, -steps])]


def default_camera(image_size: tuple[int, int] = (1600, 1200)) -> CameraModel:
    """A camera with a usual field of view, the principal point in the middle and no distortion."""
    width, height = image_size
    focal = DEFAULT_FOCAL_OF_WIDTH * width
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
    return CameraModel(matrix, np.zeros(5), image_size)


def _belief_of_prior(prior: ScenePrior, camera: CameraModel, caution: float) -> SceneBelief:
    if prior.mount_T_camera is None or prior.anchor_T_target is None:
        raise UndeterminedError("target-not-found", Sentence("target-nowhere"), Sentence("see-target-or-guess"))
    scene = _scene(prior, camera, prior.mount_T_camera, prior.anchor_T_target)
    covariance = caution**2 * prior.covariance()
    of_mount = [(x, prior.anchor_T_target) for x in sigma_points(prior.mount_T_camera, covariance)]
    of_target = [(prior.mount_T_camera, y) for y in sigma_points(prior.anchor_T_target, covariance)]
    others = tuple(_scene(prior, camera, x, y) for x, y in of_mount + of_target)
    return SceneBelief(scene, others, np.inf, np.inf)


def _belief_of_solution(
    prior: ScenePrior, problem: Problem, seen: list[View], solution: Solution, caution: float
) -> SceneBelief:
    solution = with_points(solution, prior.points, np.array([problem.anchor_T_mount(view) for view in seen]))
    assert solution.mount_T_camera is not None
    assert solution.anchor_T_target is not None
    assert solution.camera is not None
    assert solution.uncertainty is not None
    scene = replace(
        _scene(prior, solution.camera, solution.mount_T_camera, solution.anchor_T_target),
        noise=expected_noise(solution) or prior.noise,
    )
    taken = np.array([view.base_T_flange for view in seen])
    predicted = predict(scene, taken)
    # The sum, since either may be too small: one rests on the stated noise, the other on a few residuals.
    covariance = caution**2 * (np.nan_to_num(predicted.covariance, posinf=0.0) + solution.uncertainty.covariance)
    # In every alternative the latest view shows the target where it was detected.
    here = problem.anchor_T_mount(seen[-1])
    camera_T_target = inverse(here @ solution.mount_T_camera) @ solution.anchor_T_target
    others = tuple(
        replace(scene, mount_T_camera=x, anchor_T_target=here @ x @ camera_T_target)
        for x in sigma_points(solution.mount_T_camera, covariance)
    )
    return SceneBelief(
        scene, others, solution.uncertainty.point_mm, predicted.point_mm,
        solution.uncertainty.worst_point.expanded_mm, predicted.worst_point.expanded_mm,
        solution.observability.views_used, _differ_enough(scene, taken),
    )  # fmt: skip


def _differ_enough(scene: Scene, base_T_flange: Array) -> bool:
    """Whether the views (n, 4, 4) have two distances, MIN_DISTANCE_RATIO apart, and three rolls, MIN_ROLL_RAD apart."""
    poses, centre = scene.camera_T_target(base_T_flange), scene.target.points_mm.mean(axis=0, keepdims=True)
    distances = np.linalg.norm(map_points(poses, centre)[:, 0], axis=1)
    rolls = np.sort(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    gaps = np.diff(np.append(rolls, rolls[0] + 2 * np.pi))
    return bool(distances.max() >= MIN_DISTANCE_RATIO * distances.min() and np.sum(gaps >= MIN_ROLL_RAD) >= 3)


def expected_noise(solution: Solution) -> ExpectedNoise | None:
    """The noise that further views are expected to have, by what is believed of it after a solution."""
    image_px, robot = solution.noise.image_px, solution.noise.belief
    if image_px is None or robot is None:
        return None
    return ExpectedNoise(max(image_px, MIN_IMAGE_NOISE_PX), robot.mean().rotation_rad, robot.mean().translation_mm)


def _rough_belief(
    prior: ScenePrior, problem: Problem, seen: list[View], camera: CameraModel, caution: float
) -> SceneBelief:
    anchor_T_mount = np.array([problem.anchor_T_mount(view) for view in seen])
    camera_T_target = _target_poses(prior.target, camera, seen)
    mount_T_camera = _rough_mount(prior, anchor_T_mount, camera_T_target)
    scene = _scene(prior, camera, mount_T_camera, anchor_T_mount[-1] @ mount_T_camera @ camera_T_target[-1])
    prior_covariance = (
        prior.covariance()
        if prior.mount_T_camera is not None
        else _diagonal_covariance(UNINFORMED_SIGMA_RAD, UNINFORMED_SIGMA_MM)
    )
    # One or two views do not separate focal length from distance: an unknown camera is covered by alternatives below.
    fixed_lens = replace(scene, intrinsics_free=False)
    information = fixed_lens.prior_information()
    information += view_information(fixed_lens, np.array([view.base_T_flange for view in seen])).sum(axis=0)
    information[:6, :6] += np.linalg.inv(prior_covariance)
    posterior = covariance_or_inf(information, 6)
    covariance = caution**2 * (posterior if np.all(np.isfinite(posterior)) else prior_covariance)
    others = []
    guessed = camera not in (prior.camera, prior.lens_before)
    factors = (0.6, 1.6) if guessed else ()  # on the focal length: the range of a guessed field of view
    scaled = (camera.matrix * np.array([[f, 1, 1], [1, f, 1], [1, 1, 1]]) for f in factors)
    for lens in (camera, *(replace(camera, matrix=matrix) for matrix in scaled)):
        pose = camera_T_target[-1] if lens is camera else _target_poses(prior.target, lens, seen[-1:])[0]
        others += [
            _scene(prior, lens, x, anchor_T_mount[-1] @ x @ pose) for x in sigma_points(mount_T_camera, covariance)
        ]
    return SceneBelief(scene, tuple(others), np.inf, np.inf)


def _rough_mount(prior: ScenePrior, anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4) from the prior and the agreement of two or more views; from the views alone without a guess of X.

    Raises UndeterminedError `mount-unknown` when there is neither.
    """
    if prior.mount_T_camera is None:
        motion = summarise_motion(anchor_T_mount)
        if motion.distinct < 3 or motion.axis_angle_rad < MIN_EXPLORING_AXIS_ANGLE_RAD:
            raise UndeterminedError(
                "mount-unknown",
                Sentence("mount-unknown" if prior.setup == "eye-in-hand" else "stand-unknown"),
                Sentence("turn-or-guess", setting=f"{MOUNTS[prior.setup]}_T_camera_guess"),
            )
        return kronecker(anchor_T_mount, camera_T_target)
    if len(anchor_T_mount) < 2:
        return prior.mount_T_camera
    return _fit_mount(prior.mount_T_camera, np.sqrt(np.diagonal(prior.covariance())), anchor_T_mount, camera_T_target)


def _fit_mount(mount_guess: Array, sigma: Array, anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """The X (4, 4) near the guess for which all views agree on the target: least squares with prior sigmas (6,)."""
    agree = np.repeat([np.radians(0.1), 1.0], 3)

    def residuals(step: Array) -> Array:
        mount_T_camera = mount_guess @ transform_from_vector(step)
        targets = anchor_T_mount @ mount_T_camera @ camera_T_target
        apart = inverse(targets[:-1]) @ targets[1:]
        off = vector_from_transform(apart)
        stacked: Array = np.concatenate([step / sigma, (off / agree).ravel()])
        return stacked

    step = scipy.optimize.least_squares(residuals, np.zeros(6), x_scale=sigma).x
    return mount_guess @ transform_from_vector(step)


def _target_poses(target: Target, camera: CameraModel, seen: list[View]) -> Array:
    poses = []
    for view in seen:
        assert view.detection is not None
        try:
            poses.append(target_pose(camera, target, view.detection)[0].camera_T_target)
        except DetectionError as error:
            raise UndeterminedError(error.code, error.what, error.fix) from None
    return np.array(poses)


def _diagonal_covariance(rotation_rad: float, translation_mm: float) -> Array:
    """Covariance (6, 6) of [rad, mm]."""
    return np.diag(np.repeat([rotation_rad**2, translation_mm**2], 3))


def _scene(prior: ScenePrior, camera: CameraModel, mount_T_camera: Array, anchor_T_target: Array) -> Scene:
    return Scene(
        prior.setup, prior.target, camera, mount_T_camera, anchor_T_target, prior.noise, prior.camera is None,
        prior.points, prior.knowledge, prior.camera,
    )  # fmt: skip
