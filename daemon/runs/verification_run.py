"""The verification run: view the target again, and compute its points in base with the calibration in force."""

from dataclasses import dataclass, replace
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from calibration.monitoring.target_scatter import Verification, verify
from calibration.problem import Problem
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog
from daemon.runs.run_modules import load_run_modules
from daemon.runs.supervisor import RunResult
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
    """The run without its poses."""

    workers: Workers
    calibration: CalibrationDocument

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, and verify the calibration; see `document_of` for the result."""
        await self.workers.run(load_run_modules)
        problem = await sequence.run(MIN_VIEWS)
        found = await self.workers.run(_verify, problem, self.calibration)
        log.conclude()
        return E.SOLVED, {"calibration_id": self.calibration.id, "verification": document_of(found, self.calibration)}


def _verify(problem: Problem, calibration: CalibrationDocument) -> Verification:
    camera = problem.camera or (calibration.camera.camera() if calibration.camera else None)
    return verify(replace(problem, camera=camera), calibration)


def document_of(found: Verification, calibration: CalibrationDocument) -> dict[str, Any]:
    """The points in base and their standard deviations, rounded to 0.1 um (Tab. 1 of the paper)."""
    points, sigma = found.points_base_mm.round(4), found.sigma_per_point_mm.round(4)
    return {
        "calibration_id": calibration.id,
        "stations": list(found.stations),
        "points": [
            {"id": int(point), "base_mm": points[:, column].tolist(), "sigma_mm": sigma[column].tolist()}
            for column, point in enumerate(found.ids)
        ],
        "cross": found.ids[found.cross()].tolist(),
        "sigma_mm": found.sigma_mm.round(4).tolist(),
        "expected_point_mm": calibration.uncertainty.point_mm if calibration.uncertainty else None,
    }
