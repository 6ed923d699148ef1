"""The operations of the cell, called by the REST interface, the PLC gateway and the drift schedule."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

from calibration.documents.target import TargetDocument
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.planning.next_view import StoppingRule
from calibration.planning.what_if import PlanComparison
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.cell.held_button import HeldButton
from daemon.cell.motion_rules import MotionRules
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER, Settings, TaughtPose
from daemon.errors import (
    ArmUnknown,
    CellNotReady,
    NoCalibration,
    NoPoses,
    NotFound,
    NotHeld,
    NotInstalled,
    ToleranceLoosened,
)
from daemon.model.records import CalibrationRecord, FlangePose, RunKind, RunRecord, ScanRecord, ScanViewDocument
from daemon.model.requests import (
    CalibrateRequest,
    HoldRequest,
    JogRequest,
    ObservationsRequest,
    ScanRequest,
    SolveRequest,
    VerifyRequest,
)
from daemon.model.run_states import RunState
from daemon.runs.adaptive_sequence import AdaptiveSequence, Foresight, foresee, foresee_taught
from daemon.runs.calibration_run import CalibrationRun, IdentifyArm, LoadIdentification, solve_session_of, solve_without
from daemon.runs.calibrations import Calibrations, require_setup
from daemon.runs.jog import HeldMove, Jog, SmallMove
from daemon.runs.manual_sequence import ManualSequence
from daemon.runs.operator_requests import OperatorAction, OperatorRequestQueue
from daemon.runs.pose_selection import (
    SceneGuess,
    adaptive_parameters,
    complete_request,
    mount_expectation,
    planning_limits,
    require_planned_poses,
    select_taught_poses,
    stopping_rule,
)
from daemon.runs.pose_sequence import FixedSequence, visit_poses
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.run_sessions import Drive, MakeSequence, OpenBeside, RunSessions
from daemon.runs.supervisor import RunPlan, Supervisor
from daemon.runs.verification_run import VerificationRun, WithoutFirstView
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from daemon.scans.scan_service import ScanService
from daemon.store.actor import current_audit_context
from daemon.store.store import Store
from drivers.interfaces import PoseReading

VERIFY_POSITIONS = 3
"""As the seed's Tab. 1."""

DriveAll = Callable[[CalibrationRun], Drive]
ALONE: tuple[OpenBeside, DriveAll] = (lambda log: (), lambda run: run.drive)
"""A calibration run in which the camera has nothing beside it."""


async def nothing_learnt() -> NoiseBelief | None:
    """Of the robot's noise, before the first calibration."""
    return None


class FurtherSensors(Protocol):
    """Sensors on the camera's mount, by name: they look in its calibration runs, and are placed by what these find."""

    def join(self, request: CalibrateRequest, target: TargetDocument) -> tuple[OpenBeside, DriveAll]:
        """What opens the sessions of those that `request.together` names, and what makes the run that solves all.

        Raises NotFound, CalibrationUnusable; the first raises NoScanner.
        """
        ...

    async def base_T_sensor(self, name: str, base_T_flange: Array) -> tuple[str, Array]:
        """Id of what places the sensor of that name, and its pose (4, 4). Raises NotFound, StorageError."""
        ...


def no_further_sensors(operations: "Operations") -> FurtherSensors:
    """Without an extension for them. Raises NotFound."""
    what = "no extension is installed that solves several sensors together, and places them by name"
    raise NotFound(what, "leave together out, and give the scanner camera_T_scanner in the settings")


@dataclass(eq=False)
class Operations:
    """Starts runs, and takes views. Of its fields only `settings` is ever replaced, when they are reloaded.

    `camera`: whose calibration is active here; `settings` and `cell` are those of this camera; `others`: of all
    cameras by name. `learnt_noise`: what the cell has learnt of the robot's. `further_sensors`: those of an extension;
    `identification`: of an arm's errors, None where no extension has it.
    """

    settings: Settings
    cell: Cell
    store: Store
    supervisor: Supervisor
    workers: Workers
    scans: ScanService
    rules: MotionRules
    clock: Clock
    service_workers: Workers
    merge_workers: Workers
    camera: str = MAIN_CAMERA
    others: Mapping[str, "Operations"] = field(default_factory=dict)
    learnt_noise: Callable[[], Awaitable[NoiseBelief | None]] = nothing_learnt
    further_sensors: Callable[["Operations"], FurtherSensors] = no_further_sensors
    identification: LoadIdentification | None = None

    @property
    def calibrations(self) -> Calibrations:
        """What is stored, and what is active for this camera."""
        return Calibrations(self.store, self.clock, self.service_workers, self.cell.arm, self.camera)

    @property
    def sessions(self) -> RunSessions:
        known = self.settings.calibration.known
        return RunSessions(self.store, self.workers, self.settings.camera.setup, self.cell.arm, known)

    async def calibrate(self, request: CalibrateRequest) -> RunRecord:
        """Start a calibration run.

        Raises RunInProgress, CellNotReady, NoPoses, PoseRefused, ToleranceLoosened, ArmUnknown, NotInstalled,
        StorageError.
        """
        request = complete_request(self.settings, request)
        self._check_tolerance(request.tolerance_mm)
        self._load_identification(request.arm)
        settings, target = self.settings.calibration, request.target or self.settings.target
        joined = self.further_sensors(self).join(request, target) if request.together else None
        beside, drive_all = joined or ALONE
        lens, offset = self.settings.camera.intrinsics, request.axis_offset or settings.axis_offset
        belief = await self._noise_belief()
        sessions = self.sessions

        def plan(stations: int, sequence: MakeSequence, *, compared: bool) -> RunPlan:
            drive = drive_all(self.calibration_run(request, compared=compared))

            def begin(log: RunLog) -> Awaitable[RunResult]:
                session = sessions.open(
                    "calibration", log, target, lens, beside=beside(log), axis_offset=offset, robot_noise=belief
                )
                return drive(sequence(session, log), log)

            return RunPlan(stations, begin)

        async def prepare() -> RunPlan:
            obstacles = self.cell.capture_obstacles() if request.manual else await self.cell.obstacles()
            await self._check_ready((*obstacles, *self.cell.sensor_obstacles(request.together or ())))
            poses = () if request.manual else request.poses or select_taught_poses(settings, request.count)
            if poses:
                sequence = await self._fixed_sequence(poses)
                return plan(len(poses), sequence, compared=offset is None)
            if not request.manual:
                require_planned_poses(offset, self.rules)
            wish = stopping_rule(settings, request)
            count = wish.views_left
            points = self.settings.part.named_points()
            route = adaptive_parameters(settings, self.rules, target, await self._scene_guess(), wish, points, belief)
            if request.manual:
                requests = OperatorRequestQueue(settings.manual_wait_s)
                sequence = partial(ManualSequence, route, requests, self.cell, self.workers)
                by_hand = plan(count, sequence, compared=offset is None)
                return replace(by_hand, first_state=RunState.WAITING, requests=requests)
            await self._check_poses()
            return plan(count, partial(AdaptiveSequence, route, self.cell, self.workers), compared=False)

        return await self._start("calibration", request, prepare)

    async def foresee(self, request: CalibrateRequest, here: PoseReading, joints_rad: Array | None) -> Foresight:
        """What a calibration run would do from `here`, without moving anything.

        Raises RunInProgress, WorkersBusy, NoPoses, PoseRefused.
        """
        self.supervisor.require_free()
        settings, target = self.settings.calibration, request.target or self.settings.target
        joints = joints_rad if self.rules.arm else None
        poses = () if request.manual else request.poses or select_taught_poses(settings, request.count)
        if not (poses or request.manual):
            require_planned_poses(request.axis_offset or settings.axis_offset, self.rules)
        if poses:
            return await self.service_workers.run_if_free(foresee_taught, self.rules, poses, joints)
        wish, points = stopping_rule(settings, request), self.settings.part.named_points()
        belief = await self._noise_belief()
        route = adaptive_parameters(settings, self.rules, target, await self._scene_guess(), wish, points, belief)
        return await self.service_workers.run_if_free(foresee, route, here.base_T_flange, joints)

    async def solve_again(self, calibration_id: str, request: SolveRequest, new_id: str) -> CalibrationRecord:
        """Solve a calibration's session again, and store the result; nothing is applied.

        Raises NotFound, RunInProgress, WorkersBusy, DocumentError, StorageError.
        """
        self.supervisor.require_free()
        found = await self.store.calibration(calibration_id)
        if found.run_id is None:
            raise NotFound(f"calibration {calibration_id} comes from no run", "choose one with a run_id")
        run = await self.store.run(found.run_id)
        again = CalibrateRequest.model_validate(run.request)
        calibration = replace(self.calibration_run(again, compared=False), apply_when_accepted=False)
        solved = await self.merge_workers.run_if_free(
            solve_without,
            self.store.session_folder(run.id, found.camera),
            request,
            calibration,
            new_id,
            self.clock.timestamp(),
        )
        return await calibration.save(solved, run.id)

    async def solve_observations(self, session: ObservationsRequest, new_id: str) -> CalibrationRecord:
        """Solve views that another program has taken and measured, and store the result; nothing is applied.

        Raises RunInProgress, WorkersBusy, DocumentError, ArmUnknown, NotInstalled, StorageError.
        """
        load = self._load_identification(session.arm)
        self.supervisor.require_free()
        await self.store.require_ready()
        run = self.calibration_run(CalibrateRequest(), compared=False)
        run = replace(run, expected=None, load_identification=load, noise=None)
        solved = await self.merge_workers.run_if_free(solve_session_of, session, run, new_id, self.clock.timestamp())
        return await run.save(solved, None)

    async def submit_request(self, run_id: str, action: OperatorAction) -> RunRecord:
        """Take a view in a manual run, or end it; returns the run afterwards.

        Raises NotFound, RunOver, NotWaiting, CellBusy, NotStill, SamePose, TargetNotSeen, TooFewViews, DeviceError.
        """
        await (await self.supervisor.request_queue(run_id)).submit(action)
        return await self.supervisor.run(run_id)

    async def jog_in_run(self, run_id: str, request: JogRequest) -> RunRecord:
        """Jog the arm in a manual run, under that run's hold of the cell; returns the run afterwards.

        Raises NotFound, RunOver, NotWaiting, AbortHeld, CellBusy, CellNotReady, PoseRefused, NotStill, DeviceError.
        """
        requests = await self.supervisor.request_queue(run_id)
        self.supervisor.require_no_abort()
        await requests.submit("a jog", self._jog(request))
        return await self.supervisor.run(run_id)

    async def verify(self, request: VerifyRequest) -> RunRecord:
        """Start a verification run. Raises as `calibrate`, and NoCalibration."""
        self._check_tolerance(request.tolerance_mm)
        settings, target = self.settings.calibration, request.target or self.settings.target

        async def prepare() -> RunPlan:
            given = await self.calibrations.in_use(await self.calibrations.current())
            calibration = given.document
            require_setup(calibration, self.settings.camera.setup)
            await self._check_ready(await self.cell.obstacles())
            run = VerificationRun(self.workers, given, settings.verdict_limits(request.tolerance_mm))

            def plan(stations: int, sequence: MakeSequence) -> RunPlan:
                open_session = partial(self.sessions.open, "verify", target=target, camera=calibration.camera)
                return RunPlan(stations, lambda log: run.drive(sequence(open_session(log), log), log))

            poses = request.poses or select_taught_poses(settings, VERIFY_POSITIONS)
            if poses:
                return plan(len(poses), await self._fixed_sequence(poses))
            require_planned_poses(settings.axis_offset, self.rules)
            await self._check_poses()
            wish = StoppingRule(VERIFY_POSITIONS)
            known = SceneGuess.from_calibration(calibration)
            route = adaptive_parameters(settings, self.rules, target, known, wish)
            if (axis := calibration.external_axis) is not None:
                route = route.at_reading(axis, await self.cell.robot.read_pose())
            planned = partial(AdaptiveSequence, route, self.cell, self.workers)
            return plan(VERIFY_POSITIONS, lambda *of_run: WithoutFirstView(planned(*of_run)))

        return await self._start("verify", request, prepare)

    async def scan(self, request: ScanRequest) -> tuple[ScanRecord, RunRecord | None]:
        """Create a scan; with poses or `capture` start a scan run. Raises as `calibrate`, and NoScanner."""
        name = request.scanner or MAIN_SCANNER
        scanner = self.scans.settings_of(name)
        place = name if name == MAIN_SCANNER else f"scanners.{name}"
        if not request.capture and request.poses is None:
            return await self.scans.create(request.name, request.refine, name), None
        created: list[ScanRecord] = []

        async def prepare() -> RunPlan:
            await self._check_ready((*await self.cell.robot_obstacles(), *self.cell.sensor_obstacles((name,))))
            poses = request.poses or (scanner.poses if scanner else ())
            if not poses:
                raise NoPoses(Sentence("no-poses-given", place=place), Sentence("send-poses"))
            await self._check_poses(poses)
            created.append(await self.scans.create(request.name, request.refine, name))
            return RunPlan(len(poses), partial(self._fill_scan, created[0], poses))

        run = await self._start("scan", request, prepare)
        return created[0], run

    async def _fill_scan(self, scan: ScanRecord, poses: tuple[TaughtPose, ...], log: RunLog) -> RunResult:
        """Take and store a cloud from each pose."""

        async def at_station(reading: PoseReading) -> None:
            cloud = await self.cell.capture_cloud(reading, scan.scanner)
            await self.scans.add_scanned_view(scan, cloud, FlangePose.of(reading))

        await visit_poses(poses, self.cell, self.rules, log, at_station, last=None)
        return {"scan_id": scan.id, "views": len(poses)}

    async def jog(self, request: JogRequest) -> RunRecord:
        """Start one small move of the arm. Raises as `move_once`."""
        return await self.move_once(self._jog(request))

    def _jog(self, request: JogRequest) -> Jog:
        if request.hold is None:
            return Jog(self.cell, self.rules, request)
        return HeldMove(self.cell, self.rules, request, HeldButton(current_audit_context().audited_as))

    async def hold(self, run_id: str, request: HoldRequest) -> None:
        """The button of the motion in this run is held, or was let go. Raises NotHeld."""
        run, button = self.supervisor.in_progress, self.cell.buttons.get(request.hold)
        if button is None or run is None or run.id != run_id:
            raise NotHeld
        button.renew(current_audit_context().audited_as, request.at_s)
        if request.released:
            button.release()

    async def move_once(self, move: SmallMove) -> RunRecord:
        """Start a run of this move alone. Raises RunInProgress, CellNotReady, PoseRefused, DeviceError."""

        async def prepare() -> RunPlan:
            await self._check_ready(await self.cell.robot_obstacles())
            await move.goal()
            return RunPlan(0, move.drive)

        return await self._start("jog", move.request, prepare)

    async def scan_here(self, scan_id: str) -> ScanViewDocument:
        """Add a view with the daemon's scanner from here. Raises CellBusy, NoScanner, NotStill, DeviceError."""
        async with self.cell.hold(f"a scan of {scan_id}"):
            reading = await self.cell.read_settled_pose()
            scan = await self.store.scan(scan_id)
            cloud = await self.cell.capture_cloud(reading, scan.scanner)
            return await self.scans.add_scanned_view(scan, cloud, FlangePose.of(reading))

    async def _start(self, kind: RunKind, request: Any, prepare: Callable[[], Awaitable[RunPlan]]) -> RunRecord:
        self.supervisor.require_free()
        await self.store.require_ready()
        return await self.supervisor.start(kind, request.model_dump(mode="json", exclude_none=True), prepare)

    def _check_tolerance(self, tolerance_mm: float | None) -> None:
        settings = self.settings.calibration
        if tolerance_mm is not None and settings.forbids(tolerance_mm):
            raise ToleranceLoosened(tolerance_mm, settings.verdict_limits().tolerance_mm)

    def _load_identification(self, wanted: bool | None) -> Callable[[], IdentifyArm] | None:
        """Of the errors of the cell's arm, when they are wanted. Raises ArmUnknown, NotInstalled."""
        if not wanted:
            return None
        if not ((upright := self.rules.robot.stands_upright) and self.rules.arm):
            raise ArmUnknown(self.rules.seven.name if self.rules.seven else None, upright=upright)
        if self.identification is None:
            raise NotInstalled(Sentence("arm-identification-not-installed"), Sentence("leave-arm-out"))
        return partial(self.identification, self.rules.arm)

    async def _check_ready(self, reasons: tuple[str, ...]) -> None:
        if reasons:
            await self.cell.require_interlocks()
            raise CellNotReady(reasons)

    async def _noise_belief(self) -> NoiseBelief:
        """In the robot's noise: as stated, else as the cell has learnt it of the same arm and load."""
        stated, robot, load = self.settings.calibration.noise, self.settings.robot, self.cell.arm.conditions().load
        carried = "" if load is None else f"{load.mass_kg:g} kg"
        arm = ", ".join(part for part in (robot.model, self.settings.report.robot_serial, carried) if part)
        if stated.is_stated:
            return replace(stated.belief(), arm=arm)
        found = await self.learnt_noise()
        return replace(USUAL_BELIEF, arm=arm) if found is None or found.arm != arm else found.for_next_run()

    async def _scene_guess(self) -> SceneGuess:
        seen_by, stated = self.settings.camera, self.settings.calibration
        camera = seen_by.intrinsics.camera() if seen_by.intrinsics else None
        guesses = stated.mount_T_camera_guess(seen_by.setup), stated.anchor_T_target_guess(seen_by.setup)
        guess = SceneGuess(seen_by.setup, camera, *guesses)
        try:
            return guess.complete(await self.calibrations.current())
        except NoCalibration:
            return guess

    async def _check_poses(self, poses: tuple[TaughtPose, ...] = ()) -> None:
        """Check where the arm stands, and every move to and between the poses. Raises PoseRefused, DeviceError."""
        joints = await self.cell.robot.read_joints() if self.rules.arm else None
        await self.workers.run(self.rules.check_poses, poses, joints)

    async def _fixed_sequence(self, poses: tuple[TaughtPose, ...]) -> MakeSequence:
        await self._check_poses(poses)
        return partial(FixedSequence, poses, self.rules, self.cell)

    def calibration_run(self, request: CalibrateRequest, *, compared: bool) -> CalibrationRun:
        """`compared`: the verdict compares the poses with planned ones."""
        settings = self.settings.calibration
        limits, points = planning_limits(settings, self.rules), self.settings.part.named_points()
        better = PlanComparison(limits, settings.noise.noise(), self.rules.arm, points)
        auto, expected = settings.policy == "auto", mount_expectation(settings, self.settings.camera.setup)
        return CalibrationRun(
            self.store, self.workers, self.clock, auto, better if compared else None, expected,
            settings.verdict_limits(request.tolerance_mm), points,
            self._load_identification(request.arm), self.camera, settings.noise,
        )  # fmt: skip
