"""Schemas of scans, their views and clouds. Lengths in mm."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, as_it_stands
from daemon.api.schemas.runs import RunDocument
from daemon.model.records import RunRecord, ScanRecord, ScanViewDocument


@dataclass(frozen=True, kw_only=True)
class ScanDocument(ScanRecord):
    """A scan of a part from several views; `run` fills it when the daemon drives the scanner."""

    __pydantic_config__: ClassVar = as_it_stands(
        optional=("run",),
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

    views: list[ScanViewDocument]
    run: RunDocument | None = None
    links: dict[str, str]

    @classmethod
    def of(cls, scan: ScanRecord, views: list[ScanViewDocument], run: RunRecord | None = None) -> "ScanDocument":
        links = {
            "self": f"/scans/{scan.id}",
            "views": f"/scans/{scan.id}/views",
            "cloud": f"/scans/{scan.id}/cloud",
            "report": f"/scans/{scan.id}/report",
        }
        return cls(**vars(scan), views=views, run=None if run is None else RunDocument.of(run), links=links)


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


class ScanList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    scans: list[ScanDocument]
    damaged: list[str]
    next: str | None
