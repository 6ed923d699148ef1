"""Schemas of the scanner's stored verifications."""

from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.store.documents import DocumentRecord


class StoredAcceptance(StoredAnswer):
    """A verification of the scanner, as POST /verify answered it."""

    acceptance: AcceptanceDocument

    @classmethod
    def of_record(cls, record: DocumentRecord) -> "StoredAcceptance":
        return cls(**vars(record), acceptance=record.parsed(AcceptanceDocument))


class AcceptanceList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    acceptances: list[StoredAcceptance]
    damaged: list[str]
    next: str | None
