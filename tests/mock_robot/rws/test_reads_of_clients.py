"""docs/rws.md lists which reads of public clients the mock answers, and which it does not have on purpose."""

import re

import pytest

from mock_robot.rws.routes import ROUTES
from tests.conftest import ROOT

TEXT = (ROOT / "docs" / "rws.md").read_text(encoding="utf-8")
SECTION = TEXT.partition("### What public clients read")[2].partition("\n## ")[0]
TABLE, _, ANSWERED = SECTION.partition("\nAnswered:")
MISSING = "\n".join(row.split("|")[1] for row in TABLE.splitlines() if row.startswith("| `"))


def paths_in(text: str) -> list[str]:
    return re.findall(r"`(/(?:rw|ctrl|fileservice|progress|uas)[^` ]*)`", text)


def is_read(path: str) -> bool:
    return any(method == "GET" and pattern.fullmatch(path) for method, pattern, _, _ in ROUTES[2])


@pytest.mark.parametrize("path", paths_in(ANSWERED))
def test_a_read_that_is_listed_as_answered_has_a_route(path: str) -> None:
    assert is_read(path)


@pytest.mark.parametrize("path", paths_in(MISSING))
def test_a_read_that_is_listed_as_missing_has_none(path: str) -> None:
    assert not is_read(path)
