"""The audit log's anchor: the last row's sequence and hash in a file, so that a log that was cut off is detected."""

import json
from pathlib import Path

from daemon.access.audit_chain import AuditAnchor
from daemon.runtime.durable_files import write_durably
from daemon.store.database import storage_errors
from registration.io.durable_file import fsync_path

ANCHOR_NAME = "audit-anchor.json"
"""In the store's folder. Anchors that were acknowledged as not met are kept beside it as `audit-anchor.json.unmet`."""


def read_anchor(folder: Path) -> AuditAnchor | None:
    """The anchor in the store's folder; one that no log meets when the file cannot be read. Raises StorageError."""
    file = folder / ANCHOR_NAME
    with storage_errors(file):
        try:
            content = json.loads(file.read_bytes())
            return AuditAnchor(int(content["sequence"]), str(content["hash"]))
        except FileNotFoundError:
            return None
        except (ValueError, KeyError, TypeError, RecursionError):
            return AuditAnchor(1, f"{file.name} cannot be read")


def write_anchor(folder: Path, anchor: AuditAnchor) -> None:
    """Replace the anchor file durably. Raises OSError."""
    content = json.dumps({"sequence": anchor.sequence, "hash": anchor.hash})
    write_durably(folder / ANCHOR_NAME, [content.encode()])


def set_anchor_aside(folder: Path) -> Path | None:
    """Rename the anchor file to the first free of `.unmet`, `.unmet-2` ...; returns the new name. Raises OSError."""
    file, number = folder / ANCHOR_NAME, 1
    if not file.exists():
        return None
    while (aside := file.with_name(f"{file.name}.unmet" + (f"-{number}" if number > 1 else ""))).exists():
        number += 1
    file.rename(aside)
    fsync_path(folder)
    return aside
