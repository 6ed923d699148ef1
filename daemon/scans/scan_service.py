"""Scans of parts from several views. A scan is a folder of clouds with scan.json, as `handeyed register` reads it."""

import asyncio
import json
import logging
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.errors import CalibrationError
from calibration.kinematics.stance import Stance
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array
from daemon.cell.arm_in_cell import ArmInCell
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER, NamedScannerSettings
from daemon.errors import CalibrationUnusable, NoCalibration, NotFound, ScanEmpty, StorageError
from daemon.model.records import FlangePose, ScanRecord, ScanViewDocument, Unit
from daemon.model.requests import ArtefactRequest
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import Publish
from daemon.runtime.workers import Workers
from daemon.scans.registration_jobs import ProgressReports, RegistrationJobs, RegistrationRequest, StepEnd
from daemon.scans.scanner_acceptance import AcceptanceDocument, assess_clouds
from daemon.scans.upload import NPZ, PLY, SUFFIXES, receive_upload
from daemon.store.database import storage_errors
from daemon.store.store import Store
from drivers.interfaces import ScannedCloud
from registration.documents import RegistrationReportDocument
from registration.fusion.concatenation import PlacedCloud, merge_clouds
from registration.fusion.merging import EVERY_POINT, Box, Merge
from registration.fusion.view_surface import view_surface
from registration.io.convert import move_file
from registration.points.range_check import RangeCheck, range_of
from registration.points.rigid_motion import RigidMotion
from registration.scan import ScanView

TRANSIT_FOLDER = "passing"
"""A folder beside the scans for clouds that are transformed and not kept."""

log = logging.getLogger(__name__)

Found = TypeVar("Found")
ReportTask = asyncio.Task[RegistrationReportDocument]


MAX_RECENT_SCANS = 10
"""At most this many scans received a view at the moment when the daemon was killed."""


@dataclass(frozen=True)
class ScanService:
    store: Store
    workers: Workers
    merge_workers: Workers
    clock: Clock
    new_id: Callable[[Clock], str]
    scanners: Mapping[str, NamedScannerSettings]
    registration_jobs: RegistrationJobs
    publish: Publish
    arm: ArmInCell
    run_in_progress: Callable[[], bool]

    async def recover(self) -> None:
        """Remove partial files of a killed daemon, and update scan.json of the latest scans. Raises StorageError.

        A view may have been stored but not yet entered in scan.json. Partial files are never views.
        """
        await self.workers.run(_remove_partial_files, self.store.folder / "scans")
        for scan_id in await self.store.latest_scans_with_views(MAX_RECENT_SCANS):
            await self._update_document(scan_id)

    def settings_of(self, scanner: str) -> NamedScannerSettings | None:
        """The settings of a scanner by name; None in a cell without [scanner], for that one. Raises NotFound."""
        if scanner != MAIN_SCANNER and scanner not in self.scanners:
            fix = Sentence("choose-of-settings", names=list(self.scanners))
            raise NotFound(Sentence("no-such-scanner", name=scanner), fix)
        return self.scanners.get(scanner)

    def range_check(self, unit: Unit, scanner: str) -> RangeCheck:
        """Of one cloud of that scanner, by what is known of it and of the arm."""
        settings = self.scanners.get(scanner)
        return RangeCheck(unit, range_of(settings.range_mm if settings else None, self.arm.reach_mm))

    async def create(self, name: str, refine: bool = False, scanner: str = MAIN_SCANNER) -> ScanRecord:
        """Create an empty scan for clouds of that scanner. Raises StorageError."""
        scan = ScanRecord(self.new_id(self.clock), self.clock.timestamp(), name, refine, scanner)
        await self.store.save_scan(scan)
        return scan

    async def add_scanned_view(self, scan: ScanRecord, cloud: ScannedCloud, pose: FlangePose) -> ScanViewDocument:
        """Store a cloud of the daemon's scanner as the next view. Raises RegistrationError, StorageError."""

        async def whole() -> AsyncIterator[bytes]:
            yield cloud.content

        settings = self.settings_of(scan.scanner)
        unit: Unit = settings.unit if settings else "mm"
        return await self.add_view(scan.id, whole(), cloud.media_type, unit, pose, force=True)

    async def add_view(
        self,
        scan_id: str,
        body: AsyncIterator[bytes | memoryview],
        media_type: str,
        unit: Unit,
        pose: FlangePose,
        *,
        force: bool = False,
    ) -> ScanViewDocument:
        """Store a streamed cloud as the next view when complete; `force`: also one whose unit cannot be.

        Raises RegistrationError, NotFound, StorageError.
        """
        scan = await self.store.scan(scan_id)
        folder = self.store.scan_folder(scan_id)
        name = self.new_id(self.clock)
        check = None if force else self.range_check(unit, scan.scanner)
        async with receive_upload(body, folder, name, media_type, unit, self.workers, check) as upload:
            view = await self.store.add_scan_view(
                scan_id, upload.file, unit, pose, self.clock.timestamp(), points=upload.points
            )
        await self._update_document(scan_id)
        if scan.refine:
            await self._start_refinement(scan)
        return view

    async def transform_cloud(
        self,
        body: AsyncIterator[bytes | memoryview],
        media_type: str,
        unit: Unit,
        base_T_scanner: Array,
        check: RangeCheck | None,
    ) -> tuple[Path, int]:
        """Transform a cloud that cannot be streamed into base, in mm; returns file and number of points.

        The caller deletes the file. Raises RegistrationError, StorageError.
        """
        name, folder = self.new_id(self.clock), self.store.folder / "scans" / TRANSIT_FOLDER
        async with receive_upload(body, folder, name, media_type, unit, self.workers, check) as upload:
            suffix = SUFFIXES[PLY] if media_type == NPZ else upload.file.suffix  # NPZ is not written
            target = folder / f"merged-{name}{suffix}"
            motion = RigidMotion.of(base_T_scanner, unit)
            moved = await self.workers.run(partial(move_file, upload.file, target, motion, durable=False))
        return target, moved.points

    async def start_registration(self, scan_id: str, calibration: CalibrationInUse, refine: bool) -> ReportTask:
        """The registration job of a scan, in progress or done. Raises ScanEmpty, NotFound; the job: WorkersBusy."""
        return self.registration_jobs.start(await self._registration_request(scan_id, calibration, refine))

    async def clouds(
        self, scan_id: str, calibration: CalibrationInUse, report: RegistrationReportDocument | None = None
    ) -> list[PlacedCloud]:
        """Every view with its pose in base: from the robot, or from a report. Raises ScanEmpty, NotFound."""
        wanted = await self._registration_request(scan_id, calibration, refine=False)
        if report is not None:
            places = [view.base_T_camera.transform() for view in report.views]
        else:
            places = [view.base_T_flange @ wanted.flange_T_scanner for view in wanted.views]
        return [PlacedCloud(view.path, view.unit, place) for view, place in zip(wanted.views, places, strict=False)]

    async def merge_views(
        self,
        scan_id: str,
        clouds: list[PlacedCloud],
        calibration_id: str,
        suffix: str = ".ply",
        merge: Merge = EVERY_POINT,
        view: int | None = None,
    ) -> Path:
        """Merge the clouds into a new file in the base frame, which the caller deletes; cancelled, it leaves none.

        `view`: the only one whose cloud this is, for the events that say how far it is.

        Raises RegistrationError, WorkersBusy.
        """
        target = self.store.scan_folder(scan_id) / f"merged-{self.new_id(self.clock)}{suffix}"

        def merge_until_stopped(stopped: StepEnd, on_progress: ProgressReports) -> None:
            merge_clouds(clouds, target, calibration_id, merge, stopped, on_progress)
            if stopped():  # averaging and writing, the last step, is long: it rests after that, too
                target.unlink(missing_ok=True)

        try:
            await self._work_in_steps("merge", scan_id, view, merge_until_stopped)
        except asyncio.CancelledError:
            target.unlink(missing_ok=True)
            raise
        return target

    async def view_surface(
        self, scan_id: str, clouds: list[PlacedCloud], view: int, voxel_mm: float, box_mm: Box | None = None
    ) -> bytes:
        """One view's averaged points as records of `view_surface.SURFACE`. Raises RegistrationError, WorkersBusy."""
        job = partial(view_surface, clouds, view, voxel_mm, box_mm)
        return (await self._work_in_steps("surface", scan_id, view, job)).tobytes()

    async def _work_in_steps(
        self, work: str, scan_id: str, view: int | None, job: Callable[[StepEnd, ProgressReports], Found]
    ) -> Found:
        """Merge or draw one view or (None) all; publishes how far it is. Cancelled, it stops after a step.

        Raises WorkersBusy, and what `job` raises.
        """

        def publish(progress: float) -> None:
            about = {"scan_id": scan_id, "work": work, "view": view}
            self.publish("cloud", {**about, "progress": round(progress, 3)})

        stop, reports = threading.Event(), ProgressReports(publish, self.clock.monotonic_s)
        stopped = StepEnd(stop, self.run_in_progress, self.clock.monotonic_s)
        try:
            return await self.merge_workers.run_if_free(job, stopped, reports)
        except asyncio.CancelledError:
            stop.set()
            raise

    async def assess_scanner(self, scan_id: str, artefact: ArtefactRequest) -> AcceptanceDocument:
        """The scanner's errors from an artefact. Raises ScanEmpty, NotFound, RegistrationError, WorkersBusy."""
        folder = self.store.scan_folder(scan_id)
        clouds = [(folder / view.file, view.unit) for view in await self._views(scan_id)]
        return await self.merge_workers.run_if_free(assess_clouds, scan_id, clouds, artefact)

    async def _views(self, scan_id: str) -> list[ScanViewDocument]:
        """The views of a scan, at least one. Raises ScanEmpty, NotFound."""
        views = await self.store.scan_views(scan_id)
        if not views:
            await self.store.scan(scan_id)
            raise ScanEmpty(Sentence("scan-has-no-views", scan=scan_id), Sentence("send-views", scan=scan_id))
        return views

    async def _registration_request(
        self, scan_id: str, calibration: CalibrationInUse, refine: bool
    ) -> RegistrationRequest:
        """Raises ScanEmpty, NotFound, and as `CalibrationInUse.base_T_flange`."""
        rows = await self._views(scan_id)
        folder, stances = self.store.scan_folder(scan_id), [row.stance for row in rows]
        scanner = (await self.store.scan(scan_id)).scanner
        poses = await self.workers.run(calibration.base_T_flange, stances)
        views = [
            ScanView(folder / row.file, row.unit, Stance(pose), range_mm=self.range_check(row.unit, scanner).range_mm)
            for row, pose in zip(rows, poses, strict=True)
        ]
        flange_T_scanner = self.flange_T_scanner(calibration.document, scanner)
        findings = tuple(calibration.findings(stances))
        return RegistrationRequest(scan_id, views, calibration.document, flange_T_scanner, refine, findings)

    async def _start_refinement(self, scan: ScanRecord) -> None:
        """Start a refined registration with the active calibration; do nothing without one.

        The view that asks for it is stored: poses that are refused are only logged, and again by the scan's report.
        """
        try:
            settings = self.settings_of(scan.scanner)
            _, current = await self.store.current(settings.camera if settings else MAIN_CAMERA)
            if current.document.flange_T_camera is not None:
                errors = await self.store.arm(current.id)
                calibration = await self.workers.run(self.arm.in_use, current.document, errors)
                wanted = await self._registration_request(scan.id, calibration, refine=True)
                self.registration_jobs.start(wanted, only_if_free=False)
        except NoCalibration:
            return
        except (CalibrationError, CalibrationUnusable) as error:
            log.warning("scan %s is not refined: %s", scan.id, error)

    def base_T_scanner(self, calibration: CalibrationInUse, pose: FlangePose, scanner: str = MAIN_SCANNER) -> Array:
        """The scanner's pose (4, 4) in mm; one beside the robot stands wherever the flange is.

        Raises as `CalibrationInUse.base_T_flange`.
        """
        mount_T_scanner = self._mount_T_scanner(calibration.document, scanner)
        if calibration.document.setup == "eye-to-hand":
            return mount_T_scanner
        (base_T_flange,) = calibration.base_T_flange([pose.stance])
        placed: Array = base_T_flange @ mount_T_scanner
        return placed

    def flange_T_scanner(self, calibration: CalibrationDocument, scanner: str = MAIN_SCANNER) -> Array:
        """The pose (4, 4) of a scanner on the flange, mm. Raises CalibrationUnusable for one beside the robot."""
        if calibration.setup == "eye-to-hand":
            what = Sentence("camera-beside-robot", calibration=calibration.id)
            raise CalibrationUnusable(what, Sentence("register-single-clouds"))
        return self._mount_T_scanner(calibration, scanner)

    def _mount_T_scanner(self, calibration: CalibrationDocument, scanner: str) -> Array:
        """mount_T_camera (4, 4) in mm; times camera_T_scanner when the settings give one."""
        assert calibration.mount_T_camera is not None  # Operations.calibration refuses any other
        mount_T_camera = calibration.mount_T_camera.transform()
        settings = self.settings_of(scanner)
        if settings is None or settings.camera_T_scanner is None:
            return mount_T_camera
        return mount_T_camera @ settings.camera_T_scanner.transform()

    async def _update_document(self, scan_id: str) -> None:
        """Write scan.json; a StorageError is only logged, since the view itself is stored."""
        try:
            await self._write_document(scan_id)
        except StorageError as error:
            log.error("scan %s: scan.json could not be brought up to date: %s", scan_id, error)

    async def _write_document(self, scan_id: str) -> None:
        """Write scan.json from the rows of the store. Raises StorageError."""
        views: list[dict[str, Any]] = []
        for view in await self.store.scan_views(scan_id):
            found = {"cloud": view.file, "unit": view.unit, "base_T_flange": view.base_T_flange.model_dump(mode="json")}
            beside = {"joints_deg": view.joints_deg, "external_axes": view.external_axes}
            views.append({**found, **{name: values for name, values in beside.items() if values is not None}})
        scan = await self.store.scan(scan_id)
        source = f"scan {scan.id} {scan.name}".strip()
        document = {"schema_version": 1, "source": source, "setup": "eye-in-hand", "views": views}
        settings = self.scanners.get(scan.scanner)
        if settings is not None and settings.range_mm is not None:
            document["range_mm"] = settings.range_mm
        content = json.dumps(document, indent=1).encode()
        await self.store.write_file(self.store.scan_folder(scan_id) / "scan.json", [content])


def _remove_partial_files(scans: Path) -> None:
    with storage_errors(scans):
        for pattern in ("*/.*.upload*", "*/merged-*", "*/.merged-*.part"):
            for file in scans.glob(pattern):
                file.unlink(missing_ok=True)
