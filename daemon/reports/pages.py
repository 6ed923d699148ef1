"""A report's page from its template: one file, its style inside, nothing run or fetched. Values are escaped."""

import json
import math
from base64 import b64encode
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibration.documents.calibration import SentenceDocument
from calibration.documents.numbers import number, significant
from calibration.documents.target import TargetDocument, described
from calibration.sentences.sentence import Language, LanguageTag, Sentence, sentences_in, text_of
from daemon.reports.context import Picture, ReportContext

if TYPE_CHECKING:
    from jinja2 import Environment

WORDS = Path(__file__).parent / "words"


@cache
def language_of(tag: LanguageTag) -> Language:
    """The words of reports and the daemon's sentences; read once."""
    words: dict[str, str] = json.loads((WORDS / f"{tag}.json").read_text(encoding="utf-8"))
    sentences = sentences_in(tag)
    return replace(sentences, templates={**sentences.templates, **words})


def said(language: Language, message: str, sentence: SentenceDocument | Sentence) -> str:
    """A stored sentence in that language; `message`, its English text, where the language has none for it."""
    if language.tag == "en":
        return message
    try:
        return text_of(sentence.id, sentence.params, language)
    except (LookupError, ValueError, TypeError):  # of another version: its id is gone, or its parameters are others
        return message


TEMPLATES = Path(__file__).parent / "templates"
PICTURES = ("data:image/jpeg;base64,", "data:image/png;base64,")


def render(name: str, report_number: str, context: ReportContext, **values: Any) -> str:
    """The HTML of templates/NAME.html; `report_number` stands in its title and below every page."""
    language = language_of(context.language)
    title = text_of(f"{name}.title", {}, language)
    style = _style(f"{title} {report_number}", language)
    return _environment(context.language).get_template(f"{name}.html").render(
        title=title, number=report_number, style=style, policy=content_policy(style), context=context, **values
    )  # fmt: skip


@cache
def _environment(tag: LanguageTag) -> "Environment":
    """Templates with what they call: words, and numbers as that language writes them."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # 0.05 s of a start, and no start needs it

    language = language_of(tag)

    def say(sentence_id: str, /, **params: Any) -> str:
        return text_of(sentence_id, params, language)

    def stored(sentence: SentenceDocument | Sentence, message: str) -> str:
        return said(language, message, sentence)

    def in_language(text: str) -> str:
        return text.replace(".", language.decimal)

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.globals |= {"say": say, "stored": stored, "lang": tag}
    environment.globals["target_words"] = lambda target: target_words(target, language)
    environment.filters |= {
        "number": lambda value, decimals: in_language(number(value, decimals)),
        "significant": lambda value: in_language(significant(value)),
        "length_of": lambda vector: in_language(significant(math.hypot(*vector))),
        "plain": lambda value: in_language(f"{value:g}"),
        "thousands": lambda value: f"{value:,}".replace(",", "," if language.decimal == "." else "\u202f"),
        "in_language": in_language,
        "inlined": _inlined,
    }
    return environment


def _style(footer: str, language: Language) -> str:
    """style.css, and margins of A4 with `footer` and the number of the page on every page."""
    box = "font: 8px 'Noto Sans', 'DejaVu Sans', 'Noto Sans CJK SC', sans-serif; color: #56606a;"
    before, between, after = text_of("report.page", {"page": "|", "pages": "|"}, language).split("|")
    count = f"{_css_string(before)} counter(page) {_css_string(between)} counter(pages) {_css_string(after)}"
    return (
        f"{(TEMPLATES / 'style.css').read_text(encoding='utf-8')}@page {{ size: A4; margin: 17mm 16mm 18mm;"
        f" @bottom-left {{ content: {_css_string(footer)}; {box} }} @bottom-right {{ content: {count}; {box} }} }}\n"
    )


def _css_string(text: str) -> str:
    """A string of CSS: only letters, digits and a little punctuation of `text` stay."""
    return '"' + "".join(letter for letter in text if letter.isalnum() or letter in " .,:_-/")[:120] + '"'


def content_policy(style: str) -> str:
    """The Content Security Policy of a page with that style: nothing else is run or fetched."""
    digest = b64encode(sha256(style.encode()).digest()).decode()
    return f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:"


def policy_of(html: str) -> str:
    """The policy of a report, for the answer's header."""
    return content_policy(html.partition("<style>")[2].partition("</style>")[0]) + "; frame-ancestors 'none'"


def _inlined(shown: Picture) -> str:
    """Its address. Only data: URIs of pictures are taken."""
    if not shown.data_uri.startswith(PICTURES):
        raise ValueError("a report's picture is a data: URI of a JPEG or PNG")
    return shown.data_uri


def target_words(target: TargetDocument | None, language: Language) -> str | None:
    """Kind and sizes of a target in one line."""
    if target is None:
        return None
    values = described(target)
    kind = str(values.pop("kind"))
    sizes = [text_of(f"target.{name.removesuffix('_mm')}", {"mm": value}, language)
             for name, value in values.items() if name.endswith("_mm")]  # fmt: skip
    grid = f" {values['columns']} \u00d7 {values['rows']}" if {"columns", "rows"} <= values.keys() else ""
    dictionary = [str(values[name]) for name in ("dictionary", "family") if name in values]
    return ", ".join([f"{kind}{grid}", *sizes, *dictionary])
