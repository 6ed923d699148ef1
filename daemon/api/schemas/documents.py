"""What the interface answers, as models. Lengths mm, angles deg, quaternions scalar first."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from daemon.model.records import Applied, CalibrationRecord, Planning, RunRecord, ScanRecord, ScanView
from daemon.model.run_states import RunState
from daemon.runs.run_log import predicted_in_words


class Answer(BaseModel):
    """Base: answers are written, never read back."""

    model_config = ConfigDict(frozen=True)


def example(**answer: Any) -> ConfigDict:
    """For `model_config`: shown in openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"


class CauseDocument(Answer):
    """Why a run ended badly, and how to go on."""

    code: str
    what: str
    fix: str


class PlanningDocument(Answer):
    """What a run that plans as it goes expects, one sigma of a mapped point.

    `now_mm`: from the views so far, null before they determine X; `planned_mm`: with the `ahead` views planned next.
    `advice`: what an operator should do before the next view of a manual run; `next_pose`: where that leads, if known.
    """

    now_mm: float | None
    planned_mm: float | None
    ahead: int
    predicted: str | None
    note: str
    advice: str
    next_pose: PoseDocument | None

    @classmethod
    def of(cls, planning: Planning) -> "PlanningDocument":
        return cls(
            now_mm=planning.now_mm, planned_mm=planning.planned_mm, ahead=planning.ahead,
            predicted=predicted_in_words(planning), note=planning.note, advice=planning.advice,
            next_pose=None if planning.next_pose is None else PoseDocument.model_validate(planning.next_pose),
        )  # fmt: skip


class RunDocument(Answer):
    """One run. `station` counts the stations captured so far; `result` depends on `kind`."""

    model_config = example(
        id=EXAMPLE_ID,
        kind="calibration",
        state="finished",
        over=True,
        station=3,
        stations=3,
        created_at=EXAMPLE_AT,
        updated_at=EXAMPLE_AT,
        cause=None,
        request={"count": 3},
        result={"calibration_id": EXAMPLE_ID, "accepted": True, "applied": False},
        planning=None,
        links={"self": f"/runs/{EXAMPLE_ID}", "calibration": f"/calibrations/{EXAMPLE_ID}"},
    )

    id: str
    kind: Literal["calibration", "verify", "scan"]
    state: RunState
    over: bool
    station: int
    stations: int
    created_at: str
    updated_at: str
    cause: CauseDocument | None
    request: dict[str, Any]
    result: dict[str, Any] | None
    planning: PlanningDocument | None
    links: dict[str, str]

    @classmethod
    def of(cls, run: RunRecord) -> "RunDocument":
        cause = None if run.cause is None else CauseDocument(**vars(run.cause))
        links = {"self": f"/runs/{run.id}"}
        if not run.over:
            links["abort"] = f"/runs/{run.id}/abort"
            if run.request.get("manual"):
                links |= {"stations": f"/runs/{run.id}/stations", "finish": f"/runs/{run.id}/finish"}
        for key, folder in (("calibration_id", "calibrations"), ("scan_id", "scans")):
            if run.result and key in run.result:
                links[key.removesuffix("_id")] = f"/{folder}/{run.result[key]}"
        if run.kind != "scan":
            links.update({f"frame {k}": f"/runs/{run.id}/frames/{k}" for k in range(run.pictures)})
        return cls(
            id=run.id, kind=run.kind, state=run.state, over=run.over, station=run.station, stations=run.stations,
            created_at=run.created_at, updated_at=run.updated_at, cause=cause, request=run.request, result=run.result,
            planning=None if run.planning is None else PlanningDocument.of(run.planning), links=links,
        )  # fmt: skip


class RunList(Answer):
    """The newest first; `next` asks for those before them."""

    runs: list[RunDocument]
    next: str | None


class CalibrationSummary(Answer):
    """One line of the list."""

    model_config = example(
        id=EXAMPLE_ID, run_id=EXAMPLE_ID, created_at=EXAMPLE_AT, accepted=True, current=True, point_mm=0.06
    )

    id: str
    run_id: str | None
    created_at: str
    accepted: bool
    current: bool
    point_mm: float | None

    @classmethod
    def of(cls, record: CalibrationRecord, current_id: str | None) -> "CalibrationSummary":
        uncertainty = record.document.uncertainty
        return cls(
            id=record.id, run_id=record.run_id, created_at=record.created_at, accepted=record.accepted,
            current=record.id == current_id, point_mm=uncertainty.point_mm if uncertainty else None,
        )  # fmt: skip


class AppliedDocument(Answer):
    """A calibration became current. `sequence` counts everything that was ever applied."""

    model_config = example(calibration_id=EXAMPLE_ID, applied_at=EXAMPLE_AT, applied_by="Ann", sequence=7)

    calibration_id: str
    applied_at: str
    applied_by: str
    sequence: int

    @classmethod
    def of(cls, applied: Applied) -> "AppliedDocument":
        return cls(**vars(applied))


class CalibrationList(Answer):
    """The newest first, and the last calibrations that were applied."""

    calibrations: list[CalibrationSummary]
    applied: list[AppliedDocument]
    next: str | None


class CurrentCalibration(Answer):
    """The calibration in force, since when and by whom."""

    applied: AppliedDocument
    calibration: CalibrationDocument


class CalibrateStatus(Answer):
    """Where calibration stands, and how to start."""

    current: CalibrationSummary | None
    applied: AppliedDocument | None
    in_progress: RunDocument | None
    last_run: RunDocument | None
    ready: bool
    reasons: list[str]
    policy: Literal["operator", "auto"]
    poses: str
    how_to_start: str


class ScanViewDocument(Answer):
    """One cloud of a scan."""

    view: int
    file: str
    unit: Literal["mm", "m"]
    base_T_flange: PoseDocument
    created_at: str

    @classmethod
    def of(cls, view: ScanView) -> "ScanViewDocument":
        return cls(**vars(view))


class ScanDocument(Answer):
    """A part looked at from several sides; `run` fills it when the daemon drives the scanner."""

    model_config = example(
        id=EXAMPLE_ID,
        name="door 4711",
        refine=False,
        created_at=EXAMPLE_AT,
        views=[],
        run=None,
        links={
            "self": f"/scans/{EXAMPLE_ID}",
            "views": f"/scans/{EXAMPLE_ID}/views",
            "cloud": f"/scans/{EXAMPLE_ID}/cloud",
        },
    )

    id: str
    name: str
    refine: bool
    created_at: str
    views: list[ScanViewDocument]
    run: RunDocument | None = None
    links: dict[str, str]

    @classmethod
    def of(cls, scan: ScanRecord, views: list[ScanView], run: RunRecord | None = None) -> "ScanDocument":
        links = {
            "self": f"/scans/{scan.id}",
            "views": f"/scans/{scan.id}/views",
            "cloud": f"/scans/{scan.id}/cloud",
            "report": f"/scans/{scan.id}/report",
        }
        return cls(
            id=scan.id, name=scan.name, refine=scan.refine, created_at=scan.created_at,
            views=[ScanViewDocument.of(view) for view in views],
            run=None if run is None else RunDocument.of(run), links=links,
        )  # fmt: skip


class RegistrationState(Answer):
    """A registration that is still in progress; `links.self` has it when it is done."""

    state: Literal["in progress"]
    links: dict[str, str]


class CloudDocument(Answer):
    """A small cloud, in the base frame."""

    frame: Literal["base"]
    unit: Literal["mm"]
    calibration_id: str
    points: list[tuple[float, float, float]]


class ScanList(Answer):
    """The newest first; `next` asks for those before them."""

    scans: list[ScanDocument]
    next: str | None


class RobotDocument(Answer):
    """Where the arm stands and what the controller says of itself."""

    connected: bool
    detail: str
    base_T_flange: PoseDocument
    configuration: tuple[int, int, int, int]
    joints_deg: list[float]
    still: bool
    motors_on: bool
    automatic: bool
    emergency_stop: bool
    moving: bool
    armed: bool
    program_running: bool
    speed_limited: bool
    held_by: str | None


class NewKeyDocument(Answer):
    """A key: it is shown this once."""

    key: str
    id: str
    name: str
    role: Literal["viewer", "operator", "admin"]
    expires_at: str | None


class AuditDocument(Answer):
    """Somebody did something. `hash` covers the row and the hash of the row before."""

    sequence: int
    at: str
    actor: str
    role: str
    action: str
    subject: str
    detail: dict[str, Any]
    hash: str


class AuditList(Answer):
    """The newest first; `next` asks for those before them."""

    rows: list[AuditDocument]
    next: str | None


class HealthDocument(Answer):
    """The daemon answers."""

    model_config = example(status="alive", software="handeyed 0.1.0", uptime_s=86400.0)

    status: Literal["alive"]
    software: str
    uptime_s: float


class Readiness(Answer):
    """Could this be done now, else why not."""

    model_config = example(ready=False, reasons=["robot: motors are off"])

    ready: bool
    reasons: list[str]


class ReadyDocument(Answer):
    """`ready` when something can be done now: calibrate or register."""

    ready: bool
    calibrate: Readiness
    register_: Readiness
    warnings: list[str]

    model_config = ConfigDict(frozen=True, serialize_by_alias=True, alias_generator=lambda name: name.rstrip("_"),
                              populate_by_name=True)  # fmt: skip


class Welcome(Answer):
    """What there is."""

    software: str
    links: dict[str, str]
