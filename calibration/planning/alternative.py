"""What better poses would have given: for a verdict on poses that somebody else chose."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.arm import Arm
from calibration.planning.plan import PlanningError, plan_poses
from calibration.planning.reach import reachable_by
from calibration.planning.viewpoints import Limits
from calibration.prediction import ExpectedNoise, Scene, predict
from calibration.problem import Problem
from calibration.solution import Finding, Solution

RESTARTS = 2
"""A comparison needs no better plan than a run makes at each step."""

WORTH_TELLING = 0.7
"""Planned poses that would leave this share of the uncertainty, or more, are no news."""

PLANNED_VIEWS = 3
"""Few, so that the comparison says what the choice of poses does and not their number."""


@dataclass(frozen=True, eq=False)
class Alternative:
    """Within which limits, and under which noise, poses could have been planned instead."""

    limits: Limits
    noise: ExpectedNoise
    arm: Arm | None = None

    def findings(self, problem: Problem, solution: Solution) -> Iterator[Finding]:
        """At most one: both predicted under the same noise at the X and target that were found."""
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
        theirs = predict(scene, taken).point_mm
        reachable = None if self.arm is None else reachable_by(self.arm)
        try:
            planned = plan_poses(
                scene, self.limits, PLANNED_VIEWS, reachable=reachable, restarts=RESTARTS
            ).predicted.point_mm
        except PlanningError:
            return
        if not planned < WORTH_TELLING * theirs:
            return
        leave = f"these leave {theirs:.2g} mm" if np.isfinite(theirs) else "these leave X open"
        yield Finding(
            "better-poses",
            "info",
            f"three planned poses would leave {planned:.2g} mm in a mapped point, {leave}",
            "let the poses be planned: send none with the request and teach none; or turn the flange further",
        )
