"""docs/clouds.md against the code: which formats are read and written, their media types, and the extras they need."""

import re
import tomllib

import pytest

from daemon.api.streaming.cloud_request import ANSWER_SUFFIXES, JSON, SYNONYMS
from daemon.scans.upload import SUFFIXES
from registration.io.reading import PARSERS, SPECIAL
from registration.io.writing import FORMS, LIBRARIES
from tests.structure import ROOT

SUFFIX, MEDIA_TYPE = re.compile(r"`(\.\w+)`"), re.compile(r"`(application/[\w.-]+)`")
LINES = (ROOT / "docs" / "clouds.md").read_text().splitlines()
HEAD = next(number for number, line in enumerate(LINES) if line.startswith("| format |"))
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in LINES[HEAD + 2 : LINES.index("", HEAD)]
]  # fmt: skip


def suffixes(row: list[str], column: int) -> list[str]:
    """The suffixes of a column that lists some, all of the row's where it says more than no."""
    return [] if row[column] == "no" else SUFFIX.findall(row[column]) or SUFFIX.findall(row[1])


@pytest.mark.parametrize(
    ("column", "done"), [(2, {*PARSERS, *SPECIAL}), (3, {*FORMS, *LIBRARIES})], ids=["read", "written"]
)
def test_the_page_has_every_format(column: int, done: set[str]) -> None:
    assert {suffix for row in ROWS for suffix in suffixes(row, column)} == done


def test_the_page_has_every_media_type_by_its_suffix() -> None:
    named = {media: SUFFIX.findall(row[1]) for row in ROWS for media in MEDIA_TYPE.findall(row[4])}
    taken_only = named.keys() - SUFFIXES.keys()
    assert taken_only == {"application/vnd.las"} and taken_only < SYNONYMS.keys()
    for media, suffix in SUFFIXES.items():
        assert suffix in named[media]
    assert SUFFIXES.keys() - ANSWER_SUFFIXES.keys() == {"application/x-npz"}, "answered as PLY, as the page says"
    assert ANSWER_SUFFIXES.keys() - {JSON} < named.keys()


def test_the_extras_that_the_page_names_are_there() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    needed = {suffix: re.findall(r"handeyed\[(\w+)\]", row[6]) for row in ROWS for suffix in SUFFIX.findall(row[1])}
    assert {suffix for suffix, names in needed.items() if names} == LIBRARIES.keys()
    assert {name for names in needed.values() for name in names} <= extras.keys()
