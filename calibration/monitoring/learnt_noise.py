"""The robot's noise from verifications: their stations see one target from different poses of the arm."""

from dataclasses import replace

import numpy as np

from calibration.closed_forms.kronecker import as_rotation
from calibration.kinematics.robot_accuracy import NoiseBelief
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import quadratic_pixels
from calibration.likelihood.mixed_model import linearise_model
from calibration.likelihood.noise_marginalisation import update_belief
from calibration.likelihood.predicted_uncertainty import Scene, observe_whole_target
from calibration.linear_algebra import covariance_of
from calibration.monitoring.cell_change import SeenTarget
from calibration.observations.reprojection import pixel_statistics
from calibration.problem import anchor_T_mount_of
from calibration.transforms import Array, inverse, map_points, transform

MIN_STATIONS = 3
"""Two stations hardly distinguish the robot's errors from those of X."""


def learn_noise(belief: NoiseBelief, scene: Scene, covariance: Array, seen: SeenTarget) -> NoiseBelief:
    """The belief before the next run, after one more verification; unchanged for fewer than MIN_STATIONS stations.

    `scene`: as the calibration found it, whose X has the `covariance` (6, 6). The target's pose is unknown here: it
    may have been moved since.
    """
    if len(seen.base_T_flange) < MIN_STATIONS:
        return belief
    found = seen.anchor_T_target
    target = transform(as_rotation(found[:, :3, :3].mean(axis=0)), found[:, :3, 3].mean(axis=0))
    own = inverse(anchor_T_mount_of(scene.setup, seen.base_T_flange) @ scene.mount_T_camera) @ found
    pictures = observe_whole_target(scene, seen.base_T_flange)
    corners = np.array([scene.camera.project(map_points(pose, scene.target.points_mm)) for pose in own])
    statistics = pixel_statistics(replace(pictures, pixels=corners), scene.camera, own)
    chain = Chain(scene.setup, seen.base_T_flange, scene.mount_T_camera, target, np.zeros((len(own), 6)))
    poses = chain.camera_T_target()
    model = linearise_model(quadratic_pixels(statistics, own)(poses, np.zeros(0)), chain, poses)
    known = np.zeros((model.unknowns + 1, model.unknowns + 1))
    known[:6, :6] = covariance_of(covariance)
    variances = scene.noise.variances()
    before = belief.for_next_run()
    return update_belief(replace(model, direct=known), variances, before, before.median.levels())
