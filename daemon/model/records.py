"""The records of the store: runs, calibrations, scans."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from calibration.documents.calibration import CalibrationDocument, SentenceDocument
from calibration.documents.external_axis import external_axes_of
from calibration.documents.pose import PoseDocument, Vector
from calibration.kinematics.stance import Stance
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER
from daemon.model.run_states import FINAL_STATES, RunState
from drivers.interfaces import PoseReading

RunKind = Literal["calibration", "verify", "scan", "jog"]
Unit = Literal["mm", "m"]


@dataclass(frozen=True)
class CauseDocument:
    """Why a run failed or was aborted: a stable code, a sentence, and what to do; `details`: what these are made of."""

    code: str
    what: str
    fix: str
    details: dict[Literal["what", "fix"], SentenceDocument]

    @classmethod
    def because(cls, code: str, what: str, fix: str) -> "CauseDocument":
        """The cause that these two sentences say."""
        made, advice = SentenceDocument.each_of((what, fix))
        return cls(code, str(what), str(fix), {"what": made, "fix": advice})


@dataclass(frozen=True)
class TurnDocument:
    """A turn of the flange about one of its own axes."""

    turn_axis: Literal["x", "y", "z"]
    deg: float


@dataclass(frozen=True)
class ShiftDocument:
    """A shift of the flange along the base's axes."""

    shift_mm: Vector


@dataclass(frozen=True)
class PredictionDocument:
    """U (k = 2) at the worst of the points that matter after a station, and with the views planned then."""

    station: int
    at: str
    now_mm: float | None
    planned_mm: float | None


@dataclass(frozen=True)
class PlannedPoseDocument:
    """A planned pose; where the arm is known its axis angles, and base, shoulder, elbow, wrist and flange to draw."""

    base_T_flange: PoseDocument
    joints_deg: list[float] | None
    skeleton_mm: list[Vector] | None


@dataclass(frozen=True)
class GoalDocument:
    """What ends a planned run: so many views at the most, or one sigma or U of a measured point."""

    views: int
    uncertainty_mm: float | None
    tolerance_mm: float | None


@dataclass(frozen=True)
class Foreseen:
    """What a run that plans its views one after another predicts and advises.

    `now_mm`: U (k = 2) at the worst of the points that matter with the views so far, None before they determine X;
    `planned_mm`: the same after the next `ahead` planned views. `note`: what was assumed; `advice`: where the operator
    should jog to, in words, and `next_pose` the same as base_T_flange; `next_outline_px`: where the target's outline is
    in the picture then; `advice_steps`: the advice one by one. `history`: the predictions after each station.
    `planned_poses`: the poses planned, the next one first. `goal`: of the run.
    """

    now_mm: float | None = None
    planned_mm: float | None = None
    ahead: int = 0
    note: str = ""
    advice: str = ""
    next_pose: PoseDocument | None = None
    next_outline_px: list[tuple[float, float]] | None = None
    advice_steps: tuple[TurnDocument | ShiftDocument, ...] = ()
    history: tuple[PredictionDocument, ...] = ()
    planned_poses: tuple[PlannedPoseDocument, ...] = ()
    goal: GoalDocument | None = None


@dataclass(frozen=True)
class Planning(Foreseen):
    """Progress of such a run; `pictures`: how many are stored, the first look included."""

    pictures: int = 0

    def predicting(
        self, station: int, at: str, now_mm: float | None, planned_mm: float | None, ahead: int
    ) -> "Planning":
        """The planning after a station, which its history then has, too."""
        history = (*self.history, PredictionDocument(station, at, now_mm, planned_mm))
        return replace(self, now_mm=now_mm, planned_mm=planned_mm, ahead=ahead, history=history)


@dataclass(frozen=True)
class RunRecord:
    """One run. `station`: how many stations are captured; `result`: its result, whose keys depend on `kind`.

    `started_by`, `started_by_role`: the actor of its start; empty of runs from before these were stored.
    """

    id: str
    kind: RunKind
    state: RunState
    station: int
    stations: int
    created_at: str
    updated_at: str
    cause: CauseDocument | None = None
    request: dict[str, Any] = field(default_factory=dict)
    result: dict[str, Any] | None = None
    planning: Planning | None = None
    started_by: str = ""
    started_by_role: str = ""

    @property
    def is_over(self) -> bool:
        return self.state in FINAL_STATES

    @property
    def pictures(self) -> int:
        """The number of stored pictures: one per station, and the first look of an adaptive run."""
        return self.planning.pictures if self.planning else self.station


@dataclass(frozen=True)
class CalibrationOrigin:
    """The id of a calibration, the run it came from, when, and its verdict."""

    id: str
    run_id: str | None
    created_at: str
    accepted: bool


@dataclass(frozen=True)
class CalibrationRecord(CalibrationOrigin):
    """A calibration, and the name of the camera that it is of."""

    document: CalibrationDocument
    camera: str = MAIN_CAMERA


@dataclass(frozen=True)
class AppliedCalibration:
    """An entry of the history: a calibration that was activated.

    `role`: of who applied it; `despite_verdict`: it was not accepted, and `reason` says why it was applied. `sequence`
    is assigned by the store and counts from 1.
    """

    calibration_id: str
    applied_at: str
    applied_by: str
    sequence: int = field(default=0, compare=False)
    role: str = field(default="", compare=False)
    despite_verdict: bool = False
    reason: str = ""
    camera: str = MAIN_CAMERA


@dataclass(frozen=True)
class ScanRecord:
    """A scan of a part from several views; `refine`: views are registered to each other as they arrive.

    `scanner`: name of the scanner that its clouds are of.
    """

    id: str
    created_at: str
    name: str
    refine: bool = False
    scanner: str = MAIN_SCANNER


@dataclass(frozen=True)
class FlangePose:
    """Where the arm stands by its controller: base_T_flange, and its joints (6) in degrees where they are known.

    `external_axes`: the controller's axes beside it, mm or degrees, where it has any.
    """

    base_T_flange: PoseDocument
    joints_deg: tuple[float, ...] | None = None
    external_axes: tuple[float | None, ...] | None = None

    @classmethod
    def of(cls, reading: PoseReading) -> "FlangePose":
        joints = reading.joints_rad
        return cls(
            PoseDocument.of(reading.base_T_flange),
            None if joints is None else tuple(np.degrees(joints).tolist()),
            external_axes_of(reading.external_axes),
        )

    @property
    def stance(self) -> Stance:
        return Stance.of_degrees(self.base_T_flange.transform(), self.joints_deg, self.external_axes)


@dataclass(frozen=True, kw_only=True)
class ScanViewDocument(FlangePose):
    """One cloud of a scan. `joints_deg`: the arm's axes, null where the pose came without; `external_axes` likewise.

    `points`, with those that are not finite, and `bytes` of the file: null, and `created_by` empty, in views from
    before these were stored. `created_by`: the key's name, or who sent it without one.
    """

    view: int
    file: str
    unit: Unit
    created_at: str
    joints_deg: tuple[float, ...] | None = field()
    points: int | None = None
    bytes: int | None = None
    created_by: str = ""
