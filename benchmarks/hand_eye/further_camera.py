"""`python -m benchmarks.hand_eye.further_camera [--cells N] [--workers N]`

Whether U of a further camera holds whose intrinsics are estimated from pictures planned for the first one: its stations
see less of the target, off the middle. Mock cells by seed, poses of the planner for the first camera, the further one
35 mm and 29 degrees beside it, corners with 0.05 px. e: largest error of the 27 points of its working volume, in the
arm's millimetres; U (k = 2) at the worst of them.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from calibration.kinematics.stance import Stance
from calibration.problem import Detection, Problem, View
from calibration.solve import estimate_hand_eye
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.truth.truth import CellTruth
from tests.stories.plant import poses_taught_for

PIXELS = 0.05
MIN_POINTS = 12
"""Fewer in view are no detection."""


def session(truth: CellTruth, poses: list[Array], rng: np.random.Generator) -> Problem:
    """What the further camera sees of the target from poses that the robot reports."""
    views = []
    for index, reported in enumerate(poses):
        error = transform(
            rotation_from_vector(np.radians(truth.noise.robot_rotation_deg) * rng.standard_normal(3)),
            truth.noise.robot_translation_mm * rng.standard_normal(3),
        )
        seen = map_points(
            inverse(reported @ error @ truth.mount_T_camera) @ truth.anchor_T_target, truth.target.points_mm
        )
        pixels = truth.camera.project(seen)
        inside = np.flatnonzero(((pixels > 5) & (pixels < np.array(truth.camera.image_size) - 6)).all(axis=1))
        if len(inside) >= MIN_POINTS:
            noisy = pixels[inside] + PIXELS * rng.standard_normal((len(inside), 2))
            views.append(View(index, Stance(reported), Detection(inside, noisy)))
    return Problem("eye-in-hand", truth.target, None, truth.camera.image_size, tuple(views))


def judged(seed: int, name: str | None) -> tuple[int, int, float, float]:
    """Seed, views, e and U in mm of the further camera `name`, or of the first one."""
    cell = CellTruth.from_seed(seed).beside(("wrist",), ())
    truth = cell if name is None else cell.of_camera(name)
    poses = [pose.transform() for pose in poses_taught_for(seed)]
    problem = session(truth, poses, np.random.default_rng(seed))
    solution = estimate_hand_eye(problem)
    if solution.mount_T_camera is None or solution.uncertainty is None:
        return seed, len(problem.views), np.nan, np.nan
    points = np.array([point.camera_mm for point in solution.uncertainty.points])
    off = map_points(solution.mount_T_camera, points) - map_points(truth.mount_T_camera, points)
    return (
        seed,
        len(problem.views),
        float(np.linalg.norm(off, axis=1).max()),
        solution.uncertainty.worst_point.expanded_mm,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=30)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        for name, title in ((None, "the first camera"), ("wrist", "the further one")):
            rows = list(pool.map(partial(judged, name=name), range(1, given.cells + 1)))
            error, stated = np.array([row[2] for row in rows]), np.array([row[3] for row in rows])
            kept = np.isfinite(error)
            ratio = 2 * error[kept] / stated[kept]
            print(
                f"{title}: {kept.sum()} of {len(rows)} cells, e > U in {(ratio > 2).sum()}, 2e/U"
                f" {np.sqrt(np.mean(ratio**2)):.2f} RMS, {ratio.max():.2f} at most; e {np.median(error[kept]):.3f} mm,"
                f" U {np.median(stated[kept]):.3f} mm, medians; {min(row[1] for row in rows)} to"
                f" {max(row[1] for row in rows)} views"
            )


if __name__ == "__main__":
    main()
