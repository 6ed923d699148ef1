"""Hash chain of the audit log: each row's hash covers the row and the previous hash, which reveals any change."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass

GENESIS_HASH = "0" * 64
"""The previous hash of the first row."""


@dataclass(frozen=True)
class AuditRow:
    """One row of the audit log. `sequence` counts from 1 without gaps; `hash` is hexadecimal SHA-256."""

    sequence: int
    at: str
    actor: str
    role: str
    action: str
    subject: str
    detail: str
    hash: str = ""


@dataclass(frozen=True)
class AuditAnchor:
    """Sequence and hash of a row noted outside the database: the log must still contain it."""

    sequence: int
    hash: str


def hash_row(row: AuditRow, before: str) -> str:
    """SHA-256 over the previous hash and every field, encoded as JSON so that different rows never give equal bytes."""
    fields = [before, row.sequence, row.at, row.actor, row.role, row.action, row.subject, row.detail]
    return hashlib.sha256(json.dumps(fields, ensure_ascii=True, separators=(",", ":")).encode()).hexdigest()


def find_flaws(
    rows: Iterable[AuditRow], anchors: Iterable[AuditAnchor] = (), known: AuditRow | None = None
) -> list[str]:
    """One sentence for each fault of the log; empty when the chain is intact and contains every anchor.

    `known`: the row before the first of `rows`, whose hash is taken as it is. Without it the log begins with row 1.
    """
    wanted: dict[int, set[str]] = {}
    for anchor in anchors:
        wanted.setdefault(anchor.sequence, set()).add(anchor.hash)
    found, before, last = [], known.hash if known else GENESIS_HASH, known.sequence if known else 0
    for row in rows:
        if row.sequence != last + 1 and not (known and last == known.sequence):
            found.append(f"row {row.sequence} follows row {last}: rows were removed or reordered")
        if row.hash != hash_row(row, before):
            found.append(f"row {row.sequence} ({row.at} {row.action}) was changed, or one before it removed")
        if wanted.pop(row.sequence, {row.hash}) != {row.hash}:
            found.append(f"row {row.sequence} differs from the anchor: the log was rewritten")
        before, last = row.hash, row.sequence
    if wanted:
        found.append(f"the log ends with row {last}, but row {max(wanted)} was written: its end was cut off")
    return found
