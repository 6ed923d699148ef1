"""The languages of reports: their own words, and the daemon's sentences as the page has them."""

import json
from functools import cache
from pathlib import Path
from typing import Literal, get_args

from calibration.documents.calibration import SentenceDocument
from calibration.sentences.sentence import IN_ENGLISH, Language, Sentence, text_of
from daemon.page import sentences_in

LanguageTag = Literal["en", "de", "es", "zh"]
LANGUAGES: tuple[LanguageTag, ...] = get_args(LanguageTag)

WORDS = Path(__file__).parent / "words"
DECIMAL_COMMA = ("de", "es")


@cache
def language_of(tag: LanguageTag) -> Language:
    """The words of reports and the daemon's sentences; read once."""
    words: dict[str, str] = json.loads((WORDS / f"{tag}.json").read_text(encoding="utf-8"))
    sentences = IN_ENGLISH.templates if tag == IN_ENGLISH.tag else sentences_in(tag)
    return Language(tag, {**sentences, **words}, "," if tag in DECIMAL_COMMA else ".")


def said(language: Language, message: str, sentence: SentenceDocument | Sentence) -> str:
    """A stored sentence in that language; `message`, its English text, where the language has none for it."""
    if language.tag == IN_ENGLISH.tag:
        return message
    try:
        return text_of(sentence.id, sentence.params, language)
    except (LookupError, ValueError, TypeError):  # of another version: its id is gone, or its parameters are others
        return message
