"""Schemas of keys and the audit log."""

from typing import Any, Literal

from daemon.api.schemas.answer import Answer


class NewKeyDocument(Answer):
    """A key: it is shown this once."""

    key: str
    id: str
    name: str
    role: Literal["viewer", "operator", "admin"]
    expires_at: str | None


class AuditDocument(Answer):
    """One entry of the audit log. `hash` covers the row and the hash of the row before."""

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
