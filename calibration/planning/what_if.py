"""What better poses would have given: for a verdict on poses that somebody else chose."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene, predict
from calibration.planning.plan import PlanningError, plan_poses
from calibration.planning.reachability import reachable_by
from calibration.planning.scene_belief import LEAST_IMAGE_NOISE_PX, VIEWS_THAT_TELL_NOISE
from calibration.planning.viewpoints import Limits
from calibration.problem import Problem
from calibration.solution import Finding, Solution
from calibration.transforms import inverse, map_points

RESTARTS = 2
"""A comparison needs no better plan than a run makes at each step."""

WORTH_TELLING = 0.7
"""Planned poses that would leave this share of the uncertainty, or more, are no news."""

MOST_VIEWS = 5
"""Planned poses at most: more take long to plan, and the comparison is to show what their choice does."""

FURTHER, NEARER = 1.25, 0.8
"""Of the distances at which somebody else's poses are: as far and as near as planned ones may go."""

USUAL_TILT_RAD = float(np.radians(45.0))


@dataclass(frozen=True, eq=False)
class Alternative:
    """Within which limits, and under which noise, poses could have been planned instead."""

    limits: Limits
    noise: ExpectedNoise
    arm: Arm | None = None

    @classmethod
    def like(cls, problem: Problem, solution: Solution, stated: ExpectedNoise) -> "Alternative | None":
        """About as far from the target as these poses are, for sessions whose cell is not known; None without X.

        Under the noise that the session shows, the `stated` one where it is too short to show any.
        """
        if solution.mount_T_camera is None or solution.anchor_T_target is None:
            return None
        poses = np.array([problem.anchor_T_mount(view) for view in problem.views if view.detection is not None])
        camera_T_target = inverse(poses @ solution.mount_T_camera) @ solution.anchor_T_target
        centre = problem.target.points_mm.mean(axis=0, keepdims=True)
        distances = np.linalg.norm(map_points(camera_T_target, centre), axis=-1)
        nearest, furthest = float(NEARER * distances.min()), float(FURTHER * distances.max())
        return cls(Limits(USUAL_TILT_RAD, np.pi, (nearest, furthest)), _shown(solution) or stated)

    def findings(self, problem: Problem, solution: Solution) -> Iterator[Finding]:
        """At most one: both predicted under the same noise at the X and target that were found.

        As many planned poses as there are, five at most.
        """
        if solution.mount_T_camera is None or solution.anchor_T_target is None or solution.camera is None:
            return
        used = {view.index for view in solution.views if view.status != "rejected"}
        taken = np.array([view.base_T_flange for view in problem.views if view.index in used])
        if not len(taken):
            return
        scene = Scene(
            problem.setup, problem.target, solution.camera, solution.mount_T_camera, solution.anchor_T_target,
            self.noise, solution.camera_source == "estimated",
        )  # fmt: skip
        theirs, count = predict(scene, taken).point_mm, min(max(len(taken), 3), MOST_VIEWS)
        reachable = None if self.arm is None else reachable_by(self.arm)
        try:
            planned = plan_poses(scene, self.limits, count, reachable=reachable, restarts=RESTARTS).predicted.point_mm
        except PlanningError:
            return
        if not planned < WORTH_TELLING * theirs:
            return
        leave = f"these {len(taken)} leave {theirs:.2g} mm" if np.isfinite(theirs) else "these leave X open"
        yield Finding(
            "better-poses",
            "info",
            f"{count} planned poses would leave {planned:.2g} mm in a mapped point, {leave}",
            "let the poses be planned (handeyed plan, or a run without taught poses); or turn the flange further",
        )


def _shown(solution: Solution) -> ExpectedNoise | None:
    noise = solution.noise
    if solution.observability.views_used < VIEWS_THAT_TELL_NOISE:
        return None
    if noise.image_px is None or noise.robot_rotation_rad is None or noise.robot_translation_mm is None:
        return None
    return ExpectedNoise(
        max(noise.image_px, LEAST_IMAGE_NOISE_PX), noise.robot_rotation_rad, noise.robot_translation_mm
    )
