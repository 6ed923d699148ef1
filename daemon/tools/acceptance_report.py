"""The report of an acceptance: one JSON document, and the same as a page for people."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from calibration.documents.validation import Document
from drivers.robots.abb.acceptance.program import RowResult
from drivers.robots.abb.rws.parsing import EventLogEntry


class RobotAcceptanceDocument(Document):
    """The whole of acceptance.json."""

    heading = "acceptancejson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    handeyed: str
    """Version of handeyed."""
    began_at: str
    """UTC."""
    address: str
    """Of the robot's link."""
    services: str | None
    """Of Robot Web Services; null without."""
    controller: dict[str, str]
    """What the controller says of itself: name and rwversion."""
    accepted: bool
    """Whether rows passed and none failed."""
    counts: dict[str, int]
    """Number of rows by verdict."""
    rows: list[RowResult]
    """The assumptions that were tried, in order."""
    event_log: list[EventLogEntry]
    """Entries of the controller's event log, newest first."""


def acceptance_document(results: Sequence[Mapping[str, Any]], **head: Any) -> dict[str, Any]:
    """The report as JSON. `results`: rows in order; `head`: what else RobotAcceptanceDocument has."""
    counts = {verdict: sum(row["verdict"] == verdict for row in results) for verdict in ("passed", "failed", "skipped")}
    accepted = not counts["failed"] and bool(counts["passed"])
    rows = [dict(row) for row in results]
    return {"schema_version": 1, **head, "accepted": accepted, "counts": counts, "rows": rows}


def acceptance_page(document: Mapping[str, Any]) -> str:
    """The report as a page of its own: no script, nothing fetched."""
    from jinja2 import Template

    page = Template(Path(__file__).with_suffix(".html").read_text("utf-8"), autoescape=True, trim_blocks=True)
    text: str = page.render(document)
    return text + "\n"
