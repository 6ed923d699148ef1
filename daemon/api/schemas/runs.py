"""Schemas of runs, and of their views: pixels from the centre of the first one, lengths mm, angles deg."""

from dataclasses import dataclass
from typing import ClassVar

from calibration.documents.pose import PoseDocument, Vector
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, as_it_stands
from daemon.api.schemas.cell import MissingDocument
from daemon.model.records import Foreseen, Planning, RunRecord
from daemon.runs.run_log import prediction_text


class NearDocument(Answer):
    """How near to the advised pose a view is as good: the target is still near the middle, the turn still tells."""

    mm: float = 30.0
    deg: float = 5.0


@dataclass(frozen=True, kw_only=True)
class PlanningDocument(Foreseen):
    """The predictions of an adaptive or manual run: U (k = 2) at the worst of the points that matter, mm.

    `now_mm`: from the views so far, null before they determine X; `planned_mm`: with the `ahead` views planned next.
    `advice`: what an operator should do before the next view of a manual run; `next_pose`: the pose after it, if known;
    `next_outline_px`: u, v of the corners of the rectangle around the target's points in that picture;
    `advice_steps`: the same one by one; `near`: a view from this near to it is as good.
    `history`: the predictions after each station; `planned_poses`: the next one first; `goal`: what ends the run.
    """

    __pydantic_config__: ClassVar = as_it_stands()

    predicted: str | None
    near: NearDocument

    @classmethod
    def of(cls, planning: Planning) -> "PlanningDocument":
        shown = {name: value for name, value in vars(planning).items() if name != "pictures"}
        return cls(**shown, predicted=prediction_text(planning), near=NearDocument())


@dataclass(frozen=True, kw_only=True)
class RunDocument(RunRecord):
    """One run. `station` counts the stations captured so far; `result` depends on `kind`.

    `started_by`: the key's name, or who started it without one; empty in runs from before that was stored.
    """

    __pydantic_config__: ClassVar = as_it_stands(
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

    planning: PlanningDocument | None = None  # type: ignore[assignment] # without `pictures`, which `links` have
    over: bool
    links: dict[str, str]

    @classmethod
    def of(cls, run: RunRecord) -> "RunDocument":
        links = {"self": f"/runs/{run.id}"}
        if not run.is_over:
            links["abort"] = f"/runs/{run.id}/abort"
            if run.request.get("manual"):
                links |= {name: f"/runs/{run.id}/{name}" for name in ("stations", "jog", "finish")}
        for key, folder in (("calibration_id", "calibrations"), ("scan_id", "scans")):
            if run.result and key in run.result:
                links[key.removesuffix("_id")] = f"/{folder}/{run.result[key]}"
        if run.kind != "scan":
            links.update({f"frame {k}": f"/runs/{run.id}/frames/{k}" for k in range(run.pictures)})
        planning = None if run.planning is None else PlanningDocument.of(run.planning)
        return cls(**{**vars(run), "planning": planning}, over=run.is_over, links=links)


class RunList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    runs: list[RunDocument]
    damaged: list[str]
    next: str | None


Corner = tuple[int, float, float, float | None, float | None, float | None, float | None]
"""Id, u, v; du, dv predicted minus found by the robot's pose as reported; the same by the corrected pose."""


class RunViewDocument(Answer):
    """One view. `status`: "used", "corrected" or "rejected" by the run's calibration, "missed" where the target was not
    found, "taken" before there is one.

    `corners`: [id, u, v, du, dv, du_free, dv_free]: found at (u, v); predicted minus found by the robot's pose as
    reported (du, dv), and by the pose corrected by the error estimated of it; null where not known. `rms_px` and
    `rms_px_free` are their root mean squares.
    """

    index: int
    at: str | None
    base_T_flange: PoseDocument
    joints_deg: list[float] | None
    skeleton_mm: list[Vector] | None
    status: str
    reason: str | None
    missing: MissingDocument | None
    corners: list[Corner]
    rms_px: float | None
    rms_px_free: float | None
    sharpness: float | None
    camera_temperature_c: float | None
    picture: str


class RunViewsDocument(Answer):
    """The views of a run, by which calibration they are predicted, and the target's outline in its own frame."""

    run_id: str
    calibration_id: str | None
    target_outline_mm: list[Vector]
    views: list[RunViewDocument]
