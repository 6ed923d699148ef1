"""The records of the store: runs, calibrations, scans."""

import json
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter

from calibration.documents.calibration import CalibrationDocument, SentenceDocument
from calibration.documents.external_axis import external_axes_of
from calibration.documents.pose import PoseDocument
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
class Planning:
    """Progress of a run that plans its views one after another.

    `now_mm`: U (k = 2) at the worst of the points that matter with the views so far, None before they determine X;
    `planned_mm`: the same after the next `ahead` planned views. `pictures` includes the first look. `note`: what was
    assumed; `advice`: where the operator should jog to, in words, and `next_pose` the same as base_T_flange;
    `next_outline_px`: where the target's outline is in the picture then; `advice_steps`: the advice one by one.
    `history`: `now_mm`, `planned_mm` after each station. `planned_poses`: the poses planned, the next one first.
    `goal`: of the run.
    """

    now_mm: float | None = None
    planned_mm: float | None = None
    ahead: int = 0
    pictures: int = 0
    note: str = ""
    advice: str = ""
    next_pose: dict[str, Any] | None = None
    next_outline_px: list[list[float]] | None = None
    advice_steps: tuple[dict[str, Any], ...] = ()
    history: tuple[dict[str, Any], ...] = ()
    planned_poses: tuple[dict[str, Any], ...] = ()
    goal: dict[str, Any] | None = None

    def predicting(
        self, station: int, at: str, now_mm: float | None, planned_mm: float | None, ahead: int
    ) -> "Planning":
        """The planning after a station, which its history then has, too."""
        row = {"station": station, "at": at, "now_mm": now_mm, "planned_mm": planned_mm}
        return replace(self, now_mm=now_mm, planned_mm=planned_mm, ahead=ahead, history=(*self.history, row))


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
    def over(self) -> bool:
        return self.state in FINAL_STATES

    @property
    def pictures(self) -> int:
        """The number of stored pictures: one per station, and the first look of an adaptive run."""
        return self.planning.pictures if self.planning else self.station

    def row(self) -> tuple[Any, ...]:
        """The values in the order of the table's columns."""
        cause = None if self.cause is None else _CAUSE.dump_json(self.cause).decode()
        result = None if self.result is None else json.dumps(self.result)
        return (self.id, self.kind, str(self.state), self.station, self.stations, cause, self.created_at,
                self.updated_at, json.dumps(self.request), result,
                self.planning and json.dumps(asdict(self.planning)), self.started_by, self.started_by_role)  # fmt: skip

    @classmethod
    def of(cls, row: tuple[Any, ...]) -> "RunRecord":
        """The record of a row. Raises ValueError, TypeError for one that is not what was stored."""
        run_id, kind, state, station, stations, cause, created_at, updated_at, request, result, planning, *starter = row
        asked, found = json.loads(request), None if result is None else json.loads(result)
        if not (isinstance(asked, dict) and isinstance(found, dict | None)):
            raise ValueError("request or result is no JSON object")
        why = None if cause is None else _CAUSE.validate_json(cause)
        return cls(run_id, kind, RunState(state), station, stations, created_at, updated_at, why,
                   asked, found, planning and Planning(**json.loads(planning)), *starter)  # fmt: skip


_CAUSE = TypeAdapter(CauseDocument)


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

    @classmethod
    def of(cls, row: tuple[Any, ...]) -> "AppliedCalibration":
        """The entry of a row of the table; a damaged store of an older version has fewer columns."""
        sequence, calibration_id, applied_at, applied_by, *rest = row
        defaults: tuple[Any, ...] = ("", 0, "", MAIN_CAMERA)
        role, despite_verdict, reason, camera = (*rest, *defaults[len(rest) :])
        return cls(calibration_id, applied_at, applied_by, sequence, role, bool(despite_verdict), reason, camera)


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


@dataclass(frozen=True)
class ScanViewDocument:
    """One cloud of a scan. `joints_deg`: the arm's axes, null where the pose came without; `external_axes` likewise.

    `points`, with those that are not finite, and `bytes` of the file: null, and `created_by` empty, in views from
    before these were stored. `created_by`: the key's name, or who sent it without one.
    """

    view: int
    file: str
    unit: Unit
    base_T_flange: PoseDocument
    created_at: str
    joints_deg: tuple[float, ...] | None
    external_axes: tuple[float | None, ...] | None = None
    points: int | None = None
    bytes: int | None = None
    created_by: str = ""

    @property
    def pose(self) -> FlangePose:
        return FlangePose(self.base_T_flange, self.joints_deg, self.external_axes)
