"""Schemas of scans, their views and clouds. Lengths in mm."""

import json
from typing import Literal

from calibration.documents.pose import PoseDocument
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, example
from daemon.api.schemas.runs import RunDocument
from daemon.model.records import RunRecord, ScanRecord, ScanViewRecord
from daemon.store.listings import ScanListing


class ScanViewDocument(Answer):
    """One cloud of a scan. `joints_deg`: the arm's axes, null where the pose came without; `external_axes` likewise.

    `points`, with those that are not finite, and `bytes` of the file: null, and `created_by` empty, in views from
    before these were stored. `created_by`: the key's name, or who sent it without one.
    """

    view: int
    file: str
    unit: Literal["mm", "m"]
    base_T_flange: PoseDocument
    created_at: str
    joints_deg: list[float] | None
    external_axes: list[float | None] | None = None
    points: int | None = None
    bytes: int | None = None
    created_by: str = ""

    @classmethod
    def of(cls, view: ScanViewRecord) -> "ScanViewDocument":
        return cls(**vars(view))


class ScanDocument(Answer):
    """A scan of a part from several views; `run` fills it when the daemon drives the scanner."""

    model_config = example(
        id=EXAMPLE_ID,
        name="door 4711",
        refine=False,
        scanner="scanner",
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
    scanner: str
    created_at: str
    views: list[ScanViewDocument]
    run: RunDocument | None = None
    links: dict[str, str]

    @classmethod
    def of(cls, scan: ScanRecord, views: list[ScanViewRecord], run: RunRecord | None = None) -> "ScanDocument":
        links = {
            "self": f"/scans/{scan.id}",
            "views": f"/scans/{scan.id}/views",
            "cloud": f"/scans/{scan.id}/cloud",
            "report": f"/scans/{scan.id}/report",
        }
        return cls(
            id=scan.id, name=scan.name, refine=scan.refine, scanner=scan.scanner, created_at=scan.created_at,
            views=[ScanViewDocument.of(view) for view in views],
            run=None if run is None else RunDocument.of(run), links=links,
        )  # fmt: skip


class RegistrationState(Answer):
    """A registration in progress: `progress`, 0 to 1, is done; `links.self` answers its report when all is."""

    state: Literal["in progress"]
    progress: float = 0.0
    links: dict[str, str]


class CloudDocument(Answer):
    """A small cloud, in the base frame."""

    frame: Literal["base"]
    unit: Literal["mm"]
    calibration_id: str
    points: list[tuple[float, float, float]]


def listing_json(listing: ScanListing) -> str:
    """The ScanDocument of a list as JSON, with the views' poses as stored."""
    rest = ScanDocument.of(listing.scan, []).model_dump_json(exclude={"views"})
    views = ",".join(_view_json(*view) for view in listing.views)
    return f'{rest[:-1]},"views":[{views}]}}'


def _view_json(
    view: int, file: str, unit: str, base_T_flange: str, created_at: str, joints_deg: str | None, axes: str | None,
    points: int | None, size_bytes: int | None, created_by: str,
) -> str:  # fmt: skip
    plain = {"view": view, "file": file, "unit": unit, "created_at": created_at}
    given = json.dumps({**plain, "points": points, "bytes": size_bytes, "created_by": created_by})
    beside = f'"joints_deg":{joints_deg or "null"},"external_axes":{axes or "null"}'
    return f'{given[:-1]},"base_T_flange":{base_T_flange},{beside}}}'


class ScanList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    scans: list[ScanDocument]
    damaged: list[str]
    next: str | None
