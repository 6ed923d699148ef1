"""The verification run: view the target again, and compute its points with the active calibration."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_in_use import AS_BUILT, CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.monitoring.target_scatter import Verification, verify
from calibration.problem import Problem
from calibration.solution import COVERAGE_FACTOR
from calibration.verdict import VerdictLimits
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.run_modules import load_run_modules
from daemon.runtime.workers import Workers

MIN_VIEWS = 2
"""The smallest number with a standard deviation."""


@dataclass(frozen=True)
class WithoutFirstView:
    """A sequence without its first view, which was taken where the arm stood, for planning only."""

    sequence: PoseSequence

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence; the remaining views are numbered from 0."""
        problem = await self.sequence.run(min_views + 1)
        views = tuple(replace(view, index=view.index - 1) for view in problem.views[1:])
        return replace(problem, views=views)


@dataclass(frozen=True)
class VerificationRun:
    """The run without its poses. `given`: what is verified. `limits`: their tolerance, of U, see `VerifyRequest`."""

    workers: Workers
    given: CalibrationInUse
    limits: VerdictLimits

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, and verify the calibration; see `document_of` for the result."""
        await self.workers.run(load_run_modules)
        problem = await sequence.run(MIN_VIEWS)
        found = await self.workers.run(_verify, problem, self.given)
        log.conclude()
        calibration = self.given.document
        document = document_of(found, calibration, self.limits)
        known_c = [view.camera_temperature_c for view in problem.views if view.camera_temperature_c is not None]
        if known_c:
            document["camera_temperature_c"] = round(float(np.mean(known_c)), 2)
        if self.given.arm is not None:
            document["arm"] = AS_BUILT
        return {"calibration_id": calibration.id, "verification": document}


def _verify(problem: Problem, given: CalibrationInUse) -> Verification:
    """Raises VerificationError, and as `CalibrationInUse.base_T_flange`."""
    calibration, problem = given.document, given.correct(problem)
    camera = calibration.camera.camera() if calibration.camera else problem.camera
    return verify(replace(problem, camera=camera), calibration)


def document_of(found: Verification, calibration: CalibrationDocument, limits: VerdictLimits) -> dict[str, Any]:
    """The points in `frame` and their standard deviations, rounded to 0.1 um (Tab. 1 of the paper).

    `frame`: base, or flange when the target is on the flange and the camera beside the robot. `base_T_flange`,
    `joints_deg`: where the robot was at each station.

    `expanded_mm`: twice the largest standard deviation; `within_tolerance` when it and the calibration's U at the worst
    of the points that matter are.
    """
    points, sigma = found.points_mm.round(4), found.sigma_per_point_mm.round(4)
    expanded_mm = float(COVERAGE_FACTOR * sigma.max())
    worst_mm = calibration.accuracy.expanded_mm
    return {
        "calibration_id": calibration.id,
        "stations": list(found.stations),
        "frame": found.frame,
        "joints_deg": [None if one is None else np.degrees(one).round(6).tolist() for one in found.joints_rad],
        "base_T_flange": [PoseDocument.of(pose).model_dump(mode="json") for pose in found.base_T_flange],
        "points": [
            {"id": int(point), f"{found.frame}_mm": points[:, column].tolist(), "sigma_mm": sigma[column].tolist()}
            for column, point in enumerate(found.ids)
        ],
        "cross": found.ids[found.cross()].tolist(),
        "sigma_mm": found.sigma_mm.round(4).tolist(),
        "expanded_mm": expanded_mm,
        "worst_expanded_mm": worst_mm,
        "tolerance_mm": limits.tolerance_mm,
        "tolerance_stated": limits.tolerance_stated,
        "within_tolerance": max(expanded_mm, worst_mm or 0.0) <= limits.tolerance_mm,
        "expected_point_mm": calibration.uncertainty.point_mm if calibration.uncertainty else None,
    }
