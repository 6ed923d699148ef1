"""Each row's hash covers the row and the hash before it: an edited, removed or reordered row breaks the chain."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass

FIRST_LINK = "0" * 64
"""What the first row is chained to."""


@dataclass(frozen=True)
class AuditRow:
    """Somebody did something. `sequence` counts from 1 without gaps; `hash` is hexadecimal SHA-256."""

    sequence: int
    at: str
    actor: str
    role: str
    action: str
    subject: str
    detail: str
    hash: str = ""


@dataclass(frozen=True)
class Anchor:
    """How far the log had come when somebody wrote it down: the log must still hold this row."""

    sequence: int
    hash: str


def hash_of(row: AuditRow, before: str) -> str:
    """SHA-256 over the hash before and every field, as JSON so that no two rows look alike."""
    fields = [before, row.sequence, row.at, row.actor, row.role, row.action, row.subject, row.detail]
    return hashlib.sha256(json.dumps(fields, ensure_ascii=True, separators=(",", ":")).encode()).hexdigest()


def flaws(rows: Iterable[AuditRow], anchors: Iterable[Anchor] = ()) -> list[str]:
    """What is wrong with the log, in words; nothing when it is whole up to every anchor."""
    wanted: dict[int, set[str]] = {}
    for anchor in anchors:
        wanted.setdefault(anchor.sequence, set()).add(anchor.hash)
    found, before, last = [], FIRST_LINK, 0
    for row in rows:
        if row.sequence != last + 1:
            found.append(f"row {row.sequence} follows row {last}: rows were removed or reordered")
        if row.hash != hash_of(row, before):
            found.append(f"row {row.sequence} ({row.at} {row.action}) was changed, or one before it removed")
        if wanted.pop(row.sequence, {row.hash}) != {row.hash}:
            found.append(f"row {row.sequence} is another one than the anchor says: the log was rewritten")
        before, last = row.hash, row.sequence
    if wanted:
        found.append(f"the log ends with row {last}, but row {max(wanted)} was written: its end was cut off")
    return found
