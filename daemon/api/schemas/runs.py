"""Schemas of runs."""

from typing import Any, Literal

from calibration.documents.pose import PoseDocument, Vector
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, example
from daemon.model.records import CauseDocument, Planning, RunKind, RunRecord
from daemon.model.run_states import RunState
from daemon.runs.run_log import prediction_text
from daemon.store.listings import RunListing


class TurnDocument(Answer):
    """A turn of the flange about one of its own axes."""

    turn_axis: Literal["x", "y", "z"]
    deg: float


class ShiftDocument(Answer):
    """A shift of the flange along the base's axes."""

    shift_mm: Vector


class NearDocument(Answer):
    """How near to the advised pose a view is as good: the target is still near the middle, the turn still tells."""

    mm: float = 30.0
    deg: float = 5.0


class PredictionDocument(Answer):
    """U (k = 2) at the worst of the points that matter after a station, and with the views planned then."""

    station: int
    at: str
    now_mm: float | None
    planned_mm: float | None


class PlannedPoseDocument(Answer):
    """A planned pose; where the arm is known its axis angles, and base, shoulder, elbow, wrist and flange to draw."""

    base_T_flange: PoseDocument
    joints_deg: list[float] | None
    skeleton_mm: list[Vector] | None


class GoalDocument(Answer):
    """What ends a planned run: so many views at the most, or one sigma or U of a measured point."""

    views: int
    uncertainty_mm: float | None
    tolerance_mm: float | None


class PlanningDocument(Answer):
    """The predictions of an adaptive or manual run: U (k = 2) at the worst of the points that matter, mm.

    `now_mm`: from the views so far, null before they determine X; `planned_mm`: with the `ahead` views planned next.
    `advice`: what an operator should do before the next view of a manual run; `next_pose`: the pose after it, if known;
    `next_outline_px`: u, v of the corners of the rectangle around the target's points in that picture;
    `advice_steps`: the same one by one; `near`: a view from this near to it is as good.
    `history`: the predictions after each station; `planned_poses`: the next one first; `goal`: what ends the run.
    """

    now_mm: float | None
    planned_mm: float | None
    ahead: int
    predicted: str | None
    note: str
    advice: str
    next_pose: PoseDocument | None
    next_outline_px: list[tuple[float, float]] | None
    advice_steps: list[TurnDocument | ShiftDocument]
    near: NearDocument
    history: list[PredictionDocument]
    planned_poses: list[PlannedPoseDocument]
    goal: GoalDocument | None

    @classmethod
    def of(cls, planning: Planning) -> "PlanningDocument":
        return cls(**vars(planning), predicted=prediction_text(planning), near=NearDocument())


class RunDocument(Answer):
    """One run. `station` counts the stations captured so far; `result` depends on `kind`.

    `started_by`: the key's name, or who started it without one; empty in runs from before that was stored.
    """

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
        started_by="Ann",
        started_by_role="operator",
        links={"self": f"/runs/{EXAMPLE_ID}", "calibration": f"/calibrations/{EXAMPLE_ID}"},
    )

    id: str
    kind: RunKind
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
    started_by: str
    started_by_role: str
    links: dict[str, str]

    @classmethod
    def of(cls, run: RunRecord) -> "RunDocument":
        links = {"self": f"/runs/{run.id}"}
        if not run.over:
            links["abort"] = f"/runs/{run.id}/abort"
            if run.request.get("manual"):
                links |= {name: f"/runs/{run.id}/{name}" for name in ("stations", "jog", "finish")}
        for key, folder in (("calibration_id", "calibrations"), ("scan_id", "scans")):
            if run.result and key in run.result:
                links[key.removesuffix("_id")] = f"/{folder}/{run.result[key]}"
        if run.kind != "scan":
            links.update({f"frame {k}": f"/runs/{run.id}/frames/{k}" for k in range(run.pictures)})
        planning = None if run.planning is None else PlanningDocument.of(run.planning)
        return cls(**{**vars(run), "planning": planning}, over=run.over, links=links)


def listing_json(listing: RunListing) -> str:
    """The RunDocument of a list as JSON, with request and result as stored."""
    rest = RunDocument.of(listing.run).model_dump_json(exclude={"request", "result"})
    return f'{rest[:-1]},"request":{listing.request},"result":{listing.result or "null"}}}'


class RunList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    runs: list[RunDocument]
    damaged: list[str]
    next: str | None
