"""X without a target: overlapping views of one rigid part, with X among the unknowns of their registration.

The part stands still in the anchor: the base, or the flange before a standing camera. View i stands there at motion_i @
anchor_T_mount_i @ X @ exp(d). A change d of X moves view i by Ad(anchor_T_camera_i) d, so the information each pair has
about its two views (`fusion.pose_adjustment`) is also about X. The robot's accuracy is the prior of each motion_i as
in `fusion.pose_adjustment`. X has no prior: where neither surfaces nor motions determine it, its covariance shows this
and it is refused.

The robot's noise is estimated as well (expectation maximisation; Dempster, Laird, Rubin 1977): the mean square of the
estimated motions plus their remaining variance. The stated noise counts as one further view, since few views cannot
determine it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.errors import UndeterminedError
from calibration.kinematics.robot_accuracy import ABSOLUTE_NOISE, RobotNoise
from calibration.problem import Setup, anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Noise, Solution, ViewResult
from calibration.transforms import Array, adjoint, difference, inverse, skew, transform_from_vector
from registration.calibrate.outcome import solution_with_x, solution_without_x
from registration.calibrate.surface_search import find_rough_x
from registration.fusion.overlap import agreement, reach_of
from registration.fusion.pose_adjustment import PairEvidence, TwistFrame, correction_of
from registration.points.surface import Surface
from registration.scan import ScanView, ViewSample, sample_views, setup_of

METHOD = "overlapping surfaces"
ROUGH_MM = 40.0
"""Displacement of a surface by a rough X; the first search for counterparts reaches this far."""
SEARCHED_MM = 20.0
"""The same by an X that was searched."""
NARROWING = 0.75
MAX_ITERATIONS = 60
STEP_TOLERANCE_MM = 2e-3
ROTATION_LIMIT_RAD = float(np.deg2rad(2.0))
TRANSLATION_LIMIT_MM = 15.0
MIN_VIEWS = 3
NOISE_TOLERANCE = 0.01
"""Relative change of the noise estimate at which it has converged."""
MAX_NOISE_ITERATIONS = 30
SEEN_POINTS = 200
FIX = Sentence("add-overlap")


def solve_surface_scan(
    views: Sequence[ScanView],
    rough: Array | None,
    noise: RobotNoise = ABSOLUTE_NOISE,
    *,
    rough_mm: float = ROUGH_MM,
) -> Solution:
    """X from overlapping views; `mount_T_camera` is None when they do not determine it.

    `rough`: X (4, 4), within `rough_mm` on the surfaces; None: it is searched.

    Raises CloudError's leaves, UnitUnknown, ScanError.
    """
    samples = sample_views(views)
    setup, poses = setup_of(views), np.array([view.base_T_flange for view in views])
    anchor_T_mount = anchor_T_mount_of(setup, poses)
    try:
        require_observable(poses)
        surfaces = [sample.surface for sample in samples]
        start = find_rough_x(surfaces, anchor_T_mount) if rough is None else rough
        reach_mm = SEARCHED_MM if rough is None else rough_mm
        found = solve_from_surfaces(surfaces, anchor_T_mount, start, noise, reach_mm, setup=setup)
    except UndeterminedError as error:
        results = [ViewResult(index, None, "rejected", error.code) for index in range(len(views))]
        return solution_without_x(METHOD, setup, results, poses, error)
    return _solution(found, samples, setup, poses, start, noise, searched=rough is None)


@dataclass(frozen=True, eq=False)
class SurfaceSolution:
    """X, covariance (6, 6) of [rotation rad, translation mm] of X @ exp(.) in the camera frame, and motions.

    `noise`: the robot's, estimated. `alone`: views without overlap, which carry no information. `settled`: converged.
    """

    mount_T_camera: Array
    covariance: Array
    motions: tuple[Array, ...]
    noise: RobotNoise
    alone: tuple[int, ...]
    iterations: int
    converged: bool


def solve_from_surfaces(
    surfaces: Sequence[Surface],
    anchor_T_mount: Array,
    mount_T_camera: Array,
    noise: RobotNoise = ABSOLUTE_NOISE,
    rough_mm: float = ROUGH_MM,
    *,
    setup: Setup = "eye-in-hand",
) -> SurfaceSolution:
    """Gauss-Newton over X and all motions while the search radius shrinks; `noise` starts its estimate.

    Raises UndeterminedError.
    """
    # The robot's errors are those of the flange: it is the mount, or the anchor itself.
    anchor_T_flange = anchor_T_mount if setup == "eye-in-hand" else np.broadcast_to(np.eye(4), anchor_T_mount.shape)
    count, stated = len(surfaces), noise
    if count < MIN_VIEWS:
        what = Sentence("part-views", views=count)
        raise UndeterminedError("too-few-views", what, Sentence("scan-from", least=MIN_VIEWS))
    x, motions = mount_T_camera, [np.eye(4) for _ in surfaces]
    least_mm = reach_of(surfaces)
    reach_mm, iteration, settled = max(rough_mm, least_mm), 0, False
    while iteration < MAX_ITERATIONS and not settled:
        iteration += 1
        poses = [motion @ mount @ x for motion, mount in zip(motions, anchor_T_mount, strict=True)]
        frame = TwistFrame.around(surfaces, poses)
        pairs = frame.all_pairs(surfaces, poses, reach_mm)
        if not pairs:
            raise UndeterminedError("views-alone", Sentence("no-overlap"), FIX)
        system = _SurfaceSystem(frame, pairs, poses, motions, anchor_T_flange)
        if reach_mm <= least_mm:
            noise = _estimate_noise(system, noise, stated)
        information, step = system.solve(noise)
        covariance = _covariance_of_x(information)
        x = x @ transform_from_vector(step[-6:])
        motions = system.apply_step(step)
        narrow = reach_mm <= least_mm
        settled = (
            narrow
            and float(np.abs(step[:-6]).max()) < STEP_TOLERANCE_MM
            and float(np.abs(step[-3:]).max()) < STEP_TOLERANCE_MM
        )
        reach_mm = max(least_mm, reach_mm * NARROWING)
    deviations = np.sqrt(np.diagonal(covariance))
    if deviations[:3].max() > ROTATION_LIMIT_RAD or deviations[3:].max() > TRANSLATION_LIMIT_MM:
        raise UndeterminedError("surfaces-unobservable", _weakest(deviations * np.repeat([300.0, 1.0], 3)), FIX)
    alone = tuple(index for index in range(count) if index not in system.overlapping_views)
    return SurfaceSolution(x, covariance, tuple(motions), noise, alone, iteration, settled)


@dataclass(frozen=True, eq=False)
class _SurfaceSystem:
    """All motions and X linearised, so that other noise levels can be tried without a new search."""

    frame: TwistFrame
    pairs: dict[tuple[int, int], PairEvidence]
    poses: Sequence[Array]
    motions: Sequence[Array]
    anchor_T_flange: Array

    @property
    def overlapping_views(self) -> set[int]:
        return {index for key in self.pairs for index in key}

    def solve(self, noise: RobotNoise) -> tuple[Array, Array]:
        """Information (6n + 6, 6n + 6) of all motions and, last, of X (rad, mm in the camera frame); the step."""
        seen, seen_gradient, prior, prior_gradient = self.frame.normal_equations(
            self.pairs, self.motions, list(self.anchor_T_flange), noise
        )
        moved = np.concatenate([_twist_per_x(pose, self.frame) for pose in self.poses])
        information = np.block([[seen + prior, seen @ moved], [moved.T @ seen, moved.T @ seen @ moved]])
        gradient = np.concatenate([seen_gradient + prior_gradient, moved.T @ seen_gradient])
        return information, -np.asarray(np.linalg.solve(information, gradient), float)

    def apply_step(self, step: Array) -> list[Array]:
        return self.frame.move(step[:-6].reshape(-1, 6), self.motions)


def _estimate_noise(system: _SurfaceSystem, noise: RobotNoise, stated: RobotNoise) -> RobotNoise:
    """Noise from the motions of overlapping views, and from their remaining covariance."""
    for _ in range(MAX_NOISE_ITERATIONS):
        before = noise
        information, step = system.solve(noise)
        covariance, motions = np.linalg.inv(information), system.apply_step(step)
        squares = np.array([stated.rotation_rad**2, stated.translation_mm**2])
        for index in system.overlapping_views:
            flange_mm = system.anchor_T_flange[index][:3, 3]
            translation_mm, rotation_rad = correction_of(motions[index], flange_mm)
            own = slice(6 * index, 6 * index + 6)
            at_flange = system.frame.at_flange(flange_mm)
            left = np.diagonal(at_flange @ covariance[own, own] @ at_flange.T)
            squares += [np.mean(rotation_rad**2 + left[:3]), np.mean(translation_mm**2 + left[3:])]
        deviations = np.sqrt(squares / (1 + len(system.overlapping_views)))
        noise = RobotNoise(float(deviations[1]), float(deviations[0]))
        then, now = ((one.translation_mm, one.rotation_rad) for one in (before, noise))
        if np.allclose(then, now, rtol=NOISE_TOLERANCE, atol=0):
            break
    return noise


def _twist_per_x(anchor_T_camera: Array, frame: TwistFrame) -> Array:
    """(6, 6): the twist of a view per change of X."""
    about_anchor = adjoint(anchor_T_camera)
    shift = np.eye(6)
    shift[:3, :3] *= frame.radius_mm
    shift[3:, :3] = -skew(frame.origin)
    moved: Array = shift @ about_anchor
    return moved


def _covariance_of_x(information: Array) -> Array:
    """(6, 6) with the motions marginalised; infinite along undetermined directions."""
    views, coupling, of_x = information[:-6, :-6], information[:-6, -6:], information[-6:, -6:]
    reduced = of_x - coupling.T @ np.linalg.solve(views, coupling)
    lengths = np.repeat([300.0, 1.0], 3)  # scales radians and millimetres alike
    values, vectors = np.linalg.eigh(reduced / lengths[:, None] / lengths)
    if values[0] <= 1e-9 * values[-1]:
        raise UndeterminedError("surfaces-unobservable", _weakest(vectors[:, 0]), FIX)
    found: Array = (vectors / values @ vectors.T) / lengths[:, None] / lengths
    return found


def _weakest(direction: Array) -> Sentence:
    turns = np.linalg.norm(direction[:3]) > np.linalg.norm(direction[3:])
    return Sentence("surfaces-leave-rotation" if turns else "surfaces-leave-translation")


def _solution(
    found: SurfaceSolution,
    samples: Sequence[ViewSample],
    setup: Setup,
    poses: Array,
    rough: Array,
    noise: RobotNoise,
    *,
    searched: bool,
) -> Solution:
    x, mounts = found.mount_T_camera, anchor_T_mount_of(setup, poses)
    placed = [motion @ mount @ x for motion, mount in zip(found.motions, mounts, strict=True)]
    agreed = agreement([sample.surface for sample in samples], placed)
    results = []
    for index, (motion, flange) in enumerate(zip(found.motions, poses, strict=True)):
        of_flange = motion if setup == "eye-in-hand" else flange @ inverse(motion) @ inverse(flange)
        correction = correction_of(of_flange, flange[:3, 3])
        alone = index in found.alone
        reason = "no-overlap" if alone else None
        results.append(ViewResult(index, None, "rejected" if alone else "corrected", reason, None, None, correction))
    seen = np.concatenate(
        [sample.surface.points[:: len(sample.surface.points) // SEEN_POINTS + 1] for sample in samples]
    )
    return solution_with_x(
        METHOD,
        setup,
        x,
        found.covariance,
        seen,
        Noise(None, found.noise.rotation_rad, found.noise.translation_mm),
        results,
        np.delete(poses, found.alone, axis=0),
        tuple(_findings(found, agreed.rms_mm, rough, noise, searched=searched)),
    )


def _findings(
    found: SurfaceSolution, rms_mm: float | None, rough: Array, noise: RobotNoise, *, searched: bool
) -> list[Finding]:
    off_mm, off_rad = difference(found.mount_T_camera, rough)
    name = "surfaces-searched" if searched else "surfaces-agree"
    agree = Sentence(name, off_mm=off_mm, off_deg=np.degrees(off_rad), rms_mm=rms_mm or 0.0)
    findings = [Finding("surfaces-agree", "info", agree, Sentence("none-needed"))]
    if not found.converged:
        what = Sentence("not-settled", iterations=found.iterations)
        findings.append(Finding("not-settled", "error", what, Sentence("start-better")))
    if found.noise.translation_mm > noise.translation_mm or found.noise.rotation_rad > noise.rotation_rad:
        what = Sentence(
            "robot-noise-beyond",
            translation_mm=found.noise.translation_mm,
            rotation_deg=np.degrees(found.noise.rotation_rad),
            expected_mm=noise.translation_mm,
            expected_deg=np.degrees(noise.rotation_rad),
        )
        findings.append(Finding("robot-noise", "warning", what, Sentence("check-mount-and-part")))
    return findings
