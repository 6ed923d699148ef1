"""The actor of a change: each transaction also writes its audit row, and links it to the request that caused it."""

import hashlib
import json
import sqlite3
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, field

from daemon.access.actor_names import DAEMON
from daemon.access.audit_chain import GENESIS_HASH, AuditRow, hash_row
from daemon.runtime.logs import within


@dataclass(eq=False)
class IdempotentRequest:
    """A POST with an Idempotency-Key in progress. `had_effect`: it has stored something."""

    caller: str
    key: str
    digest: "hashlib._Hash" = field(default_factory=hashlib.sha256)
    had_effect: bool = False


@dataclass(frozen=True)
class AuditContext:
    """Actor and role for the audit log, the ids of the actor's key and browser session, and the request if it has an
    Idempotency-Key.

    `changes`: what was stored.
    """

    actor: str = DAEMON
    role: str = "system"
    key_id: str = ""
    request: IdempotentRequest | None = None
    changes: list[str] = field(default_factory=list, compare=False)
    session: str = ""

    @property
    def audited_as(self) -> str:
        """The actor as the audit log names it: with the session, when a browser acts."""
        return f"{self.actor} (session {self.session})" if self.session else self.actor

    @property
    def caller(self) -> str:
        """The owner of an Idempotency-Key: a name may be given to another key later, an id never is."""
        return f"key {self.key_id}" if self.key_id else self.actor


_audit_context: ContextVar[AuditContext] = ContextVar("audit_context")


def acting_as(context: AuditContext) -> AbstractContextManager[None]:
    """Changes inside the block, and by runs started in it, are recorded under this actor."""
    return within(_audit_context, context)


def current_audit_context() -> AuditContext:
    """The context of the current request; the daemon itself outside any request."""
    return _audit_context.get(AuditContext())


def record_change(
    db: sqlite3.Connection, context: AuditContext, at: str, action: str, subject: str, **detail: object
) -> None:
    """Within a transaction: append its audit row, and store the effect with the request that caused it."""
    append_audit(db, context, at, action, subject, **detail)
    context.changes.append(f"{action} {subject}")
    request = context.request
    if request is None:
        return
    db.execute(
        "UPDATE requests SET effect = ?, body = ? WHERE caller = ? AND key = ? AND effect IS NULL",
        (f"{action} {subject}", request.digest.hexdigest(), request.caller, request.key),
    )
    request.had_effect = True


def append_audit(
    db: sqlite3.Connection, context: AuditContext, at: str, action: str, subject: str, **detail: object
) -> None:
    """Within a transaction: append one row, chained to the last."""
    last = db.execute("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1").fetchone()
    sequence, before = last or (0, GENESIS_HASH)
    row = AuditRow(
        sequence + 1, at, context.audited_as, context.role, action, subject, json.dumps(detail, sort_keys=True)
    )
    values = (row.sequence, row.at, row.actor, row.role, row.action, row.subject, row.detail, hash_row(row, before))
    db.execute("INSERT INTO audit VALUES (?, ?, ?, ?, ?, ?, ?, ?)", values)
