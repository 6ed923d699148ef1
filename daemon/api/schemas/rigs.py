"""Schemas of the stored rigs."""

from calibration.documents.rig import RigDocument
from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.store.documents import DocumentRecord


class StoredRig(StoredAnswer):
    """A rig.json as it was stored. The newest one is active."""

    rig: RigDocument

    @classmethod
    def of_record(cls, record: DocumentRecord) -> "StoredRig":
        return cls(**vars(record), rig=record.parsed(RigDocument))


class RigList(Answer):
    """The newest first, which is active; `next` asks for those before them. `damaged`: ids that cannot be read."""

    rigs: list[StoredRig]
    damaged: list[str]
    next: str | None
