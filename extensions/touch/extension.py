"""What touch tests add to the daemon."""

from collections.abc import Sequence

from daemon.api.extension import Extension, Rebuilt, rebuilt_of
from daemon.api.schemas.answer import documents_of
from daemon.api.schemas.drift import DriftTouchDocument
from daemon.application import Application
from daemon.store.damaged_rows import split_damaged
from daemon.store.documents import DocumentRecord
from extensions.touch.routes import StoredTouch, router
from extensions.touch.touch_tests import TOUCH_TESTS, StoredTouchTest


async def _rebuild(app: Application, touch_id: str) -> Rebuilt:
    stored = await app.store.documents(TOUCH_TESTS).get(touch_id)
    return rebuilt_of(201, StoredTouch.of_record(stored), f"/touches/{touch_id}")


def _chart(record: DocumentRecord) -> DriftTouchDocument:
    found = record.parsed(StoredTouchTest).result
    worst = max(found.points, key=lambda point: point.length_mm)
    return DriftTouchDocument(
        id=record.id, at=record.created_at, largest_mm=round(worst.length_mm, 6),
        expanded_mm=round(worst.expanded_mm, 6), accepted=found.accepted,
    )  # fmt: skip


async def _checks(app: Application, calibration_id: str, limit: int) -> Sequence[DriftTouchDocument]:
    records = await app.store.documents(TOUCH_TESTS).about(calibration_id, limit)
    return split_damaged(documents_of(_chart, records))[0]


TOUCH = Extension(
    "touch",
    routers=(router,),
    links={"touch tests": "/touches"},
    rebuilders={"touch": _rebuild},
    checks=_checks,
)
