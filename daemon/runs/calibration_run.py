"""The calibration run: view the target from every station, solve for X, store the calibration."""

from dataclasses import dataclass, replace
from pathlib import Path

from calibration.diagnosis.mount_check import ExpectedMount, mount_findings
from calibration.diagnosis.plausibility import leave_out_settled
from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.errors import DocumentError, DocumentProblem
from calibration.kinematics.arm import Arm
from calibration.likelihood.mapped_points import NamedPoint, at_points
from calibration.planning.what_if import PlanComparison
from calibration.problem import Problem
from calibration.solution import Finding
from calibration.verdict import DEFAULT_VERDICT_LIMITS, VerdictLimits, judge
from daemon.access.actor_names import AUTO_POLICY
from daemon.config.settings import MAIN_CAMERA
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.model.requests import ObservationsRequest, SolveRequest
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog
from daemon.runs.run_modules import load_run_modules
from daemon.runs.supervisor import RunResult
from daemon.runtime.clock import Clock
from daemon.runtime.version import SOFTWARE
from daemon.runtime.workers import Workers
from daemon.sessions.session_reader import load_problem, open_session, problem_without_files
from daemon.store.store import Store

MIN_VIEWS = 3
"""Two motions between three views are the fewest that determine X (paper, section 2)."""


Solved = tuple[CalibrationDocument, ArmErrorsDocument | None]


@dataclass(frozen=True)
class CalibrationRun:
    """The run without its poses. `apply_when_accepted`: the policy "auto".

    `better`: compares the poses with planned ones; None when they were planned. `expected`: the camera's expected pose.
    `limits`: of the verdict. `points`: where the uncertainty counts; the working volume without any. `arm`: its errors
    are identified, too. `camera`: name of the one that is calibrated.
    """

    store: Store
    workers: Workers
    clock: Clock
    apply_when_accepted: bool
    better: PlanComparison | None = None
    expected: ExpectedMount | None = None
    limits: VerdictLimits = DEFAULT_VERDICT_LIMITS
    points: tuple[NamedPoint, ...] = ()
    arm: Arm | None = None
    camera: str = MAIN_CAMERA

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, solve, and store the calibration under the run's id."""
        await self.workers.run(load_run_modules)
        problem = await sequence.run(MIN_VIEWS)
        document, arm = await self.workers.run(self.solve, problem, log.id, self.clock.timestamp())
        log.conclude()
        applied = await self.keep(document, arm, log.id)
        return E.SOLVED, {
            "calibration_id": document.id, "accepted": document.verdict.accepted, "applied": applied
        }  # fmt: skip

    async def keep(self, document: CalibrationDocument, arm: ArmErrorsDocument | None, run_id: str) -> bool:
        """Store a calibration, and apply it where the policy says so; returns whether it did. Raises StorageError."""
        accepted = document.verdict.accepted
        await self.store.save_calibration(
            CalibrationRecord(document.id, run_id, document.created_at, accepted, document, self.camera), arm
        )
        if not (self.apply_when_accepted and accepted):
            return False
        await self.store.apply(AppliedCalibration(document.id, self.clock.timestamp(), AUTO_POLICY, camera=self.camera))
        return True

    def solve(self, problem: Problem, calibration_id: str, created_at: str, method: str = "auto") -> Solved:
        """Solve, judge and document, as `handeyed solve` does; with the arm's errors as `handeyed solve --arm`."""
        from calibration.documents.identified_arm import identify_with_findings  # see run_modules
        from calibration.solve import poses_at_zero, solve_hand_eye

        first = solve_hand_eye(problem, method)
        problem = poses_at_zero(problem, first)
        solution = at_points(problem, first, self.points)
        elsewhere: tuple[Finding, ...] = ()
        if self.expected is not None and solution.mount_T_camera is not None:
            elsewhere = mount_findings(solution.mount_T_camera, self.expected)
            solution = solution if elsewhere else leave_out_settled(solution)
        verdict = judge(problem, solution, self.limits)
        findings = verdict.findings + elsewhere
        if self.better is not None:
            findings += tuple(self.better.findings(problem, solution))
        arm = None
        if self.arm is not None and solution.mount_T_camera is not None:
            arm, found = identify_with_findings(self.arm, problem, created_at=created_at, software=SOFTWARE)
            findings += found
        document = calibration_document(
            solution, replace(verdict, findings=findings), calibration_id=calibration_id, created_at=created_at,
            software=SOFTWARE,
        )  # fmt: skip
        return document, arm


def solve_without(
    folder: Path, request: SolveRequest, run: CalibrationRun, calibration_id: str, created_at: str
) -> Solved:
    """Solve the session in `folder` without some of its views. Raises DocumentError."""
    problem = load_problem(open_session(folder))
    views = tuple(view for view in problem.views if view.index not in request.without)
    return run.solve(replace(problem, views=views), calibration_id, created_at, request.method)


def solve_session_of(session: ObservationsRequest, run: CalibrationRun, calibration_id: str, created_at: str) -> Solved:
    """Solve a session that needs no file. Raises DocumentError."""
    if run.arm is not None and session.external_axis is not None:
        what = "an arm's errors are not found while an external axis moves"
        raise DocumentError("request body", [DocumentProblem("arm", what, "leave it out")])
    if run.arm is not None and session.distances:
        what, fix = "they lead to other sessions, and a request holds one", "solve the folders by handeyed solve --arm"
        raise DocumentError("request body", [DocumentProblem("distances", what, fix)])
    return run.solve(problem_without_files(session, "request body"), calibration_id, created_at)
