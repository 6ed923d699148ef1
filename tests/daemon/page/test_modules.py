"""The page's pure modules under `node --test`, and the words of every finding."""

import asyncio
import re
from pathlib import Path

import pytest

from calibration.sentences.english import ENGLISH
from daemon.page import FOLDER

TESTS = Path(__file__).parent / "modules"


async def test_pure_modules(node: str) -> None:
    tests = map(str, sorted(TESTS.glob("*.test.mjs")))
    pipe = asyncio.subprocess.PIPE
    run = await asyncio.create_subprocess_exec(node, "--test", *tests, stdout=pipe, stderr=asyncio.subprocess.STDOUT)
    output, _ = await run.communicate()
    assert run.returncode == 0, output.decode()


@pytest.mark.parametrize("language", ["de", "es", "zh"])
def test_sentences_of_the_daemon_have_ids_and_places_that_it_gives(language: str) -> None:
    """A translation may leave a parameter out, and never asks for one that the English sentence has not."""
    text = (FOLDER / "words" / f"daemon.{language}.js").read_text()
    rows = re.findall(r"^  '([^']+)': '(.*)',$", text, re.MULTILINE)
    assert len(rows) > 20
    for sentence_id, template in rows:
        assert set(re.findall(r"{(\w+)", template)) <= set(re.findall(r"{(\w+)", ENGLISH[sentence_id])), sentence_id
