"""The counts of `python -m tests.structure` stay within their limits."""

import ast
import re
from pathlib import Path

import pytest

from tests import structure
from tests.conftest import ROOT

MODULES = (
    "benchmarks",
    "calibration",
    "daemon",
    "drivers",
    "extensions",
    "gateways",
    "handeyed",
    "mock_robot",
    "protocols",
    "registration",
    "tests",
)
MAX_LINES = 600


@pytest.mark.parametrize("room", structure.ROOMS)
def test_no_units_of_a_room_import_each_other_in_a_circle(room: str) -> None:
    assert structure.room_of(structure.import_graph(), room).cycles == []


@pytest.mark.parametrize(("room", "limit"), structure.MAX_UNITS.items())
def test_a_room_has_few_units_at_its_root(room: str, limit: int) -> None:
    assert structure.room_of(structure.import_graph(), room).units <= limit


def test_no_files_import_each_other_in_a_circle() -> None:
    assert structure.cycles_of(structure.import_graph()) == []


def test_no_module_is_longer_than_contributing_says() -> None:
    lengths = {file: len(file.read_text().splitlines()) for room in MODULES for file in (ROOT / room).rglob("*.py")}
    assert {str(file): length for file, length in lengths.items() if length > MAX_LINES} == {}


def test_nothing_gets_heavier() -> None:
    heavier = {one.about: one.count for one in structure.weights() if one.count > structure.MAX_WEIGHTS[one.about]}
    assert heavier == {}


@pytest.mark.parametrize(
    "file", [file for file in structure.python_files(*structure.ROOMS) if file.stem in ("errors", "http_errors")]
)
def test_the_tree_of_a_rooms_errors_names_its_classes(file: Path) -> None:
    module = ast.parse(file.read_text(encoding="utf-8"))
    classes = {node.name for node in module.body if isinstance(node, ast.ClassDef)}
    assert set(re.findall(r"── (\w+)", ast.get_docstring(module) or "")) <= classes


def test_functions_are_verbs() -> None:
    counted = [structure.participle_functions(room) for room in structure.ROOMS]
    named, total = [name for names, _ in counted for name in names], sum(number for _, number in counted)
    assert len(named) <= structure.MAX_PARTICIPLE_SHARE * total, named


def test_told_and_tells_are_rare() -> None:
    lines = structure.told_lines(*structure.ROOMS)
    assert len(lines) < structure.MAX_TOLD, lines


def test_no_test_imports_from_another_test_module() -> None:
    assert structure.imports_between_tests() == []


def test_benchmarks_import_tests_and_never_the_other_way() -> None:
    assert structure.benchmarks_in_tests() == []


def test_tests_of_the_core_go_by_no_extension() -> None:
    """Those of the page are beside it: its parts for touch tests are the core's."""
    named = [
        f"{file.relative_to(ROOT)} -> {module}"
        for room in structure.CORE
        for file in structure.python_files(f"tests/{room}")
        if "page" not in file.parts
        for module, _ in structure.outline_of(file).imported_from
        if re.match(r"(tests\.)?extensions\.(?!installed|commands)", module)
    ]
    assert named == []


def test_a_circle_is_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}
    assert structure.cycles_of(graph) == [["b", "c"]]


@pytest.mark.parametrize(
    ("word", "expected"), [("moved", True), ("told", True), ("move", False), ("seed", False), ("read", False)]
)
def test_participles_are_recognised(word: str, expected: bool) -> None:
    assert structure.is_participle(word) is expected


def test_the_rooms_that_call_opencv_are_tried_under_opencv_4() -> None:
    chosen = re.search(r"OPENCV4_TESTS \?= \$\(addprefix tests/,(.*?)\)", (ROOT / "Makefile").read_text(), re.DOTALL)
    assert chosen is not None
    calling = {
        file.parent.relative_to(ROOT).as_posix()
        for room in ("calibration", "registration")
        for file in (ROOT / room).glob("*/**/*.py")
        if "import cv2" in file.read_text(encoding="utf-8")
    }
    assert calling
    assert calling <= set(chosen[1].split())
