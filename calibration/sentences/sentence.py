"""A sentence made from an id and parameters by a table of templates, so that programs and translations have both.

words/LANGUAGE.json holds the templates by section and id, the same in every language. A place {name:form} is filled by
the parameter of that name, in Python's format language; `views` lists indices of views, `picture` writes one, both from
1; `step` writes a sign and a gap, and the form of a list stands between its items. The page fills them alike.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite
from pathlib import Path
from string import Formatter
from types import MappingProxyType
from typing import Any, Literal, Self, get_args

LanguageTag = Literal["en", "de", "es", "zh"]
LANGUAGES: tuple[LanguageTag, ...] = get_args(LanguageTag)

WORDS = Path(__file__).parent / "words"
DECIMAL_COMMA = ("de", "es")

AS_WRITTEN = "as-written"
"""The id of a text that no table holds: a message of a library or a device, or one of a file of version 1."""

MAX_LISTED_VIEWS = 12

NOT_FINITE = ("inf", "-inf", "nan")
"""How JSON holds such a parameter."""


@dataclass(frozen=True)
class Language:
    """The templates of its sentences by id, and what parts whole numbers from their fractions."""

    tag: LanguageTag
    templates: Mapping[str, str]
    decimal: str = "."


@cache
def sections_in(tag: LanguageTag) -> Mapping[str, Mapping[str, str]]:
    """The templates by section and id; each file is read once."""
    sections: dict[str, dict[str, str]] = json.loads((WORDS / f"{tag}.json").read_text(encoding="utf-8"))
    return MappingProxyType({name: MappingProxyType(section) for name, section in sections.items()})


@cache
def sentences_in(tag: LanguageTag) -> Language:
    """All sentences in that language."""
    templates = {sentence_id: text for section in sections_in(tag).values() for sentence_id, text in section.items()}
    return Language(tag, MappingProxyType(templates), "," if tag in DECIMAL_COMMA else ".")


def is_known(sentence_id: str) -> bool:
    """Whether there is a sentence of this id."""
    return sentence_id in sentences_in("en").templates


class Sentence(str):
    """English text with its `id` in the table and the `params` that fill its template."""

    id: str
    params: dict[str, Any]

    def __new__(cls, sentence_id: str, /, **params: Any) -> Self:
        sentence = super().__new__(cls, text_of(sentence_id, params))
        sentence.id, sentence.params = sentence_id, params
        return sentence

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:
        return (self.id,), self.params

    def pair(self) -> dict[str, Any]:
        """{"id", "params"} as JSON takes it; a parameter that is a sentence is such a pair, too."""
        return {"id": self.id, "params": {name: _json(value) for name, value in self.params.items()}}


def as_sentence(text: str) -> Sentence:
    """`text` itself when it is a Sentence, else one of the id AS_WRITTEN."""
    return text if isinstance(text, Sentence) else Sentence(AS_WRITTEN, sentence=text)


def with_fix(what: str, fix: str) -> Sentence:
    """`what: fix` as one sentence."""
    return Sentence("what-and-fix", what=as_sentence(what), fix=as_sentence(fix))


def text_of(sentence_id: str, params: Mapping[str, Any], language: Language | None = None) -> str:
    """The text of a pair, in English without a `language`. Raises KeyError for an unknown id or a missing parameter."""
    language = language or sentences_in("en")
    return _Templates(language).vformat(language.templates[sentence_id], (), params)


class _Templates(Formatter):
    """str.format, with lists of views, lists of sentences, and parameters that are themselves pairs."""

    def __init__(self, language: Language) -> None:
        self._language = language

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec == "views":
            return pictures(value) if self._language.tag == "en" else _first_of(value, " \u2026")
        if format_spec == "picture" and isinstance(value, int | list):
            return from_one(value if isinstance(value, list) else [value])
        format_spec = format_spec.removeprefix("picture")
        if format_spec == "step":
            return self._decimal(f"{'-+'[value > 0]} {abs(value)}")
        if isinstance(value, str) and value in NOT_FINITE:
            value = float(value)
        if isinstance(value, Mapping):
            return text_of(value["id"], value["params"], self._language)
        if isinstance(value, Sentence):
            return text_of(value.id, value.params, self._language)
        if isinstance(value, list):
            return format_spec.join(self.format_field(one, "") for one in value)
        text = str(super().format_field(value, format_spec))
        return self._decimal(text) if isinstance(value, float) else text

    def _decimal(self, number: str) -> str:
        return number.replace(".", self._language.decimal)


def from_one(indices: Iterable[int]) -> str:
    """Pictures, or views of a scan, as people count them: that of index 0 is 1."""
    return ", ".join(str(index + 1) for index in indices)


def pictures(indices: Sequence[int]) -> str:
    """Such as "pictures 1, 3"; the first MAX_LISTED_VIEWS."""
    return f"picture{'s' * (len(indices) > 1)} {_first_of(indices, f' and {len(indices) - MAX_LISTED_VIEWS} more')}"


def _first_of(indices: Sequence[int], more: str) -> str:
    return from_one(indices[:MAX_LISTED_VIEWS]) + more * (len(indices) > MAX_LISTED_VIEWS)


def _json(value: Any) -> Any:
    if isinstance(value, Sentence):
        return value.pair()
    if isinstance(value, list | tuple):
        return [_json(one) for one in value]
    if isinstance(value, float):
        return float(value) if isfinite(value) else str(value)
    return value.item() if hasattr(value, "item") else value
