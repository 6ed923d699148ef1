"""On whose behalf the store writes: the same transaction notes who did it, and which request it answers."""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from daemon.access.audit_chain import FIRST_LINK, AuditRow, hash_of


@dataclass(eq=False)
class KeyedRequest:
    """A POST with an Idempotency-Key while it is carried out. `had_effect`: something was stored for it."""

    caller: str
    key: str
    digest: "hashlib._Hash" = field(default_factory=hashlib.sha256)
    had_effect: bool = False


@dataclass(frozen=True)
class Behalf:
    """Who acts, in which role, by which request. `noted` collects what was stored on their behalf."""

    actor: str = "handeyed"
    role: str = "system"
    request: KeyedRequest | None = None
    noted: list[str] = field(default_factory=list, compare=False)


_behalf: ContextVar[Behalf] = ContextVar("behalf")


@contextmanager
def on_behalf_of(behalf: Behalf) -> Iterator[None]:
    """What the store writes inside, and in runs started inside, is this caller's doing."""
    token = _behalf.set(behalf)
    try:
        yield
    finally:
        _behalf.reset(token)


def current_behalf() -> Behalf:
    """Of the request being carried out; the daemon itself outside of any."""
    return _behalf.get(Behalf())


def note(db: sqlite3.Connection, behalf: Behalf, at: str, action: str, subject: str, **detail: object) -> None:
    """Inside a transaction: the audit row of what it changes, and the answer's place for its request."""
    append_audit(db, behalf, at, action, subject, **detail)
    behalf.noted.append(f"{action} {subject}")
    request = behalf.request
    if request is None:
        return
    db.execute(
        "UPDATE requests SET effect = ?, body = ? WHERE caller = ? AND key = ? AND effect IS NULL",
        (f"{action} {subject}", request.digest.hexdigest(), request.caller, request.key),
    )
    request.had_effect = True


def append_audit(db: sqlite3.Connection, behalf: Behalf, at: str, action: str, subject: str, **detail: object) -> None:
    """Inside a transaction: one row, chained to the last."""
    last = db.execute("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1").fetchone()
    sequence, before = last or (0, FIRST_LINK)
    row = AuditRow(sequence + 1, at, behalf.actor, behalf.role, action, subject, json.dumps(detail, sort_keys=True))
    values = (row.sequence, row.at, row.actor, row.role, row.action, row.subject, row.detail, hash_of(row, before))
    db.execute("INSERT INTO audit VALUES (?, ?, ?, ?, ?, ?, ?, ?)", values)
