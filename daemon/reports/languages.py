"""The languages of reports: their own words, and the daemon's sentences."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

from calibration.documents.calibration import SentenceDocument
from calibration.sentences.sentence import Language, LanguageTag, Sentence, sentences_in, text_of

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
