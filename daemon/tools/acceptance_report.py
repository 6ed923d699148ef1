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
    assumption: str
    verdict: Literal["passed", "failed", "skipped"]
    what: str
    measured: dict[str, float | str]
    seconds: float


class EventDocument(Document):
    """One entry of the controller's event log; `kind`: 1 information, 2 warning, 3 error."""

    number: int
    kind: int
    code: int
    at: str
    title: str
    description: str


class RobotAcceptanceDocument(Document):
    """The whole of acceptance.json."""

    heading = "acceptancejson"

    schema_version: Literal[1] = 1
    handeyed: str
    began_at: str
    address: str
    services: str | None
    controller: dict[str, str]
    accepted: bool
    counts: dict[str, int]
    rows: list[AcceptanceRowDocument]
    event_log: list[EventDocument]


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
    controller = ", ".join(f"{name} {value}" for name, value in document["controller"].items())
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(head)}</title>'
        f"<style>{_STYLE}</style></head><body><h1>{escape(head)}</h1>"
        f"<p><b>{'accepted' if document['accepted'] else 'not accepted'}</b>: {escape(counts)}. "
        f"{escape(document['began_at'])}, handeyed {escape(document['handeyed'])}. {escape(controller)}</p>"
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
