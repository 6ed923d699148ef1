"""The report of an acceptance: one JSON document, and the same as a page for people."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Literal

from calibration.documents.validation import Document

_COLOURS = {"passed": "#176b2c", "failed": "#b00020", "skipped": "#6b6b6b"}
_STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:70em;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;width:100%}td,th{border-bottom:1px solid #ddd;padding:.35em .6em;text-align:left;"
    "vertical-align:top}td.v{font-weight:600}pre{background:#f4f4f4;padding:1em;overflow:auto}"
)


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


def acceptance_document(
    *,
    address: str,
    services: str | None,
    version: str,
    began_at: str,
    controller: Mapping[str, Any],
    results: Sequence[Mapping[str, Any]],
    log: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """The report as JSON. `results`: rows in order; `log`: entries of the controller's event log, newest first."""
    counts = {verdict: sum(row["verdict"] == verdict for row in results) for verdict in _COLOURS}
    return {
        "schema_version": 1,
        "handeyed": version,
        "began_at": began_at,
        "address": address,
        "services": services,
        "controller": dict(controller),
        "accepted": not counts["failed"] and bool(counts["passed"]),
        "counts": counts,
        "rows": [dict(row) for row in results],
        "event_log": [dict(entry) for entry in log],
    }


def acceptance_page(document: Mapping[str, Any]) -> str:
    """The report as a page of its own: no script, nothing fetched."""
    counts = ", ".join(f"{number} {verdict}" for verdict, number in document["counts"].items())
    head = f"Acceptance of {document['address']}"
    rows = "".join(_row(row) for row in document["rows"])
    log = "\n".join(f"{e['at']}  {e['code']}  {e['title']}" for e in document["event_log"]) or "not read"
    controller = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in document["controller"].items()
    )
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(head)}</title>'
        f"<style>{_STYLE}</style></head><body><h1>{escape(head)}</h1>"
        f"<p><b>{'accepted' if document['accepted'] else 'not accepted'}</b>: {escape(counts)}. "
        f"{escape(document['began_at'])}, handeyed {escape(document['handeyed'])}.</p>"
        f"<table><tbody>{controller}</tbody></table>"
        "<table><thead><tr><th>row</th><th>verdict</th><th>assumption</th><th>seen</th><th>s</th></tr></thead>"
        f"<tbody>{rows}</tbody></table><h2>Event log of the controller</h2><pre>{escape(log)}</pre></body></html>\n"
    )


def _row(row: Mapping[str, Any]) -> str:
    seen = row["what"] or ", ".join(f"{name} {value}" for name, value in row["measured"].items())
    colour = _COLOURS[row["verdict"]]
    return (
        f'<tr><td>{escape(row["code"])}</td><td class="v" style="color:{colour}">{escape(row["verdict"])}</td>'
        f"<td>{escape(row['assumption'])}</td><td>{escape(seen)}</td><td>{row['seconds']:g}</td></tr>"
    )
