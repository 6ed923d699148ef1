"""The verifications of the active calibration, each read from the store once, as entries of the chart."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from math import degrees, radians, sqrt
from typing import Any

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.kinematics.arm_errors import AXES
from calibration.monitoring.cell_change import SeenTarget, fit_poses
from calibration.monitoring.control_chart import ChartSample, sample_of
from calibration.targets import Target
from calibration.transforms import Array
from daemon.config.settings import CalibrationSettings
from daemon.model.records import AppliedCalibration, RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.workers import Workers
from daemon.store.store import Store

MAX_VERIFICATIONS = 1000
"""Length of the chart: a year of verifications every eight hours."""

MIN_POSE_POINTS = 4
"""Of the target, that give its pose well."""

PAGE_RUNS = 20
"""Runs are read in pages of 20 and not kept, because those of verifications are large."""


@dataclass(frozen=True, eq=False)
class ChartEntry:
    """One verification of the chart. `seen`: its stations, where their joints are known; the camera's temperature.

    `expanded_mm`: its U, twice the largest standard deviation of a point of the target.
    """

    run_id: str
    at: str
    sample: ChartSample
    seen: SeenTarget | None = None
    camera_temperature_c: float | None = None
    expanded_mm: float = 0.0


def belongs_to_chart(run: RunRecord, applied: AppliedCalibration, target_points: int) -> bool:
    """True for a finished verification of the active calibration with the fixed target and the settings' poses.

    One with its own poses or target is not comparable, nor one with points that the settings' target does not have.
    """
    return (
        run.kind == "verify"
        and run.state is RunState.FINISHED
        and run.result is not None
        and run.result["calibration_id"] == applied.calibration_id
        and not {"poses", "target"} & run.request.keys()
        and all(point["id"] < target_points for point in run.result["verification"]["points"])
    )


def chart_entry(run: RunRecord, target_points_mm: Array) -> ChartEntry:
    """The chart's entry of a run that `belongs_to_chart`."""
    assert run.result is not None
    verification: dict[str, Any] = run.result["verification"]
    points, frame = verification["points"], verification.get("frame", "base")
    ids = [point["id"] for point in points]
    anchor_mm = np.array([point[f"{frame}_mm"] for point in points]).transpose(1, 0, 2)
    sample = sample_of(anchor_mm, target_points_mm[ids], target_points_mm.mean(axis=0))
    seen = _seen(verification, anchor_mm, target_points_mm[ids])
    expanded_mm = verification.get("expanded_mm", 0.0)
    return ChartEntry(run.id, run.updated_at, sample, seen, verification.get("camera_temperature_c"), expanded_mm)


def _seen(verification: dict[str, Any], anchor_mm: Array, target_mm: Array) -> SeenTarget | None:
    joints = verification.get("joints_deg", [None])
    if any(one is None or len(one) != AXES for one in joints) or len(target_mm) < MIN_POSE_POINTS:
        return None
    poses = [PoseDocument.model_validate(pose).transform() for pose in verification["base_T_flange"]]
    return SeenTarget(np.radians(joints), np.array(poses), fit_poses(target_mm, anchor_mm))


def robot_noise_mm(document: CalibrationDocument, settings: CalibrationSettings) -> float:
    """The robot's position noise at the target, root sum of squares of three axes: as estimated, else as expected."""
    noise, expected = document.noise, settings.noise.noise()
    translation_mm = noise.robot_translation_mm or expected.robot_translation_mm
    rotation_deg = noise.robot_rotation_deg or degrees(expected.robot_rotation_rad)
    on_flange = document.flange_T_camera or document.flange_T_target
    assert on_flange is not None
    near, far = settings.limits.distance_mm
    from_flange_mm = (near + far) / 2 if document.setup == "eye-in-hand" else 0.0
    lever_mm = float(np.linalg.norm(on_flange.translation_mm)) + from_flange_mm
    return sqrt(3 * translation_mm**2 + 2 * (radians(rotation_deg) * lever_mm) ** 2)


@dataclass(frozen=True)
class _RunEntries:
    """The chart entries of one run: one, or none if it does not belong to the chart."""

    run_id: str
    over: bool
    entries: tuple[ChartEntry, ...]


@dataclass(eq=False)
class VerificationHistory:
    """The entries of the active calibration, read incrementally. `target`: of the settings."""

    store: Store
    workers: Workers
    target: Target
    _applied: tuple[int, str] = (0, "")
    _kept: list[ChartEntry] = field(default_factory=list)
    _last: str = ""
    """All runs up to this one are finished and their entries kept, or it was begun before the calibration's time."""

    async def of(self, applied: AppliedCalibration, calibration: CalibrationDocument) -> Sequence[ChartEntry]:
        """The entries of this calibration, oldest first. Raises StorageError."""
        if self._applied != (applied.sequence, applied.calibration_id):
            self._last, self._kept = await self.store.last_run_before(applied.sequence), []
            self._applied = (applied.sequence, applied.calibration_id)
        points_mm = calibration.scale_of(self.target) * self.target.points_mm
        news = await self._read_new_runs(applied, points_mm)
        settled = list(takewhile(lambda read: read.over, news))
        if settled:
            self._last = settled[-1].run_id
        self._kept = [*self._kept, *(entry for read in settled for entry in read.entries)][-MAX_VERIFICATIONS:]
        return [*self._kept, *(entry for read in news[len(settled) :] for entry in read.entries)]

    async def _read_new_runs(self, applied: AppliedCalibration, target_points_mm: Array) -> list[_RunEntries]:
        """The entries of runs after the last one kept, oldest first."""
        news: list[_RunEntries] = []
        before: str | None = None
        while sum(len(read.entries) for read in news) < MAX_VERIFICATIONS:
            page = await self.store.runs(PAGE_RUNS, before)
            fresh = list(takewhile(lambda run: run.id != self._last, page))
            news += await self.workers.run(_read_all, fresh, applied, target_points_mm)
            if len(fresh) < PAGE_RUNS:
                break
            before = page[-1].id
        return news[::-1]


def _read_all(runs: list[RunRecord], applied: AppliedCalibration, target_points_mm: Array) -> list[_RunEntries]:
    return [
        _RunEntries(
            run.id,
            run.is_over,
            (chart_entry(run, target_points_mm),) if belongs_to_chart(run, applied, len(target_points_mm)) else (),
        )
        for run in runs
    ]
