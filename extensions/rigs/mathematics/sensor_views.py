"""What one sensor of a rig contributes: the target's pose in it at every view, and how exact that is."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from calibration.errors import UndeterminedError
from calibration.linear_algebra import scaled_inverse
from calibration.observations.measured_poses import measured_views
from calibration.observations.view_poses import refine_poses
from calibration.pose_pairs.length_scale import LengthPrior, require_units
from calibration.pose_pairs.residuals import PosePairs, residuals_by_motion
from calibration.pose_pairs.solve import fit_pose_pairs
from calibration.preprocessing.prepare import PreparedSession
from calibration.problem import Problem
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, map_points

POSE = 6
"""Numbers of a pose; the columns of the nuisances follow them in the statistics of pixels."""


@dataclass(frozen=True, eq=False)
class SensorViews:
    """The n usable views of one sensor.

    pairs : the robot's poses, and the target's in the sensor with its covariance where that is known.
    by_common : (n, 6, k) derivative of the residuals (`pose_pairs.residuals`) by k unknowns that all views share, the
        nuisances of a camera's lens and of its target; of a sensor with `lengths` they are those of its pairs.
    information, gradient : (k, k), (k,) what the views alone and the priors say of those unknowns.
    target_mm : (m, 3) the target's points.
    lengths : what is known of the lengths of a sensor that measures in space, of which the pairs have the widest.
    """

    name: str
    pairs: PosePairs
    by_common: Array
    information: Array
    gradient: Array
    target_mm: Array
    lengths: LengthPrior | None = None

    def points_mm(self) -> Array:
        """The target's points (n m, 3) in the sensor's frame, in all views."""
        return np.concatenate([map_points(pose, self.target_mm) for pose in self.pairs.camera_T_target])


def measured_sensor(name: str, problem: Problem) -> SensorViews:
    """The views of a session of points or poses that agree with each other.

    Raises UndeterminedError where points or poses are in another unit than the target or the robot.
    """
    seen, _ = measured_views(problem)
    pairs = PosePairs(problem.setup, seen.base_T_flange, seen.camera_T_target, covariance=seen.covariance)
    require_units(pairs)
    with suppress(UndeterminedError):  # views too few for an X of their own are determined beside another sensor
        pairs = pairs.take(fit_pose_pairs(pairs)[1])
    lengths = LengthPrior.about(seen, problem.knowledge)
    sigmas = np.array(lengths.widest())
    of_lengths = np.zeros((len(pairs), POSE, len(sigmas))), np.diag(sigmas**-2), np.zeros(len(sigmas))
    pairs = replace(pairs, length_sigmas=lengths.widest())
    return SensorViews(name, pairs, *of_lengths, problem.target.points_mm, lengths)


def imaging_sensor(name: str, prepared: PreparedSession, selection: Selection) -> SensorViews:
    """Each used view's own pose, at the lens and target of the session's estimate; a change of them moves all poses.

    With N the normal matrix of one view's pose p and of those nuisances k: dp = -N_pp^-1 N_pk dk, and the information
    that the pixels have on k beside the poses is N_kk - N_kp N_pp^-1 N_pk; the prior's is added.
    """
    rows, best = prepared.take(selection.used), selection.best
    assert best.nuisances is not None
    poses = refine_poses(best.seen(rows.seen), best.camera, rows.camera_T_target)
    found = best.nuisances.statistics(rows.seen, poses, best.z)
    pixel = best.variances.pixel
    by_pose, by_both = found.normal[:, :POSE, :POSE], found.normal[:, :POSE, POSE:]
    moved = scaled_inverse(by_pose)
    slope = moved @ by_both
    information = (found.normal[:, POSE:, POSE:] - np.swapaxes(by_both, 1, 2) @ slope).sum(axis=0) / pixel
    gradient = (found.gradient[:, POSE:] - (np.swapaxes(slope, 1, 2) @ found.gradient[:, :POSE, None])[..., 0]).sum(
        axis=0
    )
    turned = residuals_by_motion(poses, np.broadcast_to(np.eye(POSE), (len(poses), POSE, POSE)))
    covariance = pixel * turned @ moved @ np.swapaxes(turned, 1, 2)
    pairs = PosePairs(prepared.setup, rows.seen.base_T_flange, poses, covariance=covariance)
    known = best.model.prior_information[12 : 12 + len(best.z)]
    information, gradient = information + np.diag(known), gradient / pixel + known * best.z
    return SensorViews(name, pairs, turned @ slope, information, gradient, best.scale * rows.nominal_mm)
