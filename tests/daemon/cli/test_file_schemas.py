"""Schemas of files: published as printed, every field with a meaning, examples that the commands take as they are."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema_rs
import numpy as np
import pytest

from calibration.documents.validation import Document, parse_document
from calibration.errors import DocumentError
from tests.calibration.documents.file_schemas import FILES, schema_of
from tests.daemon.cli.running import handeyed
from tests.structure import nodes_of, python_files

DOCS = Path(__file__).parents[3] / "docs"
FORMATS = (DOCS / "formats.md").read_text(encoding="utf-8")


def _parts(name: str) -> dict[str, dict[str, Any]]:
    schema = schema_of(name)
    return {FILES[name].model.__name__: schema, **schema.get("$defs", {})}


@pytest.mark.parametrize("name", FILES)
def test_the_published_schema_is_the_printed_one(name: str) -> None:
    printed = json.loads(handeyed("schema", name).out)
    published = json.loads((DOCS / f"{name}.schema.json").read_text())
    assert printed == published, "python -m tests.calibration.documents.schema_file"


@pytest.mark.parametrize("name", FILES)
def test_every_field_has_a_meaning(name: str) -> None:
    fields = [(part, field, described) for part, model in _parts(name).items() for field, described in
              model.get("properties", {}).items()]  # fmt: skip
    assert fields
    assert [(part, field) for part, field, described in fields if not described.get("description")] == []


def test_a_plan_does_not_say_that_it_may_leave_out_what_it_needs() -> None:
    """Its target is required, that of a session is not."""
    plan, session = schema_of("plan"), schema_of("session")
    assert "target" in plan["required"]
    assert "left out" not in plan["properties"]["target"]["description"]
    assert "target" not in session["required"]
    assert "left out" in session["properties"]["target"]["description"]


@pytest.mark.parametrize("name", [name for name, kind in FILES.items() if kind.example is not None])
def test_the_example_is_valid(name: str) -> None:
    schema = schema_of(name)
    (example,) = schema["examples"]
    jsonschema_rs.validator_for(schema).validate(example)
    FILES[name].model.model_validate(example)


def test_the_examples_run(tmp_path: Path) -> None:
    (tmp_path / "session.json").write_text(json.dumps(schema_of("session")["examples"][0]))
    calibration = tmp_path / "calibration.json"
    solved = handeyed("solve", tmp_path, "--json", "--out", calibration)
    assert solved.status in (0, 3), solved.err
    jsonschema_rs.validator_for(schema_of("calibration")).validate(json.loads(solved.out))

    (tmp_path / "plan.json").write_text(json.dumps(schema_of("plan")["examples"][0]))
    planned = handeyed("plan", tmp_path / "plan.json", "--json")
    assert planned.status == 0, planned.err

    scan = schema_of("scan")["examples"][0]
    (tmp_path / "scan.json").write_text(json.dumps(scan))
    points = np.random.default_rng(2).uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.6], (200, 3))
    axes = [f"property float {axis}" for axis in "xyz"]
    header = ["ply", "format ascii 1.0", "element vertex 200", *axes, "end_header"]
    for view in scan["views"]:
        (tmp_path / view["cloud"]).write_text("\n".join([*header, *(" ".join(map(str, row)) for row in points)]) + "\n")
    registered = handeyed("register", tmp_path, "--calibration", calibration, "--out", tmp_path / "out.ply", "--json")
    assert registered.status in (0, 3), registered.err
    jsonschema_rs.validator_for(schema_of("report")).validate(json.loads(registered.out))


@pytest.mark.parametrize("name", ["scan", "plan", "points", "tip", "manifest", "outcome", "acceptance", "setup",
                                  "detections", "backup"])  # fmt: skip
def test_the_example_stands_in_formats_md(name: str) -> None:
    _, _, below = FORMATS.partition(f"### {_title(name)}\n")
    shown = below.partition("\n### ")[0].partition("```json\n")[2].partition("```")[0]
    assert [json.loads(shown)] == schema_of(name)["examples"]


@pytest.mark.parametrize("name", FILES)
def test_an_error_names_the_heading_of_its_file(name: str) -> None:
    with pytest.raises(DocumentError) as refused:
        parse_document(FILES[name].model, b"{", "a file")
    (named,) = re.findall(r"\(docs/formats\.md#([\w-]+)\)", str(refused.value))
    assert named == getattr(FILES[name].model, "heading", "")
    assert f"### {_title(name)}\n" in FORMATS


def _title(name: str) -> str:
    """The heading of docs/formats.md whose anchor the model names."""
    titles = re.findall(r"^### (.+)$", FORMATS, re.MULTILINE)
    return next(title for title in titles if title.replace(".", "").lower() == FILES[name].model.heading)  # type: ignore[attr-defined]


# --- nothing goes in or out that docs do not describe ---

ROOMS = ("calibration", "daemon", "drivers", "extensions", "handeyed", "mock_robot", "registration")
DATA_FILE = re.compile(r"[\w.{}-]*\w+\.(?:json|jsonl|npz|npy|csv|tsv|yaml)")


def _named_files() -> Iterator[str]:
    """The names of data files in string constants of the source; docstrings, messages and its own tables aside."""
    for file in python_files(*ROOMS):
        for node in nodes_of(file):
            if isinstance(node, ast.Constant) and isinstance(name := node.value, str) and DATA_FILE.fullmatch(name):
                yield from [] if file.with_name(name).exists() else [name]


def test_every_file_that_the_source_names_is_described() -> None:
    named = set(_named_files())
    assert {"session.json", "manifest.json", "audit-anchor.json"} <= named
    pages = FORMATS + (DOCS / "exports.md").read_text(encoding="utf-8")
    assert sorted(name for name in named if name not in pages) == []


def test_every_document_that_a_command_writes_or_prints_has_a_schema() -> None:
    described = {getattr(kind.model, "heading", "") for kind in FILES.values()}
    assert {model.heading for model in _below(Document) if model.heading} == described


def _below(model: type[Document]) -> Iterator[type[Document]]:
    for each in model.__subclasses__():
        yield each
        yield from _below(each)
