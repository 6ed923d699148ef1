"""Preparation of a session for the estimator: clean corners, a camera, the target's pose in each view."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.closed_forms.observability import only_axis, require_observable
from calibration.errors import UndeterminedError
from calibration.intrinsics.bundle_adjustment import ONLY_FOCAL, adjust, focal_step
from calibration.intrinsics.estimate import estimate_camera
from calibration.kinematics.robot_accuracy import NoiseBelief
from calibration.knowledge import Knowledge
from calibration.likelihood.axis_offset import GivenCoordinate
from calibration.likelihood.distributions import tetragamma, trigamma
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.nuisances import FOCAL, SHAPES, Nuisances, target_shapes
from calibration.observations.observations import IMAGE_REPEATED, Observations, UnusableReason, observe, repetitions
from calibration.observations.reprojection import INTRINSICS, pixel_residuals
from calibration.observations.view_poses import candidate_poses, poses_by_lens, refine_poses
from calibration.preprocessing.corner_outliers import reject_corner_outliers
from calibration.preprocessing.pose_ambiguity import resolve_pose_ambiguity
from calibration.preprocessing.target_shape import ShapeFit, Shown, estimate_shape, find_deviations
from calibration.problem import Problem, Setup, anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array

# Weights of the views by their pixel noise, shrunk towards the common noise (empirical Bayes).
#
# A view's residuals about its own pose estimate its noise from 2 m - 6 numbers. The true spread between views is
# estimated from the excess of these estimates' scatter over chi-square; it decides how far each is shrunk. Source: G.
# Smyth, "Linear models and empirical Bayes methods", Stat. Appl. Genet. Mol. Biol. 3(1) 2004, section 6.

MIN_VIEWS = 6
"""Fewer views do not determine the spread between views."""

MAX_RATIO = 30.0
"""Bound of the ratio between the common variance and a view's, either way."""

BIAS_PX = 0.02
"""Standard deviation of a detector's error common to a whole view, which the scatter within a view does not show."""


def weight_by_view_noise(seen: Observations, camera: CameraModel, camera_T_target: Array) -> Observations:
    """The observations with corners weighted by their view's noise; unchanged when the views do not differ."""
    redundancy = 2.0 * np.count_nonzero(seen.weights, axis=1) - 6
    if len(seen) < MIN_VIEWS or np.any(redundancy < 2):
        return seen
    square = np.sum(seen.weights[..., None] * pixel_residuals(seen, camera, camera_T_target) ** 2, axis=(1, 2))
    if np.any(square <= 0):
        return seen
    variances = square / redundancy
    common = float(square.sum() / redundancy.sum())
    known = _prior_redundancy(np.log(variances), redundancy)
    if not np.isfinite(known):
        return seen
    drawn = BIAS_PX**2 + (redundancy * variances + known * float(np.exp(np.mean(np.log(variances))))) / (
        redundancy + known
    )
    ratio = np.clip((BIAS_PX**2 + common) / drawn, 1 / MAX_RATIO, MAX_RATIO)
    # Scaled so that the weighted residuals keep the common variance.
    ratio *= common * redundancy.sum() / float(ratio @ square)
    return seen.with_weights(seen.weights * ratio[:, None])


def _prior_redundancy(logs: Array, redundancy: Array) -> float:
    """d0 with trigamma(d0 / 2) = var(log s²) - mean trigamma(d / 2); infinite without a significant spread of views."""
    chance = trigamma(redundancy / 2)
    excess = float(np.var(logs, ddof=1) - np.mean(chance))
    # The scatter of n estimates is itself uncertain by sqrt(2 / (n - 1)).
    if excess < 3 * float(np.mean(chance)) * np.sqrt(2 / (len(logs) - 1)):
        return np.inf
    half = 0.5 + 1 / excess
    for _ in range(20):
        slope = trigamma(half)
        half += float(slope * (1 - slope / excess) / tetragamma(half))
    return 2 * half


MIN_IMAGES = 3
"""Least number of different images for an X."""

FAR, MIN_FAR_SIGMAS = 0.1, 5.0
"""Least logarithm of a focal length over the given one, also in standard deviations, for starting at that."""

IMAGE_DISAGREES = UnusableReason("image-disagrees", Sentence("image-disagrees"))


@dataclass(frozen=True, eq=False)
class PreparedSession:
    """n usable views with what the estimator needs.

    nominal_mm : (k, 3) points of the target as described.
    nuisances : what is unknown of the lens and the target.
    z : (q,) the nuisances' deviations by the images, at which `camera` and the points of `seen` are.
    belief : in the robot's noise.
    camera_T_target : (n, 4, 4) each view's own pose, with camera and target as described.
    board_turned : (n,) views whose ids were corrected because the board was read in another orientation.
    unusable : reasons of the other views, by position in `problem.views`.
    shaped : whether each point of the target was estimated from the images.
    scale : of the target against the description, as it was found.
    seen_as_found : the observations with the target's shape as the estimate found it, as large as described; None
        before it.
    camera_covariance : (9, 9) or (12, 12) of the intrinsics by the images, see `CameraEstimate`; None if given.
    given : what was measured along the only axis of rotation, None where the motions determine X.
    """

    setup: Setup
    nominal_mm: Array
    seen: Observations
    camera: CameraModel
    nuisances: Nuisances
    z: Array
    belief: NoiseBelief
    camera_T_target: Array
    board_turned: NDArray[np.bool_]
    unusable: dict[int, UnusableReason]
    shaped: bool = False
    scale: float = 1.0
    seen_as_found: Observations | None = None
    camera_covariance: Array | None = None
    given: GivenCoordinate | None = None

    @property
    def anchor_T_mount(self) -> Array:
        """(n, 4, 4)"""
        return anchor_T_mount_of(self.setup, self.seen.base_T_flange)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "PreparedSession":
        """Only the chosen views."""
        return replace(
            self,
            seen=self.seen.take(chosen),
            camera_T_target=self.camera_T_target[chosen],
            board_turned=self.board_turned[chosen],
        )


def prepare(problem: Problem) -> PreparedSession:
    """Prepare a session. Raises UndeterminedError when poses or images do not determine X or the camera."""
    seen, refused = observe(problem)
    _require_different_images(problem, seen, refused)
    require_observable(seen.base_T_flange, offset_given=problem.axis_offset is not None)
    camera, camera_covariance = problem.camera, None
    if camera is None:
        detections = [problem.views[position].detection for position in seen.positions]
        found = estimate_camera(problem.target, [one for one in detections if one is not None], problem.image_size)
        camera, camera_covariance = found.camera, found.covariance
    estimated = problem.camera is None
    nuisances = Nuisances.of(camera, problem.target.points_mm, problem.knowledge, estimated=estimated)
    poses, errors = candidate_poses(seen, camera)
    clean = reject_corner_outliers(seen, camera, poses[:, 0])
    refused |= {int(seen.positions[row]): IMAGE_DISAGREES for row in clean.refused}
    refused |= repetitions(problem, clean.seen.take(np.setdiff1d(np.arange(len(seen)), clean.refused)))
    kept = np.flatnonzero([position not in refused for position in seen.positions])
    if len(kept) < len(seen):
        require_observable(seen.base_T_flange[kept], offset_given=problem.axis_offset is not None)
    seen, candidates = clean.seen.take(kept), np.stack([clean.camera_T_target, poses[:, 1]], axis=1)[kept]
    anchor_T_mount = anchor_T_mount_of(problem.setup, seen.base_T_flange)
    read = resolve_pose_ambiguity(seen, anchor_T_mount, candidates, errors[kept], problem.target.points_mm)
    shapes, unknown = target_shapes(problem.target.points_mm), nuisances.free
    unsaid = nuisances.knows_tangential
    is_far = not estimated and abs(focal_step(read.seen, camera, read.camera_T_target)) >= FAR
    shown = Shown()
    if not is_far:  # else they are those of the lens that `prepare_at_seen_lens` finds
        shown = find_deviations(read.seen, camera, read.camera_T_target, unknown, shapes, SHAPES, tangential=unsaid)
    if shown.tangential:
        nuisances = nuisances.with_tangential()
    if shown.bends:
        nuisances = nuisances.with_bends()
    drawn = PreparedSession(
        problem.setup,
        problem.target.points_mm,
        read.seen,
        camera,
        nuisances,
        np.zeros(len(nuisances)),
        problem.robot_noise,
        read.camera_T_target,
        read.board_turned,
        refused,
        camera_covariance=camera_covariance,
        given=_given_coordinate(problem, read.seen.base_T_flange),
    )
    if shown.points:
        drawn = _with_estimated_shape(drawn)
    return replace(drawn, seen=weight_by_view_noise(drawn.seen, drawn.camera, drawn.camera_T_target))


def prepare_at_seen_lens(problem: Problem) -> PreparedSession:
    """As `prepare`; where the corners show a lens far from the given one, by that.

    Distances follow the focal length: no linear step leads from a lens half or twice as long to the right one.
    """
    prepared, given = prepare(problem), problem.camera
    if given is None or abs(focal_step(prepared.seen, given, prepared.camera_T_target)) < FAR:
        return prepared
    found = adjust(prepared.seen, given, prepared.camera_T_target, ONLY_FOCAL)
    focal = found.camera.matrix[0, 0]
    longer = np.log(focal / given.matrix[0, 0])
    if abs(longer) < max(FAR, MIN_FAR_SIGMAS * np.sqrt(found.covariance[0, 0]) / focal):
        return prepared
    described = prepared.nuisances
    camera = described.camera_at(longer * np.eye(len(described))[FOCAL[0]])
    again = prepare(replace(problem, camera=camera))
    z = again.z.copy()
    z[FOCAL[0]] = longer
    return replace(again, nuisances=replace(again.nuisances, camera=given), z=z)


def at_given_lens(problem: Problem, prepared: PreparedSession) -> PreparedSession:
    """The session with each view's own pose by the lens as given."""
    given = problem.camera
    if given is None or given is prepared.camera:
        return prepared
    poses = poses_by_lens(prepared.seen, given, prepared.camera, prepared.camera_T_target)
    return replace(prepared, camera=given, camera_T_target=poses)


def _given_coordinate(problem: Problem, base_T_flange: Array) -> GivenCoordinate | None:
    """The session's axis_offset along the only axis of these poses (n, 4, 4); None where they turn about several."""
    axis = None if problem.axis_offset is None else only_axis(base_T_flange)
    if problem.axis_offset is None or axis is None:
        return None
    if problem.setup == "eye-to-hand":
        axis = (base_T_flange[:, :3, :3] @ axis).mean(axis=0)
        axis /= np.linalg.norm(axis)
    return GivenCoordinate.along(problem.axis_offset, axis, anchor_T_mount_of(problem.setup, base_T_flange))


def _require_different_images(problem: Problem, seen: Observations, refused: dict[int, UnusableReason]) -> None:
    """Raises UndeterminedError `images-repeated` when different images would have determined X, and these do not."""
    repeated = [position for position, why in refused.items() if why.code == IMAGE_REPEATED]
    if len(seen) >= MIN_IMAGES or not repeated:
        return
    poses = np.array([problem.views[position].base_T_flange for position in (*seen.positions, *repeated)])
    require_observable(poses, offset_given=problem.axis_offset is not None)
    raise UndeterminedError(
        "images-repeated",
        Sentence("images-repeated", repeated=len(repeated), views=len(repeated) + len(seen)),
        Sentence("take-new-images"),
    )


def update_target_shape(prepared: PreparedSession, best: Estimate, knowledge: Knowledge) -> PreparedSession:
    """The session with the target's shape estimated again at the camera of the estimate, which is not given."""
    seen = replace(prepared.seen, points_mm=prepared.nominal_mm[prepared.seen.ids])
    poses = refine_poses(seen, best.camera, prepared.camera_T_target)
    real = estimate_shape(seen, best.camera, poses, np.zeros(INTRINSICS, bool), prepared.nominal_mm)
    return _as_found(prepared, real, Nuisances.of(real.camera, prepared.nominal_mm, knowledge, estimated=True))


def _with_estimated_shape(prepared: PreparedSession) -> PreparedSession:
    """The session with the target's points estimated together with what is unknown of the lens."""
    nuisances, seen, camera = prepared.nuisances, prepared.seen, prepared.camera
    real = estimate_shape(seen, camera, prepared.camera_T_target, nuisances.free, prepared.nominal_mm)
    if not nuisances.estimated:  # the lens as given is where the estimate starts
        shaped = replace(seen, points_mm=real.points_mm[seen.ids])
        real = replace(real, camera=camera, camera_T_target=refine_poses(shaped, camera, real.camera_T_target))
    return _as_found(prepared, real, replace(nuisances, camera=real.camera))


def _as_found(prepared: PreparedSession, real: ShapeFit, drawn: Nuisances) -> PreparedSession:
    """The session with this target and camera."""
    nuisances, z = drawn.with_points(real.points_mm)
    seen = replace(prepared.seen, points_mm=real.points_mm[prepared.seen.ids])
    return replace(
        prepared, seen=seen, camera=real.camera, nuisances=nuisances, z=z, camera_T_target=real.camera_T_target,
        shaped=True,
    )  # fmt: skip
