"""Parts that all reports are made of."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from hashlib import sha256
from typing import Any

from calibration.documents.calibration import FindingDocument
from calibration.documents.reports.context import Picture, ReportContext
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.style import page_style
from calibration.documents.target import TargetDocument

KINDS = {"error": "error", "warning": "warning", "info": "note"}


def page(title: str, subtitle: str, number: str, lead: Sequence[Any], sections: Iterable[tuple[str, Any]]) -> str:
    """The whole HTML: head, title, `lead`, and the numbered sections."""
    numbered = [
        tag("section", tag("h2", tag("span", f"{index}", class_="nr"), heading), content)
        for index, (heading, content) in enumerate(sections, start=1)
    ]
    about = f"Report {number}. Not an accredited certificate."
    body = tag(
        "body",
        tag("header", tag("h1", title, ": ", subtitle), tag("p", about)),
        tag("main", *lead, *numbered),
        tag("p", "End of report ", number, class_="end"),
    )
    style = page_style(f"{title} {number}")
    head = join(
        Markup('<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{content_policy(style)}">'),
        tag("title", f"{title} {number}"),
        tag("style", Markup(style)),
    )
    return f'<!DOCTYPE html>\n<html lang="en">{tag("head", head)}{body}</html>\n'


def content_policy(style: str) -> str:
    """The Content Security Policy of a page with that style: nothing else is run or fetched."""
    digest = b64encode(sha256(style.encode()).digest()).decode()
    return f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:"


def policy_of(html: str) -> str:
    """The policy of a report, for the answer's header."""
    return content_policy(html.partition("<style>")[2].partition("</style>")[0]) + "; frame-ancestors 'none'"


def blank(asked_for: str) -> Markup:
    """A line to fill in, with where it can be given."""
    return tag("span", asked_for, class_="blank")


def known(value: object | None, asked_for: str) -> Any:
    """`value`, or a blank."""
    return blank(asked_for) if value is None or value == "" else value


def facts(rows: Iterable[tuple[str, Any]]) -> Markup:
    """Names and what is known of each."""
    return tag("table", *(tag("tr", tag("th", name, scope="row"), tag("td", value)) for name, value in rows),
               class_="facts")  # fmt: skip


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], *, words: bool = False) -> Markup:
    """A table: the first column is words, the others are numbers unless `words`."""
    header = tag("thead", tag("tr", *(tag("th", name, scope="col") for name in head)))
    body = tag("tbody", *(tag("tr", *(tag("td", cell) for cell in row)) for row in rows))
    return tag("table", header, body, class_="words" if words else None)


def verdict(accepted: bool, word: str, *sentences: Any) -> Markup:
    """The result in a frame."""
    kind = "verdict" if accepted else "verdict no"
    return tag("div", tag("p", tag("span", word, class_="word"), " ", *sentences), class_=kind)


def findings(found: Sequence[FindingDocument]) -> Markup:
    """Each finding with what to do."""
    if not found:
        return tag("p", "None.")
    return tag("table", *(_finding(each) for each in found), class_="findings")


def _finding(each: FindingDocument) -> Markup:
    fix = tag("span", f" \u2192 {each.fix}", class_="fix") if each.fix else None
    kind = tag("th", KINDS[each.severity], class_=each.severity)
    return tag("tr", kind, tag("td", each.message, "" if each.message.endswith(".") else ".", fix))


def picture(shown: Picture) -> Markup:
    """A figure. Only data: URIs of pictures are taken."""
    if not shown.data_uri.startswith(("data:image/jpeg;base64,", "data:image/png;base64,")):
        raise ValueError("a report's picture is a data: URI of a JPEG or PNG")
    image = tag("img", src=shown.data_uri, width=shown.width, height=shown.height, alt=shown.caption)
    return tag("figure", Markup(image.removesuffix("</img>")), tag("figcaption", shown.caption))


def signatures(context: ReportContext) -> Markup:
    """Two lines to sign on."""
    first = "Carried out by (name, date, signature)"
    if context.carried_out_by:
        first = f"Carried out by {context.carried_out_by} (date, signature)"
    return tag("div", tag("div", first), tag("div", "Released by (name, date, signature)"), class_="signatures")


def hashes(context: ReportContext) -> Markup:
    """SHA-256 of what the report is made from."""
    rows = [
        ("Calibration", tag("code", context.document_sha256) if context.document_sha256 else blank("not computed")),
        ("Session", tag("code", context.session_sha256) if context.session_sha256 else blank("not at hand")),
    ]
    return facts(rows)


def target_words(target: TargetDocument | None) -> str | None:
    """Kind and sizes of a target in one line."""
    if target is None:
        return None
    values = target.model_dump(exclude_none=True)
    kind = str(values.pop("kind"))
    sizes = [f"{name.removesuffix('_mm').replace('_', ' ')} {value:g} mm" for name, value in values.items()
             if name.endswith("_mm") and isinstance(value, int | float)]  # fmt: skip
    grid = f" {values['columns']} \u00d7 {values['rows']}" if {"columns", "rows"} <= values.keys() else ""
    dictionary = [str(values[name]) for name in ("dictionary", "family") if name in values]
    return ", ".join([f"{kind}{grid}", *sizes, *dictionary])


def identification(context: ReportContext, camera: str, made: str) -> Markup:
    """Who, where and with what."""
    setting = "[report] of the settings"
    return facts([
        ("Plant, cell", join(known(context.plant, f"plant: {setting}"), ", ", known(context.cell, f"cell: {setting}"))),
        ("Robot", join(known(context.robot_model, "model: [robot] model"), ", serial no. ",
                       known(context.robot_serial, setting), ", base frame and tool0 of the controller")),
        ("Camera", join(context.camera_model and f"{context.camera_model}, ", "serial no. ",
                        known(context.camera_serial, setting), camera)),
        ("Target", join(known(target_words(context.target), "description"), ", serial no. ",
                        known(context.target_serial, setting), ", certificate ",
                        known(context.target_certificate, setting))),
        ("Carried out", made),
    ])  # fmt: skip
