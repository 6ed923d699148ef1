"""Schemas of the stored touch tests."""

from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchesDocument
from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.store.documents import DocumentRecord
from extensions.touch.touch_tests import StoredTouchTest


class StoredTouch(StoredAnswer):
    """A touch test, and what it was made from. `verification`: the run that saw the points, or null."""

    verification: str | None
    tip: TipDocument
    touches: TouchesDocument
    result: TouchTestDocument

    @classmethod
    def of_record(cls, record: DocumentRecord) -> "StoredTouch":
        return cls(**vars(record), **vars(record.parsed(StoredTouchTest)))


class TouchList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    touches: list[StoredTouch]
    damaged: list[str]
    next: str | None
