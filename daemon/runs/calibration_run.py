"""The calibration run: view the target from every station, solve for X, store the calibration."""

from dataclasses import dataclass, replace

from calibration.diagnosis.mount_check import ExpectedMount, mount_findings
from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.planning.what_if import PlanComparison
from calibration.problem import Problem
from calibration.verdict import judge
from daemon.access.actor_names import AUTO_POLICY
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog
from daemon.runs.run_modules import load_run_modules
from daemon.runs.supervisor import RunResult
from daemon.runtime.clock import Clock
from daemon.runtime.version import SOFTWARE
from daemon.runtime.workers import Workers
from daemon.store.store import Store

MIN_VIEWS = 3
"""Two motions between three views are the fewest that determine X (paper, section 2)."""


@dataclass(frozen=True)
class CalibrationRun:
    """The run without its poses. `apply_when_accepted`: the policy "auto".

    `better`: compares the poses with planned ones; None when they were planned. `expected`: the camera's expected pose.
    """

    store: Store
    workers: Workers
    clock: Clock
    apply_when_accepted: bool
    better: PlanComparison | None = None
    expected: ExpectedMount | None = None

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, solve, and store the calibration under the run's id."""
        await self.workers.run(load_run_modules)
        problem = await sequence.run(MIN_VIEWS)
        document = await self.workers.run(
            solve_calibration, problem, log.id, self.clock.timestamp(), self.better, self.expected
        )
        log.conclude()
        applied = await self._keep(document, log.id)
        return E.SOLVED, {
            "calibration_id": document.id, "accepted": document.verdict.accepted, "applied": applied
        }  # fmt: skip

    async def _keep(self, document: CalibrationDocument, run_id: str) -> bool:
        accepted = document.verdict.accepted
        await self.store.save_calibration(
            CalibrationRecord(document.id, run_id, document.created_at, accepted, document)
        )
        if not (self.apply_when_accepted and accepted):
            return False
        await self.store.apply(AppliedCalibration(document.id, self.clock.timestamp(), AUTO_POLICY))
        return True


def solve_calibration(
    problem: Problem,
    calibration_id: str,
    created_at: str,
    better: PlanComparison | None = None,
    expected: ExpectedMount | None = None,
) -> CalibrationDocument:
    """Solve, judge and document, as `handeyed solve` does; see CalibrationRun for `better` and `expected`."""
    from calibration.solve import solve_hand_eye  # see run_modules

    solution = solve_hand_eye(problem)
    verdict = judge(problem, solution)
    if expected is not None and solution.mount_T_camera is not None:
        verdict = replace(verdict, findings=(*verdict.findings, *mount_findings(solution.mount_T_camera, expected)))
    if better is not None:
        verdict = replace(verdict, findings=(*verdict.findings, *better.findings(problem, solution)))
    return calibration_document(
        solution, verdict, calibration_id=calibration_id, created_at=created_at, software=SOFTWARE
    )
