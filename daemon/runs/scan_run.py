"""The scan run: move the scanner through the poses, and store each cloud with its pose."""

from dataclasses import dataclass

from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.config.settings import TaughtPose
from daemon.model.records import FlangePose, ScanRecord
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import visit_poses
from daemon.runs.run_log import RunLog, RunResult
from daemon.scans.scan_service import ScanService
from drivers.interfaces import PoseReading


@dataclass(frozen=True)
class ScanRun:
    """The run without its poses."""

    cell: Cell
    scans: ScanService
    rules: MotionRules
    scan: ScanRecord

    async def drive(self, poses: tuple[TaughtPose, ...], log: RunLog) -> RunResult:
        """Take and store a cloud from each pose; the run ends with the last."""

        async def at_station(reading: PoseReading) -> None:
            cloud = await self.cell.capture_cloud(reading, self.scan.scanner)
            await self.scans.add_scanned_view(self.scan, cloud, FlangePose.of(reading))

        await visit_poses(poses, self.cell, self.rules, log, at_station, last=None)
        return E.ALL_STORED, {"scan_id": self.scan.id, "views": len(poses)}
