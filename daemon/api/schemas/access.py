"""Schemas of keys and the audit log."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from daemon.access.audit_chain import AuditRow
from daemon.api.schemas.answer import EXAMPLE_AT, Answer, as_it_stands, example

RoleWord = Literal["viewer", "operator", "admin"]


class NewKeyDocument(Answer):
    """A key: it is shown this once."""

    key: str
    id: str
    name: str
    role: RoleWord
    expires_at: str | None


class KeyDocument(Answer):
    """A key, without itself. `state`: "valid", "expired" or "revoked"."""

    id: str
    name: str
    role: RoleWord
    state: Literal["valid", "expired", "revoked"]
    created_at: str
    expires_at: str | None
    revoked_at: str | None


class KeyList(Answer):
    """All keys, oldest first."""

    keys: list[KeyDocument]


class RevokedKeys(Answer):
    """The ids of the keys that have ended."""

    revoked: list[str]


class AuditAnchorDocument(Answer):
    """The last row of the audit log: written down elsewhere, it proves later that the log was not rewritten."""

    sequence: int
    hash: str


class AuditVerifiedDocument(Answer):
    """Whether the log is whole: every row follows from the one before, and none is missing. `flaws`: the first 20."""

    whole: bool
    rows: int
    last: AuditAnchorDocument | None
    flaws: list[str]
    checked_at: str


class SignedInDocument(Answer):
    """The name of the key, the session's role, and when the session ends."""

    model_config = example(name="Ann", role="operator", expires_at=EXAMPLE_AT)

    name: str
    role: RoleWord
    expires_at: str


class SessionDocument(Answer):
    """Who is signed in, and what is asked for. `role`: "nobody" when nobody is; `expires_at`: of a browser's session.

    `asked`: "nobody" is asked on this machine, "setup-code" makes the first key, or a "key" or pairing code signs in.
    `last_event_id`: of GET /events; a stream from it misses nothing that happens after this answer. Null when nobody is
    signed in.
    """

    model_config = example(
        name="Ann", role="operator", expires_at=EXAMPLE_AT, asked="key", cell="cell-7", software="handeyed 0.1.0",
        languages=["en"], last_event_id=412,
    )  # fmt: skip

    name: str
    role: Literal["nobody", "viewer", "operator", "admin"]
    expires_at: str | None
    asked: Literal["nobody", "setup-code", "key"]
    cell: str
    software: str
    languages: list[str]
    last_event_id: int | None


class PairingDocument(Answer):
    """A code that signs another screen in, once."""

    model_config = example(code="ABCD-EFGH", expires_at=EXAMPLE_AT, role="operator")

    code: str
    expires_at: str
    role: RoleWord


@dataclass(frozen=True)
class AuditDocument(AuditRow):
    """One entry of the audit log. `hash` covers the row and the hash of the row before."""

    __pydantic_config__: ClassVar = as_it_stands()

    detail: dict[str, Any]  # type: ignore[assignment] # in the row its JSON, which the hash covers


class AuditList(Answer):
    """The newest first; `next` asks for those before them."""

    rows: list[AuditDocument]
    next: str | None
