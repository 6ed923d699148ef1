"""Comparison of given poses with planned ones, as a finding of the verdict."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene, predict
from calibration.planning.plan import PlanningError, plan_poses
from calibration.planning.reachability import reachable_by
from calibration.planning.scene_belief import expected_noise
from calibration.planning.viewpoints import ViewpointLimits
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, NamedPoint, Solution, used_views
from calibration.transforms import inverse, map_points

RESTARTS = 2
"""Restarts of the search; as few as in a run."""

MAX_REPORTED_SHARE = 0.7
"""The finding is given only when planned poses leave less than this share of the uncertainty."""

MAX_VIEWS = 5
"""Most poses planned for the comparison; more take long."""

MAX_DISTANCE_FACTOR, MIN_DISTANCE_FACTOR = 1.25, 0.8
"""Bounds of the planned distances, over the largest and the smallest distance of the given poses."""

DEFAULT_TILT_RAD = float(np.radians(45.0))


@dataclass(frozen=True, eq=False)
class PlanComparison:
    """The conditions of the comparison: limits, noise, the arm where it is known, and the points that matter."""

    limits: ViewpointLimits
    noise: ExpectedNoise
    arm: Arm | None = None
    points: tuple[NamedPoint, ...] = ()

    @classmethod
    def for_session(
        cls, problem: Problem, solution: Solution, stated: ExpectedNoise, points: tuple[NamedPoint, ...] = ()
    ) -> "PlanComparison | None":
        """Conditions like those of a session, for cells that are not known; None without X or without images, and
        for an arm that cannot turn as planned poses do.

        About the session's distances from the target, and the noise estimated from it, or the `stated` one where it
        has too few views.
        """
        if solution.mount_T_camera is None or solution.anchor_T_target is None or problem.in_space:
            return None
        if problem.axis_offset is not None:
            return None
        poses = np.array([problem.anchor_T_mount(view) for view in problem.views if view.detection is not None])
        camera_T_target = inverse(poses @ solution.mount_T_camera) @ solution.anchor_T_target
        centre = problem.target.points_mm.mean(axis=0, keepdims=True)
        distances = np.linalg.norm(map_points(camera_T_target, centre), axis=-1)
        nearest, furthest = float(MIN_DISTANCE_FACTOR * distances.min()), float(MAX_DISTANCE_FACTOR * distances.max())
        limits = ViewpointLimits(DEFAULT_TILT_RAD, np.pi, (nearest, furthest))
        return cls(limits, expected_noise(solution) or stated, points=points)

    def findings(self, problem: Problem, solution: Solution) -> Iterator[Finding]:
        """At most one finding, `better-poses`: both U (k = 2) at the worst of the points that matter are predicted at
        the same noise, X and target.

        As many poses are planned as were taken, MAX_VIEWS at most.
        """
        if solution.mount_T_camera is None or solution.anchor_T_target is None or solution.camera is None:
            return
        taken = np.array([view.base_T_flange for view in used_views(problem, solution)])
        if not len(taken):
            return
        scene = Scene(
            problem.setup, problem.target, solution.camera, solution.mount_T_camera, solution.anchor_T_target,
            self.noise, problem.camera is None, self.points, problem.knowledge,
        )  # fmt: skip
        theirs, count = predict(scene, taken).expanded_mm, min(max(len(taken), 3), MAX_VIEWS)
        reachable = None if self.arm is None else reachable_by(self.arm)
        try:
            planned = plan_poses(
                scene, self.limits, count, reachable=reachable, restarts=RESTARTS
            ).predicted.expanded_mm
        except PlanningError:
            return
        if planned is None or (theirs is not None and planned >= MAX_REPORTED_SHARE * theirs):
            return
        would = {"poses": count, "planned_mm": planned}
        message = (
            Sentence("better-poses-open", **would)
            if theirs is None
            else Sentence("better-poses", **would, taken=len(taken), taken_mm=theirs)
        )
        yield Finding("better-poses", "info", message, Sentence("let-poses-be-planned"))
