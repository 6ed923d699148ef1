"""Words are data: every language has every text, with the same places, and every text has a user."""

import ast
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Formatter
from typing import Any

import click
import pytest
import typer

from calibration.sentences.sentence import LANGUAGES, sections_in, sentences_in
from daemon.cli.main import app
from tests.structure import ROOT, nodes_of, python_files

ROOMS = ("calibration", "daemon", "drivers", "extensions", "gateways", "handeyed", "protocols", "registration")
PAGE = ROOT / "daemon" / "page"
SENTENCES = ROOT / "calibration" / "sentences" / "words"
FILES = {  # by what has them; the errors say themselves what they are in English
    "sentences": [SENTENCES / f"{tag}.json" for tag in LANGUAGES],
    "page": [PAGE / "words" / f"{tag}.json" for tag in LANGUAGES],
    "errors of the page": [PAGE / "words" / f"errors.{tag}.json" for tag in LANGUAGES if tag != "en"],
    "reports": [ROOT / "daemon" / "reports" / "words" / f"{tag}.json" for tag in LANGUAGES],
}

VIEWS_OF_SCANS = (
    r".*(scan|cloud)[.-].*|findings/(sphere-|surfaces-|part-views|no-overlap|many-rejected-scans).*|views/view-no-overlap"
    r"|advice/(scan-from|add-overlap|give-rough-x)|refusals/(send-views|no-such-view-of-scan)"
    r"|handeyed (register|register-archive|stitch|verify-scanner).*"
)
"""A view of a scan is a cloud and its pose; what a run takes for a calibration is a picture."""

REPLACED: dict[str, dict[str, str]] = {  # by language: term that another replaced, and the ids where it may stand
    "en": {
        r"(?<!in |of )(?<!into )\bviews?\b": f"{VIEWS_OF_SCANS}|plausibility/look-along-z|handeyed assess.*",
        r"\bin force\b": "", r"\bpredict(ed|ion)\b": "", r"\bmapped\b": "", r"\bdisarm": "",
        r"\b[Vv]erif": r"handeyed verify-scanner.*", r"\bpolicy\b": "", r"worst of the points": "",
    },
    "de": {
        r"Ansicht": VIEWS_OF_SCANS, r"in Kraft|geltende": "", r"vorhergesagt": "", r"abgebildet": "findings/three-pose",
        r"[Ee]ntschärf": "", r"Verifi": "", r"\bTargets?\b": "", r"schlechteste[nr] Punkt|schlechtesten der": "",
    },
    "es": {
        r"(?<!a la )\bvistas?\b": f"{VIEWS_OF_SCANS}|rig.stations|nothing-measured.fix", r"en vigor|vigente": "",
        r"predicha": "", r"transformado": "", r"desarma": "", r"[Vv]erific": "",
    },
    "zh": {
        r"(?<![维正])视图": VIEWS_OF_SCANS, r"生效": "drift.left", r"解除使能": "", r"验证": "", r"最差的?(一)?点": "",
    },
}  # fmt: skip


def texts_of(file: Path) -> dict[str, str]:
    """By id, with its section before it where it has one. Raises ValueError for an id that stands twice."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        repeated = {name for name, _ in pairs if [other for other, _ in pairs].count(name) > 1}
        if repeated:
            raise ValueError(f"{file}: {repeated}")
        return dict(pairs)

    read = json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=once)
    return dict(flat(read))


def flat(read: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, value in read.items():
        if isinstance(value, str):
            yield name, value
        else:
            yield from ((f"{name}/{inner}", text) for inner, text in value.items())


def places_in(template: str) -> set[tuple[str, str]]:
    """Names and forms; what stands between the items of a list is of the language."""
    forms = {(name, form or "") for _, name, form, _ in Formatter().parse(template) if name is not None}
    return {(name, form if re.fullmatch(r"[+.a-z0-9%]*", form) else "list") for name, form in forms}


@pytest.mark.parametrize("file", [file for files in FILES.values() for file in files[1:]],
                         ids=lambda file: str(file.relative_to(ROOT)))  # fmt: skip
def test_every_language_says_the_same_things_with_the_same_values(file: Path) -> None:
    first = next(texts_of(files[0]) for files in FILES.values() if file in files)
    texts = texts_of(file)
    assert list(texts) == list(first), "the same ids in the same order"
    assert {i: places_in(text) for i, text in texts.items()} == {i: places_in(text) for i, text in first.items()}


def test_an_id_stands_in_one_section() -> None:
    assert sum(map(len, sections_in("en").values())) == len(sentences_in("en").templates)


def test_a_form_is_one_that_the_page_fills_too() -> None:
    """daemon/page/words/fill.js knows these, and lists."""
    known = re.compile(r"|views|picture|step|list|\+?(\.\d+)?[gf%]")
    forms = {form for file in FILES["sentences"] for text in texts_of(file).values() for _, form in places_in(text)}
    assert {form for form in forms if not known.fullmatch(form)} == set()


def test_every_sentence_has_a_user_and_every_use_a_sentence() -> None:
    """A user is a text in the code that is its id, or an f-string that can be, with a dash."""
    known = sentences_in("en").templates.keys()
    nodes = [node for file in python_files(*ROOMS) for node in nodes_of(file)]
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    built = {pattern_of(node) for node in nodes if isinstance(node, ast.JoinedStr)} - {None}
    said = {
        node.args[0].value
        for node in nodes
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Sentence"
        if node.args and isinstance(node.args[0], ast.Constant)
    }
    assert said - known == set(), f"give them in {SENTENCES}"
    unused = known - texts
    assert {one for one in unused if not any(re.fullmatch(str(pattern), one) for pattern in built)} == set()


def pattern_of(text: ast.JoinedStr) -> str | None:
    """What ids an f-string makes; None when its fixed parts are no part of an id."""
    fixed = [part.value for part in text.values if isinstance(part, ast.Constant)]
    if not re.fullmatch(r"[a-z-]*-[a-z-]*", "".join(map(str, fixed))):
        return None
    return "".join(str(part.value) if isinstance(part, ast.Constant) else "[a-z-]+" for part in text.values)


def test_every_text_of_the_page_has_a_user_and_every_use_a_text() -> None:
    """A user is a string that is its id, or a template with a dot that can be."""
    known = texts_of(FILES["page"][0]).keys()
    modules = [file for file in sorted(PAGE.rglob("*.js")) if "vendor" not in file.parts]
    source = "\n".join(module.read_text(encoding="utf-8") for module in modules)
    asked = set(re.findall(r"\bt\('([^']+)'", source))
    assert asked - known == set(), f"give them in {PAGE / 'words'}"
    texts = asked | set(re.findall(r"'([\w.-]+)'", source))
    built = [f"{re.escape(before)}[\\w-]+{re.escape(after)}"
             for before, after in re.findall(r"`([\w.-]+\.)\$\{[^}]*\}([\w.-]*)`", source)]  # fmt: skip
    unused = known - texts
    assert {one for one in unused if not any(re.fullmatch(pattern, one) for pattern in built)} == set()


def help_of(command: click.Command, name: str) -> Iterator[tuple[str, str]]:
    """What a command and its parameters say of themselves, and the commands below it."""
    yield name, command.help or ""
    yield from ((f"{name} {one.name}", getattr(one, "help", None) or "") for one in command.params)
    for inner, below in getattr(command, "commands", {}).items():
        yield from help_of(below, f"{name} {inner}")


@pytest.mark.parametrize("tag", LANGUAGES)
def test_a_term_that_was_replaced_stands_nowhere_else(tag: str) -> None:
    """docs/glossary.md has what a person reads; codes, keys and the names of the interface keep theirs."""
    said = [
        text for files in FILES.values() for file in files if file.stem.endswith(tag) for text in texts_of(file).items()
    ]
    if tag == "en":
        said += help_of(typer.main.get_command(app), "handeyed")
    left = {
        (term, place): text
        for term, allowed in REPLACED[tag].items()
        for place, text in said
        if re.search(term, re.sub(r"\{[^}]*\}", "", text)) and not re.fullmatch(allowed, place)
    }
    assert left == {}
