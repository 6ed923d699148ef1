"""The page's pure modules under `node --test`, and the words of every finding."""

import asyncio
import re
from pathlib import Path

import pytest

from calibration.sentences.english import ENGLISH
from daemon.api.routes.help_codes import _entries
from daemon.page import FOLDER, sentences_in
from daemon.tools.batch_registration.errors import ArchiveError
from daemon.tools.target_print.errors import PrintRefused

LANGUAGES = ("de", "es", "zh")
TESTS = Path(__file__).parent / "modules"


async def test_pure_modules(node: str) -> None:
    tests = map(str, sorted(TESTS.glob("*.test.mjs")))
    pipe = asyncio.subprocess.PIPE
    run = await asyncio.create_subprocess_exec(node, "--test", *tests, stdout=pipe, stderr=asyncio.subprocess.STDOUT)
    output, _ = await run.communicate()
    assert run.returncode == 0, output.decode()


UNLISTED = {
    "internal-error", "document-refused", "calibration-error", "http-error", PrintRefused.code, ArchiveError.code
}  # fmt: skip
"""Codes of problems that no class of errors has, and of commands' errors, which are there once they are imported."""


def daemon_words(language: str) -> dict[str, str]:
    words = sentences_in(language)
    rows = (FOLDER / "words" / f"daemon.{language}.js").read_text().count("\n  '")
    assert len(words) == rows, "an id stands twice, or a row is not as the reports read it"
    return words


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_sentence_of_the_daemon_is_translated_with_places_that_it_gives(language: str) -> None:
    """A translation may leave a parameter out, and never asks for one that the English sentence has not."""
    words = daemon_words(language)
    assert not ENGLISH.keys() - words.keys(), f"give them in daemon/page/words/daemon.{language}.js"
    for sentence_id, template in ENGLISH.items():
        places = set(re.findall(r"{(\w+)", words[sentence_id]))
        assert places <= set(re.findall(r"{(\w+)", template)), sentence_id


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_code_of_an_error_says_what_it_means_and_what_to_do(language: str) -> None:
    words = daemon_words(language)
    codes = {code for code, entry in _entries().items() if entry.kind == "error"} | UNLISTED
    missing = {name for code in codes for name in (f"{code}.what", f"{code}.fix")} - words.keys()
    assert not missing, f"give them in daemon/page/words/daemon.{language}.js"
