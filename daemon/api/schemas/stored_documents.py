"""Schemas of the stored rigs and of the scanner's stored verifications."""

from calibration.documents.rig import RigDocument
from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.scans.scanner_acceptance import AcceptanceDocument


class StoredRig(StoredAnswer):
    """A rig.json as it was stored. The newest one is active."""

    rig: RigDocument


class RigList(Answer):
    """The newest first, which is active; `next` asks for those before them. `damaged`: ids that cannot be read."""

    rigs: list[StoredRig]
    damaged: list[str]
    next: str | None


class StoredAcceptance(StoredAnswer):
    """A verification of the scanner, as POST /verify answered it."""

    acceptance: AcceptanceDocument


class AcceptanceList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    acceptances: list[StoredAcceptance]
    damaged: list[str]
    next: str | None
