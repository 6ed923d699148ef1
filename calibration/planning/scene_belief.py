"""What is known of the scene before the first view and after each: the guesses first, then what the views tell.

With one view the target's pose follows from the guess of X; with two, X is pulled towards what both agree on; from
three that determine it, X is the estimator's. Beside the best guess stand the scenes that could as well be true.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from calibration.camera import CameraModel
from calibration.closed_forms.kronecker import kronecker
from calibration.errors import DetectionError, UndeterminedError
from calibration.intrinsics.zhang_init import DEFAULT_FOCAL_OF_WIDTH
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene, covariance_of, predict, view_information
from calibration.observability import summarise_motion
from calibration.observations.observations import observe
from calibration.observations.view_poses import target_pose
from calibration.problem import Problem, Setup, View
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.targets import Target
from calibration.transforms import Array, inverse, rotation_from_vector, transform, vector_from_rotation

GUESS_RAD, GUESS_MM = float(np.radians(5.0)), 25.0
"""One standard deviation per axis of a guess that is good to some 50 mm and 10 degrees, unless it is said otherwise."""

TURNED_RAD, TURNED_MM = np.radians(20.0), 150.0
"""The same before anything at all is known of X: only the views bound it."""

LEAST_AXIS_ANGLE_RAD = np.radians(20.0)
"""Between the axes of exploring turns, so that a closed form gives a rough X."""

VIEWS_THAT_TELL_NOISE = 8
"""Fewer estimate the noise to no better than a factor of two: the stated one is kept."""

LEAST_IMAGE_NOISE_PX = 0.01
SIGMAS = 2.0
"""Deviations from the best guess at which the alternatives stand."""

LEVER_MM = 600.0
"""A radian counts as this many millimetres when the directions of greatest doubt are looked for."""

LEAST_RAD, LEAST_MM = np.radians(0.1), 1.0
"""Nothing is believed to be better known than this, however well the views agree."""


@dataclass(frozen=True, eq=False)
class Guess:
    """What is stated before anything has been seen; None: nothing. Frames as in `calibration.problem`.

    `rotation_rad`, `translation_mm`: one standard deviation per axis of the two guessed poses.
    """

    setup: Setup
    target: Target
    camera: CameraModel | None
    mount_T_camera: Array | None
    anchor_T_target: Array | None
    noise: ExpectedNoise
    rotation_rad: float = GUESS_RAD
    translation_mm: float = GUESS_MM

    def prior(self) -> Array:
        """Covariance (6, 6) of [rad, mm] of a guess."""
        return _prior(self.rotation_rad, self.translation_mm)


@dataclass(frozen=True, eq=False)
class Belief:
    """The scene as it is best understood, and what it could as well be.

    `reached_mm`: what a calibration from these views would say of a mapped point; infinite before it could.
    `predicted_mm`: the same, predicted from the noise of the scene.
    """

    scene: Scene
    alternatives: tuple[Scene, ...]
    reached_mm: float
    predicted_mm: float


def learnt(guess: Guess, problem: Problem, *, caution: float = 1.0) -> Belief:
    """What the views of `problem` so far tell, beyond the guess. `caution` widens what could as well be true.

    Raises UndeterminedError when neither guess nor views say where camera and target are.
    """
    seen = _seen(problem)
    camera = guess.camera or rough_camera(problem.image_size)
    if not seen:
        return _guessed(guess, camera, caution)
    if len(seen) >= 3:
        solution = solve_hand_eye(replace(problem, camera=guess.camera))
        if solution.mount_T_camera is not None and solution.uncertainty is not None:
            return _solved(guess, problem, seen, solution, caution)
    return _rough(guess, problem, seen, camera, caution)


def alternatives(a_T_b: Array, covariance: Array) -> list[Array]:
    """Twelve poses (4, 4) at `SIGMAS` along the principal axes of `covariance` (6, 6) of [rad, mm], a_T_b @ exp(.)."""
    scale = np.repeat([LEVER_MM, 1.0], 3)
    floor = np.diag(np.repeat([LEAST_RAD**2, LEAST_MM**2], 3))
    values, axes = np.linalg.eigh((covariance + floor) * np.outer(scale, scale))
    steps = SIGMAS * np.sqrt(values)[:, None] * axes.T / scale
    return [a_T_b @ transform(rotation_from_vector(step[:3]), step[3:]) for step in np.concatenate([steps, -steps])]


def rough_camera(image_size: tuple[int, int]) -> CameraModel:
    """A camera of the usual field of view, when nothing is known of it."""
    width, height = image_size
    focal = DEFAULT_FOCAL_OF_WIDTH * width
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
    return CameraModel(matrix, np.zeros(5), image_size)


def _seen(problem: Problem) -> list[View]:
    usable, _ = observe(problem)
    return [problem.views[position] for position in usable.positions]


def _guessed(guess: Guess, camera: CameraModel, caution: float) -> Belief:
    if guess.mount_T_camera is None or guess.anchor_T_target is None:
        raise UndeterminedError(
            "target-not-found",
            "the target is not seen, and nothing says where it is",
            "drive the arm to where the camera sees the whole target, or state both guesses",
        )
    scene = _scene(guess, camera, guess.mount_T_camera, guess.anchor_T_target)
    covariance = caution**2 * guess.prior()
    of_mount = [(x, guess.anchor_T_target) for x in alternatives(guess.mount_T_camera, covariance)]
    of_target = [(guess.mount_T_camera, y) for y in alternatives(guess.anchor_T_target, covariance)]
    others = tuple(_scene(guess, camera, x, y) for x, y in of_mount + of_target)
    return Belief(scene, others, np.inf, np.inf)


def _solved(guess: Guess, problem: Problem, seen: list[View], solution: Solution, caution: float) -> Belief:
    assert solution.mount_T_camera is not None
    assert solution.anchor_T_target is not None
    assert solution.camera is not None
    assert solution.uncertainty is not None
    scene = replace(
        _scene(guess, solution.camera, solution.mount_T_camera, solution.anchor_T_target),
        noise=_noise(guess, solution, len(seen)),
    )
    taken = np.array([view.base_T_flange for view in seen])
    predicted = predict(scene, taken)
    # Either may be too small alone: the one counts on the stated noise, the other on a few residuals.
    covariance = caution**2 * (np.nan_to_num(predicted.covariance, posinf=0.0) + solution.uncertainty.covariance)
    # The target is where the latest view shows it, whatever X is.
    here = problem.anchor_T_mount(seen[-1])
    camera_T_target = inverse(here @ solution.mount_T_camera) @ solution.anchor_T_target
    others = tuple(
        replace(scene, mount_T_camera=x, anchor_T_target=here @ x @ camera_T_target)
        for x in alternatives(solution.mount_T_camera, covariance)
    )
    return Belief(scene, others, solution.uncertainty.point_mm, predicted.point_mm)


def _noise(guess: Guess, solution: Solution, views: int) -> ExpectedNoise:
    found = solution.noise
    if (
        views < VIEWS_THAT_TELL_NOISE
        or found.image_px is None
        or found.robot_rotation_rad is None
        or found.robot_translation_mm is None
    ):
        return guess.noise
    image_px = max(found.image_px, LEAST_IMAGE_NOISE_PX)
    return ExpectedNoise(image_px, found.robot_rotation_rad, found.robot_translation_mm)


def _rough(guess: Guess, problem: Problem, seen: list[View], camera: CameraModel, caution: float) -> Belief:
    anchor_T_mount = np.array([problem.anchor_T_mount(view) for view in seen])
    camera_T_target = _target_poses(guess.target, camera, seen)
    mount_T_camera = _rough_mount(guess, anchor_T_mount, camera_T_target)
    scene = _scene(guess, camera, mount_T_camera, anchor_T_mount[-1] @ mount_T_camera @ camera_T_target[-1])
    prior = guess.prior() if guess.mount_T_camera is not None else _prior(TURNED_RAD, TURNED_MM)
    # One view or two cannot tell the lens from the distance: what is doubtful of a camera stands beside, below.
    held = replace(scene, intrinsics_free=False)
    told = view_information(held, np.array([view.base_T_flange for view in seen])).sum(axis=0)
    told[:6, :6] += np.linalg.inv(prior)
    told_covariance = covariance_of(told)
    covariance = caution**2 * (told_covariance if np.all(np.isfinite(told_covariance)) else prior)
    others = []
    for lens in (camera,) if guess.camera else _cameras_alike(camera):
        pose = camera_T_target[-1] if lens is camera else _target_poses(guess.target, lens, seen[-1:])[0]
        others += [
            _scene(guess, lens, x, anchor_T_mount[-1] @ x @ pose) for x in alternatives(mount_T_camera, covariance)
        ]
    return Belief(scene, tuple(others), np.inf, np.inf)


def _rough_mount(guess: Guess, anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X from the guess and what two views or more agree on; from the views alone when there is no guess."""
    if guess.mount_T_camera is None:
        motion = summarise_motion(anchor_T_mount)
        if motion.distinct < 3 or motion.axis_angle_rad < LEAST_AXIS_ANGLE_RAD:
            raise UndeterminedError(
                "mount-unknown",
                "nothing is known of where the camera sits on the flange",
                "turn the flange about two axes with the target in view, or state flange_T_camera_guess",
            )
        return kronecker(anchor_T_mount, camera_T_target)
    if len(anchor_T_mount) < 2:
        return guess.mount_T_camera
    return _pulled(guess.mount_T_camera, np.sqrt(np.diagonal(guess.prior())), anchor_T_mount, camera_T_target)


def _pulled(guess: Array, spread: Array, anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """The X near the guess for which the target stands still: least squares under the guess's `spread` (6,)."""
    agree = np.repeat([np.radians(0.1), 1.0], 3)

    def residuals(step: Array) -> Array:
        mount_T_camera = guess @ transform(rotation_from_vector(step[:3]), step[3:])
        targets = anchor_T_mount @ mount_T_camera @ camera_T_target
        apart = inverse(targets[:-1]) @ targets[1:]
        off = np.column_stack([vector_from_rotation(apart[:, :3, :3]).reshape(-1, 3), apart[:, :3, 3]])
        stacked: Array = np.concatenate([step / spread, (off / agree).ravel()])
        return stacked

    step = least_squares(residuals, np.zeros(6), x_scale=spread).x
    return guess @ transform(rotation_from_vector(step[:3]), step[3:])


def _target_poses(target: Target, camera: CameraModel, seen: list[View]) -> Array:
    poses = []
    for view in seen:
        assert view.detection is not None
        try:
            poses.append(target_pose(camera, target, view.detection)[0].camera_T_target)
        except DetectionError as error:
            raise UndeterminedError(error.code, error.what, error.fix) from None
    return np.array(poses)


def _cameras_alike(camera: CameraModel) -> tuple[CameraModel, ...]:
    """Cameras of a longer and a shorter focal length: what a guessed field of view could as well be."""
    return camera, *(replace(camera, matrix=camera.matrix * np.array([[f, 1, 1], [1, f, 1], [1, 1, 1]]))
                     for f in (0.6, 1.6))  # fmt: skip


def _prior(rotation_rad: float, translation_mm: float) -> Array:
    """Covariance (6, 6) of [rad, mm]."""
    return np.diag(np.repeat([rotation_rad**2, translation_mm**2], 3))


def _scene(guess: Guess, camera: CameraModel, mount_T_camera: Array, anchor_T_target: Array) -> Scene:
    free = guess.camera is None
    return Scene(guess.setup, guess.target, camera, mount_T_camera, anchor_T_target, guess.noise, free)
