"""From a problem to what an estimator works on: clean corners, a camera, each view's own pose of the target."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.intrinsics.estimate import estimate_camera
from calibration.likelihood.estimate import HELD
from calibration.likelihood.systematic_errors import NO_DOUBT, Doubt
from calibration.observability import require_observable
from calibration.observations.observations import Observations, Unusable, observe, scaled
from calibration.observations.reprojection import INTRINSICS
from calibration.observations.view_poses import candidate_poses, refined_poses
from calibration.preprocessing.corner_outliers import without_bad_corners
from calibration.preprocessing.image_weights import weighted_by_view
from calibration.preprocessing.pose_ambiguity import best_readings
from calibration.preprocessing.target_shape import TargetShape, deviates, shaped
from calibration.problem import Problem, Setup, anchor_T_mount_of
from calibration.transforms import Array

IMAGE_DISAGREES = Unusable("image-disagrees", "its corners do not lie as the corners of this target do")


@dataclass(frozen=True, eq=False)
class Prepared:
    """n views that can be used, and by position in `problem.views` why the others cannot.

    `drawn_mm` (k, 3): the target as described; `camera_T_target` (n, 4, 4): each view's own pose; `turned` (n,): the
    board was read the wrong way round; `free` (10,): which intrinsics are unknown, and whether the target's scale is;
    `shape`: the target as it is, when that is not as it was drawn; `doubt`: what all views are thought to err in.
    """

    setup: Setup
    drawn_mm: Array
    seen: Observations
    camera: CameraModel
    free: NDArray[np.bool_]
    camera_T_target: Array
    turned: NDArray[np.bool_]
    refused: dict[int, Unusable]
    shape: TargetShape | None = None
    scale: float = 1.0
    doubt: Doubt = NO_DOUBT

    @property
    def anchor_T_mount(self) -> Array:
        """(n, 4, 4)"""
        return anchor_T_mount_of(self.setup, self.seen.base_T_flange)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Prepared":
        """Only the chosen views."""
        return replace(
            self,
            seen=self.seen.take(chosen),
            camera_T_target=self.camera_T_target[chosen],
            turned=self.turned[chosen],
        )


def prepare(problem: Problem) -> Prepared:
    """Raises UndeterminedError when the views' poses, or their images, cannot determine X or the camera."""
    seen, refused = observe(problem)
    require_observable(seen.base_T_flange)
    camera, free = _camera(problem, seen)
    poses, errors = candidate_poses(seen, camera)
    clean = without_bad_corners(seen, camera, poses[:, 0])
    kept = np.setdiff1d(np.arange(len(seen)), clean.refused)
    refused |= {int(seen.positions[row]): IMAGE_DISAGREES for row in clean.refused}
    if len(kept) < len(seen):
        require_observable(seen.base_T_flange[kept])
    seen, candidates = clean.seen.take(kept), np.stack([clean.camera_T_target, poses[:, 1]], axis=1)[kept]
    anchor_T_mount = anchor_T_mount_of(problem.setup, seen.base_T_flange)
    read = best_readings(seen, anchor_T_mount, candidates, errors[kept], problem.target.points_mm)
    drawn = Prepared(
        problem.setup, problem.target.points_mm, read.seen, camera, free, read.camera_T_target, read.turned, refused
    )
    if deviates(drawn.seen, drawn.camera, drawn.camera_T_target, free[:INTRINSICS]):
        drawn = _shaped(drawn, free)
    return replace(drawn, seen=weighted_by_view(drawn.seen, drawn.camera, drawn.camera_T_target))


def with_real_target(prepared: Prepared) -> Prepared:
    """The target's shape estimated anew with the camera held at its present estimate."""
    seen = scaled(replace(prepared.seen, points_mm=prepared.drawn_mm[prepared.seen.ids]), prepared.scale)
    poses = refined_poses(seen, prepared.camera, prepared.camera_T_target)
    again = _shaped(replace(prepared, seen=seen, camera_T_target=poses), HELD)
    return replace(again, seen=scaled(again.seen, 1 / prepared.scale))


def _shaped(prepared: Prepared, free: NDArray[np.bool_]) -> Prepared:
    drawn_mm = prepared.scale * prepared.drawn_mm
    real = shaped(prepared.seen, prepared.camera, prepared.camera_T_target, free[:INTRINSICS], drawn_mm)
    return replace(prepared, seen=real.seen, camera=real.camera, camera_T_target=real.camera_T_target, shape=real.shape)


def _camera(problem: Problem, seen: Observations) -> tuple[CameraModel, NDArray[np.bool_]]:
    """The given camera, or one from all views; all of whose terms are unknown."""
    if problem.camera is not None:
        return problem.camera, HELD
    detections = [problem.views[position].detection for position in seen.positions]
    found = estimate_camera(problem.target, [d for d in detections if d is not None], problem.image_size)
    return found.camera, np.concatenate([np.ones(INTRINSICS, bool), [False]])
