"""The documents name files and folders that exist."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.docs_site import docs_site

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
TOP = "benchmarks|calibration|daemon|deploy|docs|drivers|extensions|mock_robot|protocols|registration|tests"
PATH = re.compile(rf"(?<![\w/.-])((?:{TOP})/[\w./{{}},-]*\w/?)(?P<placeholder>\w*<)?")
LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)#\s]+)")


def named_paths(document: Path) -> Iterator[str]:
    """Paths of the repository in `document`, `{a,b}` expanded, without those that hold a `<placeholder>`."""
    found = PATH.finditer(document.read_text(encoding="utf-8"))
    for path in (match[1] for match in found if not match["placeholder"]):
        match = re.fullmatch(r"([^{}]*)\{([^{}]*)\}([^{}]*)", path)
        yield from (match[1] + part + match[3] for part in match[2].split(",")) if match else [path]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_files_that_a_document_names_exist(document: Path) -> None:
    missing = [path for path in named_paths(document) if not (ROOT / path).exists()]
    assert missing == []


@pytest.fixture(scope="module")
def generated() -> set[Path]:
    """The pages that only the built site has."""
    return {ROOT / "docs" / place for place in docs_site().generated_pages()}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_links_of_a_document_lead_somewhere(document: Path, generated: set[Path]) -> None:
    links = {(document.parent / link).resolve() for link in LINK.findall(document.read_text(encoding="utf-8"))}
    assert [link for link in links - generated if not link.exists()] == []
