"""The documentation: what is generated is complete, the site builds strictly, and its sentences are short."""

import json
import re
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import typer

from daemon.cli.main import app
from tests.structure import ROOT
from tests.support.docs_site import docs_site

DOCS = ROOT / "docs"
MAX_WORDS = 40
WHY = ("architecture.md", "arm-errors.md", "benchmarks.md", "decisions", "why")
"""Pages of reasons may have longer sentences."""

LONGER = {"page.md": 7, "reliability.md": 15, "rws.md": 3}
"""Sentences above MAX_WORDS that are still there, by page: fewer is welcome, more is not."""


@pytest.fixture(scope="module")
def generated() -> dict[str, str]:
    pages: dict[str, str] = docs_site().generated_pages()
    return pages


AS_MKDOCS_LOADS_A_HOOK = """
import importlib.util, sys
sys.path.append({libraries!r})
before = sys.path.copy()
found = importlib.util.spec_from_file_location("docs_site", {file!r})
module = importlib.util.module_from_spec(found)
found.loader.exec_module(module)
sys.path[:] = before
print(*module.generated_pages())
"""


def test_a_release_generates_the_pages_where_handeyed_is_not_installed(tmp_path: Path) -> None:
    """deploy/release.sh builds the site with the libraries alone."""
    libraries, file = sysconfig.get_path("purelib"), str(ROOT / "deploy" / "docs_site.py")
    code = AS_MKDOCS_LOADS_A_HOOK.format(libraries=libraries, file=file)
    command = [sys.executable, "-I", "-S", "-c", code]  # -S: the editable installation is not there
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "reference/commands.md" in ran.stdout.split()


def test_every_operation_has_a_heading_and_a_line_in_the_index(generated: dict[str, str]) -> None:
    openapi = json.loads((DOCS / "openapi.json").read_text())
    for path, methods in openapi["paths"].items():
        for method, operation in methods.items():
            page = generated[f"api/{operation['tags'][0]}.md"]
            assert f"## {method.upper()} {path} {{" in page
            assert f"[`{method.upper()} {path}`](" in generated["api/operations.md"]
    for name in openapi["components"]["schemas"]:
        assert f"## {name} {{" in generated["api/documents.md"]


def test_every_section_of_the_settings_has_a_heading(generated: dict[str, str]) -> None:
    example = (ROOT / "deploy" / "handeyed.example.toml").read_text()
    named = re.findall(r"^#?\[+([a-z_.]+)\]+$", example, re.MULTILINE)
    assert len(named) > 20
    assert [name for name in named if f"[{name}]" not in generated["reference/settings.md"]] == []
    assert generated["reference/settings.md"].count("## [") > 20


def test_every_command_has_a_heading_with_its_options(generated: dict[str, str]) -> None:
    commands = list(commands_of(typer.main.get_command(app), "handeyed"))
    assert len(commands) > 40
    for words, command in commands:
        assert f"## {words}\n" in generated["reference/commands.md"]
        for param in command.params:
            assert (
                param.opts[0] == "--help"
                or param.opts[0] in generated["reference/commands.md"]
                or not param.opts[0].startswith("-")
            )


def commands_of(group: Any, words: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands_of(command, f"{words} {name}")
        else:
            yield f"{words} {name}", command


def test_every_metric_that_a_rule_asks_for_is_listed(generated: dict[str, str]) -> None:
    rules = (ROOT / "deploy" / "prometheus" / "handeyed.rules.yml").read_text()
    asked = set(re.findall(r"\bhandeyed_[a-z_]+\b", rules))
    assert asked
    assert {name for name in asked if f"`{name}`" not in generated["reference/metrics.md"]} == set()


def test_links_out_of_the_site_are_changed_or_left_as_words() -> None:
    relinked = docs_site().relinked
    links = ("../SECURITY.md#keys", "../daemon/server.py", "plc.md#drift", "how-to/add-a-robot.md", "https://x.y")
    text = " ".join(f"[{name}]({link})" for name, link in zip("abcde", links, strict=True))
    found = relinked(text, DOCS, "")
    assert found == "[a](security.md#keys) b [c](plc.md#drift) [d](how-to/add-a-robot.md) [e](https://x.y)"
    assert relinked("[a](docs/plc.md) [b](docs/how-to)", ROOT, "") == "[a](plc.md) b"
    assert relinked("[a](../reference/codes.md)", DOCS / "use", "../") == "[a](../reference/codes.md)"
    assert relinked("[a](../nowhere.md)", DOCS / "use", "../") == "[a](../nowhere.md)", "the strict build names it"


@pytest.mark.slow
def test_the_site_builds_strictly_and_asks_no_other_server(tmp_path: Path) -> None:
    if find_spec("material") is None:
        pytest.skip("mkdocs-material is not installed: pip install --group docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(tmp_path / "site")]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 50
    for page in pages:
        text = page.read_text()
        assert not re.findall(r"<script(?![^>]*(?:src=|application/json))[^>]*>", text), page
        loaded = re.findall(r'<(?:script|img)[^>]*src="([^"]+)"|<link[^>]*rel="stylesheet"[^>]*href="([^"]+)"', text)
        assert [one for pair in loaded for one in pair if "//" in one] == [], page
    found = json.loads((tmp_path / "site" / "search" / "search_index.json").read_text())
    assert any("hek_" in entry["text"] or "Idempotency" in entry["text"] for entry in found["docs"])


def sentences_of(markdown: str) -> Iterator[str]:
    """Sentences of paragraphs, list items and cells; code and addresses count as one word."""
    text = re.sub(r"```.*?```|<!--.*?-->", "\n\n", markdown, flags=re.DOTALL)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.)\s)|\n(?=\|)|(?<!\\)\|", text):
        plain = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "code", " ".join(block.split())))
        yield from re.split(r"(?<=[.!?])\s+(?=[A-Z\[*(]|code)", plain)


def words_of(sentence: str) -> int:
    return len(re.findall(r"\w[\w'’./%°±-]*", sentence))


def test_sentences_are_counted() -> None:
    assert [words_of(one) for one in sentences_of("One two. Three `a b c` four.\n\n| five | six seven |")] == [
        2,
        3,
        0,
        1,
        2,
        0,
    ]


def pages() -> list[Path]:
    root = [ROOT / name for name in ("README.md", "SECURITY.md", "CONTRIBUTING.md")]
    return root + [page for page in sorted(DOCS.rglob("*.md")) if page.relative_to(DOCS).parts[0] not in WHY]


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_no_sentence_outside_why_has_more_than_forty_words(page: Path) -> None:
    long = [one for one in sentences_of(page.read_text(encoding="utf-8")) if words_of(one) > MAX_WORDS]
    assert len(long) <= LONGER.get(page.name, 0), "\n\n".join(long)
