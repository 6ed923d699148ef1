"""The calibration run: view the target from every station, solve for X, store the calibration."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calibration.diagnosis.mount_check import ExpectedMount, mount_findings
from calibration.diagnosis.plausibility import leave_out_settled
from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.planning_settings import NoiseExpectedDocument
from calibration.errors import DocumentError
from calibration.kinematics.arm import Arm
from calibration.likelihood.mapped_points import at_points
from calibration.planning.expectation import NOTHING_EXPECTED, expectation_of
from calibration.planning.what_if import PlanComparison
from calibration.problem import Problem
from calibration.solution import Finding, NamedPoint
from calibration.verdict import DEFAULT_VERDICT_LIMITS, VerdictLimits, judge
from daemon.access.actor_names import AUTO_POLICY
from daemon.config.settings import MAIN_CAMERA
from daemon.errors import NoCalibration
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.model.requests import ObservationsRequest, SolveRequest
from daemon.runs.calibrations import result_of, why_not_applied
from daemon.runs.pose_sequence import PoseSequence
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.run_modules import load_run_modules
from daemon.runtime.clock import Clock
from daemon.runtime.version import SOFTWARE
from daemon.runtime.workers import Workers
from daemon.sessions.session_reader import load_problem, open_session, problem_without_files
from daemon.store.store import Store

MIN_VIEWS = 3
"""Two motions between three views are the fewest that determine X (paper, section 2)."""

Solved = tuple[CalibrationDocument, ArmErrorsDocument | None]

IdentifyArm = Callable[[Problem, str], tuple[ArmErrorsDocument | None, tuple[Finding, ...]]]
"""arm.json of a session, created at a time in UTC, or None where it is refused; with findings that say which."""

LoadIdentification = Callable[[Arm], IdentifyArm]
"""Imports what identifies the errors of an arm: before the first run that asks for them, not at the start."""


@dataclass(frozen=True)
class CalibrationRun:
    """The run without its poses. `apply_when_accepted`: the policy "auto".

    `better`: compares the poses with planned ones; None when they were planned. `expected`: the camera's expected pose.
    `limits`: of the verdict. `points`: where the uncertainty counts; the working volume without any.
    `load_identification`: of the arm's errors, where they are wanted. `camera`: name of the one that is calibrated.
    `noise`: as expected beside what is believed of the robot's, None where the views are of another program.
    """

    store: Store
    workers: Workers
    clock: Clock
    apply_when_accepted: bool
    better: PlanComparison | None = None
    expected: ExpectedMount | None = None
    limits: VerdictLimits = DEFAULT_VERDICT_LIMITS
    points: tuple[NamedPoint, ...] = ()
    load_identification: Callable[[], IdentifyArm] | None = None
    camera: str = MAIN_CAMERA
    noise: NoiseExpectedDocument | None = None

    async def drive(self, sequence: PoseSequence, log: RunLog) -> RunResult:
        """Run the sequence, solve, and store the calibration under the run's id."""
        await self.workers.run(load_run_modules)
        if self.load_identification is not None:
            await self.workers.run(self.load_identification)
        problem = await sequence.run(MIN_VIEWS)
        solved = await self.workers.run(self.solve, problem, log.id, self.clock.timestamp())
        log.conclude()
        return await self.keep(solved, log.id)

    async def keep(self, solved: Solved, run_id: str) -> dict[str, Any]:
        """Store a calibration, and apply it where the policy says so; returns the run's result. Raises StorageError."""
        current = await self._in_force()
        document = (await self.save(solved, run_id)).document
        applied, why_not = self.apply_when_accepted and document.verdict.accepted, None
        if applied and current is not None:
            why_not = await self.workers.run(why_not_applied, current, document)
            applied = why_not is None
        if applied:
            now = self.clock.timestamp()
            await self.store.apply(AppliedCalibration(document.id, now, AUTO_POLICY, camera=self.camera))
        return result_of(document, applied=applied, why_not=why_not)

    async def save(self, solved: Solved, run_id: str | None) -> CalibrationRecord:
        """Store a calibration, beside the U of the active one now. Raises StorageError."""
        document, arm = solved
        if (current := await self._in_force()) is not None:
            document = document.with_accuracy(before_mm=current.accuracy.expanded_mm)
        accepted = document.verdict.accepted
        record = CalibrationRecord(document.id, run_id, document.created_at, accepted, document, self.camera)
        await self.store.save_calibration(record, arm)
        return record

    async def _in_force(self) -> CalibrationDocument | None:
        try:
            return (await self.store.current(self.camera))[1].document
        except NoCalibration:
            return None

    def solve(self, problem: Problem, calibration_id: str, created_at: str, method: str = "auto") -> Solved:
        """Solve, judge and document, as `handeyed solve` does; with the arm's errors as `handeyed solve --arm`."""
        from calibration.solve import poses_at_zero, solve_hand_eye  # see run_modules

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
        if self.load_identification is not None and solution.mount_T_camera is not None:
            arm, found = self.load_identification()(problem, created_at)
            findings += found
        expected = NOTHING_EXPECTED
        if self.noise is not None:
            expected = expectation_of(problem, solution, self.noise.noise(problem.robot_noise), self.points)
        document = calibration_document(
            solution, replace(verdict, findings=findings), calibration_id=calibration_id, created_at=created_at,
            software=SOFTWARE, target=problem.target, expected=expected,
        )  # fmt: skip
        with_arm = CalibrationInUse.of(document, arm).document  # U is that of a point placed with the arm's errors
        return document.model_copy(update={"accuracy": with_arm.accuracy}), arm


def solve_without(
    folder: Path, request: SolveRequest, run: CalibrationRun, calibration_id: str, created_at: str
) -> Solved:
    """Solve the session in `folder` without some of its views. Raises DocumentError."""
    session = open_session(folder)
    problem, known = load_problem(session), session.document.known.replaced_by(request.known)
    views = tuple(view for view in problem.views if view.index not in request.without)
    problem = replace(problem, views=views, knowledge=known.knowledge())
    return run.solve(problem, calibration_id, created_at, request.method)


def solve_session_of(session: ObservationsRequest, run: CalibrationRun, calibration_id: str, created_at: str) -> Solved:
    """Solve a session that needs no file. Raises DocumentError."""
    if run.load_identification is not None and session.external_axis is not None:
        what = "an arm's errors are not found while an external axis moves"
        raise DocumentError.one("request body", "arm", what, "leave it out")
    if run.load_identification is not None and session.distances:
        what, fix = "they lead to other sessions, and a request holds one", "solve the folders by handeyed solve --arm"
        raise DocumentError.one("request body", "distances", what, fix)
    return run.solve(problem_without_files(session, "request body"), calibration_id, created_at)
