"""The how-to pages: every file they name exists, and none asks for more files than it may."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "how-to"
MAX_FILES = {"add-a-camera": 5, "add-a-target": 7, "add-a-route": 7, "add-an-error": 7, "add-a-robot": 7,
             "add-an-extension": 8}  # fmt: skip
ROOMS = (
    *(
        "calibration",
        "daemon",
        "deploy",
        "docs",
        "drivers",
        "extensions",
        "gateways",
        "mock_robot",
        "protocols",
        "registration",
    ),
    "tests",
)

each_page = pytest.mark.parametrize("page", MAX_FILES)


def text_of(page: str) -> str:
    return (PAGES / f"{page}.md").read_text()


def numbered(page: str) -> list[str]:
    """The items of the page's list of files."""
    return re.findall(r"^\d\. .*(?:\n   .*)*", text_of(page), re.MULTILINE)


def test_there_is_a_page_for_each_and_no_other() -> None:
    assert {file.stem for file in PAGES.glob("*.md")} == MAX_FILES.keys()


@each_page
def test_a_page_asks_for_no_more_files_than_it_may(page: str) -> None:
    items = numbered(page)
    assert 0 < len(items) <= MAX_FILES[page]
    assert f"At most {MAX_FILES[page]} files" in text_of(page)
    assert [item[0] for item in items] == [str(number) for number in range(1, len(items) + 1)]


@each_page
def test_every_file_that_a_page_names_is_there(page: str) -> None:
    named = re.findall(rf"`((?:{'|'.join(ROOMS)})/[^`\s]*|pyproject\.toml)`", text_of(page))
    assert named
    for name in named:
        place = ROOT / name
        while "<" in str(place):  # a file, or the folder of a brand, that is to be made
            place = place.parent
        assert place.exists(), f"{page}: {name}"
    for link in re.findall(r"\]\(([^)]*)\)", text_of(page)):
        assert (PAGES / link).exists(), f"{page}: {link}"


@each_page
def test_every_table_and_class_that_a_page_names_stands_in_the_file_it_names(page: str) -> None:
    for item in numbered(page):
        files = [ROOT / name for name in re.findall(r"`([\w./]+\.py)`", item) if "/" in name]
        files += [(PAGES / link).resolve() for link in re.findall(r"\]\(([^)]*\.py)\)", item)]
        text = "\n".join(file.read_text() for file in files)
        for word in re.findall(r"`([A-Z_]{3,}|Make[A-Z]\w+)`", item):
            assert word in text, f"{page}: {word} is in none of {[file.name for file in files]}"
