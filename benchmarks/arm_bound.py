"""How well points could be registered at best from a session in one posture, by what is known of arms of a family.

`python -m benchmarks.arm_bound [--arms N] [--seed FIRST]`: the sessions of 20 pictures of `benchmarks.arm --only
others`, one size a seed. The best linear estimate has the mean and covariance that 400 arms of the family have in these
poses and the held-out ones, and the true noise; X and the target's place are unknown, lens and target known as the
likeliest component of their prior has them ("open"), or exactly ("known"). No estimate of arms in general can.
"""

import argparse

import numpy as np

from benchmarks.arm import OTHER_SIZES, built_of_family, jogged
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import MixedModel
from calibration.linear_algebra import covariance_of
from calibration.solve import estimate_session
from calibration.transforms import Array, inverse, map_points, vector_from_transform
from extensions.arm_identification.mathematics.session import TargetViews, begin_arm_session
from mock_robot.arm.built_arm import BuiltArm
from tests.simulated.arms import MOUNT_T_CAMERA, REPEATABILITY, rms_length
from tests.simulated.other_arms import FAMILIES

DRAWS = 400
EXACT = 1e12
"""Precision of an unknown that is known."""


def main() -> None:
    """RMS over the arms, mm, of points by the arm as drawn and by the best estimates, and how many times better."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=12, help="simulated arms a row")
    parser.add_argument("--seed", type=int, default=0, help="of the first arm")
    options = parser.parse_args()
    print(f"{'errors':10} {'before':>7} {'open':>6} {'times':>6} {'known':>6} {'times':>6}")
    for family in ("standard", *FAMILIES):
        seeds = range(options.seed, options.seed + options.arms)
        rows = np.array([bounds_mm(OTHER_SIZES[seed % len(OTHER_SIZES)], family, seed) for seed in seeds])
        before, unknown, known = np.sqrt(np.mean(rows**2, axis=0))
        print(
            f"{family:10} {before:7.3f} {unknown:6.3f} {before / unknown:6.2f} {known:6.3f} {before / known:6.2f}",
            flush=True,
        )


def bounds_mm(name: str, family: str, seed: int) -> tuple[float, float, float]:
    """RMS of a registered point, mm: as drawn, and by the best estimate with lens and target open and known."""
    arm = find_arm(name)
    cell, interest = jogged(arm, family, seed, (20,))
    alone = estimate_session(cell.problems[0])
    joints = np.array([view.stance.joints_rad for view in cell.problems[0].views])
    approached = np.sign(np.diff(joints, axis=0, prepend=joints[:1] - 1.0))
    seen = Postures(joints, sides=approached)
    views = [TargetViews(alone.prepared, alone.selection.used, alone.best)]
    model = begin_arm_session(ArmErrorModel(arm), views, seen).linearise()

    def deviations(built: BuiltArm) -> Array:
        off = [inverse(arm.forward(at.joints_rad)) @ built.base_T_flange(at) for at in (seen, interest.postures)]
        return vector_from_transform(np.concatenate(off)).ravel()

    draws = np.array([deviations(built_of_family(arm, family, 10_000 + row)) for row in range(DRAWS)])
    flange = arm.forward(interest.postures.joints_rad)
    truth, drawn = (
        map_points(poses, interest.points_mm[:, None])[:, 0]
        for poses in (
            cell.built.base_T_flange(interest.postures) @ MOUNT_T_CAMERA,
            flange @ alone.best.chain.mount_T_camera,
        )
    )
    on_flange = map_points(MOUNT_T_CAMERA, interest.points_mm)
    by_x = flange[:, :3, :3] @ MOUNT_T_CAMERA[:3, :3] @ point_rows(interest.points_mm)
    by_pose = flange[:, :3, :3] @ point_rows(on_flange)
    open_mm, known_mm = (_best_mm(model, np.cov(draws.T), by_x, by_pose, known=known) for known in (False, True))
    return rms_length(drawn - truth), open_mm, known_mm


def _best_mm(model: MixedModel, deviations: Array, by_x: Array, by_pose: Array, *, known: bool) -> float:
    """RMS (mm) of points (m) by the best estimate; `deviations`: covariance of the flange's, seen (6 n), there (6 m).

    A pose as the pixels have it is off by the arm's deviation, scatter and pixel noise, and follows X, target and lens.
    """
    n, p = len(model.count), model.unknowns
    own = covariance_of(model.UU)
    follow = (own @ model.UAy[:, :, :p]).reshape(6 * n, p)
    levels = [REPEATABILITY.robot_rotation_rad, REPEATABILITY.robot_translation_mm]
    noise, pixel = np.zeros((n, 6, n, 6)), REPEATABILITY.image_px**2
    noise[range(n), :, range(n)] = pixel * own + np.diag(np.repeat(levels, 3) ** 2)
    weights = np.linalg.inv(deviations[: 6 * n, : 6 * n] + noise.reshape(6 * n, 6 * n))
    beside_poses = model.total[:p, :p] - np.einsum("nij,nik->jk", model.UAy[:, :, :p], own @ model.UAy[:, :, :p])
    prior = np.zeros(p)
    assert model.mixture is not None
    likeliest = model.mixture.information[np.argmax(model.mixture.log_weights)]
    prior[model.mixture_at :] = EXACT if known else likeliest
    covariance = covariance_of(follow.T @ weights @ follow + beside_poses / pixel + np.diag(prior))
    across = deviations[6 * n :, : 6 * n] @ weights
    of_unknowns = across @ follow @ covariance
    of_poses = deviations[6 * n :, 6 * n :] - across @ deviations[: 6 * n, 6 * n :] + of_unknowns @ (across @ follow).T
    m = len(by_x)
    poses = of_poses.reshape(m, 6, m, 6)[range(m), :, range(m)]
    with_x = -of_unknowns[:, :6].reshape(m, 6, 6)
    whole = np.concatenate(
        [
            np.concatenate([np.broadcast_to(covariance[:6, :6], poses.shape), np.swapaxes(with_x, 1, 2)], axis=2),
            np.concatenate([with_x, poses], axis=2),
        ],
        axis=1,
    )
    rows = np.concatenate([by_x, by_pose], axis=2)
    return float(np.sqrt(np.einsum("mij,mjk,mik->", rows, whole, rows, optimize=True) / m))


if __name__ == "__main__":
    main()
