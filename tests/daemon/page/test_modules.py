"""The page's pure modules under `node --test`, and the words of every error."""

import asyncio
import json
from pathlib import Path

import pytest

from daemon.api.routes.help_codes import _entries
from daemon.page import FOLDER
from daemon.tools.batch_registration.remote_folder import ArchiveError

LANGUAGES = ("de", "es", "zh")
TESTS = Path(__file__).parent / "modules"


async def test_pure_modules(node: str) -> None:
    tests = map(str, sorted(TESTS.glob("*.test.mjs")))
    pipe = asyncio.subprocess.PIPE
    run = await asyncio.create_subprocess_exec(node, "--test", *tests, stdout=pipe, stderr=asyncio.subprocess.STDOUT)
    output, _ = await run.communicate()
    assert run.returncode == 0, output.decode()


UNLISTED = {"internal-error", "document-refused", "calibration-error", "http-error", ArchiveError.code}
"""Codes of problems that no class of errors has, and of commands' errors, which are there once they are imported."""


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_code_of_an_error_says_what_it_means_and_what_to_do(language: str) -> None:
    words = json.loads((FOLDER / "words" / f"errors.{language}.json").read_text(encoding="utf-8"))
    codes = {code for code, entry in _entries().items() if entry.kind == "error"} | UNLISTED
    assert {name for code in codes for name in (f"{code}.what", f"{code}.fix")} == words.keys()
