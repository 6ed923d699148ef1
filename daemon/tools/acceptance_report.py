"""The report of an acceptance: one JSON document, and the same as a page for people."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from calibration.documents.validation import Document


class AcceptanceRowDocument(Document):
    """One assumption, what was seen when it failed or why it was skipped, and what was measured."""

    code: str
    """Stable code of the row."""
    assumption: str
    """What is assumed of the controller."""
    verdict: Literal["passed", "failed", "skipped"]
    """passed, failed or skipped."""
    what: str
    """What was seen when it failed, or why it was skipped."""
    measured: dict[str, float | str]
    """Figures by name, with the unit in the name."""
    seconds: float
    """How long it took, s."""


class EventDocument(Document):
    """One entry of the controller's event log."""

    number: int
    """Of the entry, counted by the controller."""
    kind: int
    """1 information, 2 warning, 3 error."""
    code: int
    """ABB's number of the event."""
    at: str
    """By the controller's clock, as it gives it."""
    title: str
    """ABB's title of the event."""
    description: str
    """ABB's description of the event."""


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
    rows: list[AcceptanceRowDocument]
    """The assumptions that were tried, in order."""
    event_log: list[EventDocument]
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
