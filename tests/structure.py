"""Counts of the structure, from the source as it stands: `python -m tests.structure [--weights]`.

A unit is a module or package at the root of a room; an arrow is an import from one unit to another of the same room.
`tests/test_rooms.py` compares the counts with their limits; import-linter checks the order of the layers.
"""

import argparse
import ast
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORE = ("calibration", "daemon", "drivers", "mock_robot", "protocols", "registration")
ROOMS = (*CORE, "extensions", "gateways")
SERVICE_ROOTS = ("daemon.composition", "daemon.server", "daemon.api.routes")

MAX_UNITS = {"calibration": 24, "daemon": 22, "mock_robot": 14, "registration": 10}
MAX_WEIGHTS = {
    "lines of Python of the core": 90_659,
    "lines of Python with the extensions": 97_148,
    "lines of Python of the core that the service imports": 64_180,
    "lines of Python of the gateways": 1_322,
    "files of the fullest folder": 34,
    "private functions used once": 664,
    "of them of at most 8 lines": 249,
    "functions of 8 parameters or more": 32,
    "pairs of a dataclass and a document with the same fields": 24,
    "converters between them: of, of_row, of_record, row": 30,
    "files that name: external axis": 34,
    "files that name: arm errors and conditions": 22,
    "files that name: touch tests": 17,
    "files that name: further sensors": 14,
}
"""Ratchets: a change that lightens one lowers its limit, and none is raised."""

MAX_PARTICIPLE_SHARE = 0.03
MAX_TOLD = 15

IRREGULAR_PARTICIPLES = """
begun bought brought built caught chosen dealt done drawn driven fallen forgotten found frozen given gone grown heard
held hidden kept known laid led lit lost made met said seen sent shown sought spent spoken stood taken taught thrown
told understood worn woven written
"""
NOT_PARTICIPLES = frozenset({"embed", "exceed", "feed", "need", "proceed", "seed", "shed", "speed"})

TOPICS = {
    "external axis": r"external_axis|ExternalAxis",
    "arm errors and conditions": r"ArmConditions|arm_conditions|CalibrationInUse|with_arm",
    "touch tests": r"touch(es|_test|_tests)?\b|Touch(?!ing)",
    "further sensors": r"MAIN_CAMERA|MAIN_SCANNER",
}
"""Features that are not of every cell, by the words that name them in a file of the core."""

MANY_PARAMETERS = 8
SHORT_FUNCTION = 8

Graph = dict[str, set[str]]


@dataclass(frozen=True)
class Room:
    """Units at a room's root, imports between them, and the groups of units that import each other in a circle."""

    name: str
    units: int
    arrows: int
    cycles: list[list[str]]


def python_files(*folders: str) -> Iterator[Path]:
    """Python files below `folders` of the repository, sorted."""
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def nodes_of(file: Path) -> Iterator[ast.AST]:
    """All nodes of a file's syntax tree."""
    return ast.walk(ast.parse(file.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class Outline:
    """The names that a file's `import` and `from ... import` statements give, and of its functions, at any depth."""

    imported: frozenset[str]
    imported_from: frozenset[tuple[str, str]]
    functions: tuple[str, ...]


@cache
def outline_of(file: Path) -> Outline:
    """Its outline; each file is parsed once; the tree, far larger, is not kept."""
    nodes = list(_statements(ast.parse(file.read_text(encoding="utf-8"))))
    return Outline(
        frozenset(alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names),
        frozenset(
            (node.module, alias.name)
            for node in nodes
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        ),
        tuple(node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)),
    )


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """The statements below `node` at any depth; expressions, nine of ten nodes, hold none."""
    for block in ("body", "orelse", "handlers", "finalbody", "cases"):
        for inner in getattr(node, block, ()):
            yield inner
            yield from _statements(inner)


def module_name(file: Path) -> str:
    """Dotted name of `file`; a package's name for its `__init__.py`."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def imports_of(file: Path, modules: Collection[str]) -> set[str]:
    """Those of `modules`, a set or the keys of a mapping, that `file` imports, at any depth of its code."""
    outline = outline_of(file)
    found = {name for name in outline.imported if name in modules}
    for module, name in outline.imported_from:
        found |= {next((each for each in (f"{module}.{name}", module) if each in modules), "")}
    return found - {""}


@cache
def import_graph() -> Graph:
    """Imports between all modules of the rooms."""
    files = {module_name(file): file for file in python_files(*ROOMS)}
    return {module: imports_of(file, files) for module, file in files.items()}


def of_the_service() -> set[Path]:
    """Files of the core that the daemon imports, at once or later: not what only commands use, nor the mock."""
    files = {module_name(file): file for file in python_files(*CORE)}
    reached = set().union(*(_reachable(import_graph(), root) | {root} for root in SERVICE_ROOTS))
    packages = {module.rsplit(".", depth)[0] for module in reached for depth in range(1, module.count(".") + 1)}
    return {files[module] for module in (reached | packages) & files.keys()}


def room_of(graph: Graph, name: str) -> Room:
    """The room `name` of a module graph, its modules folded into the units at its root."""
    units: Graph = {module.split(".")[1]: set() for module in graph if module.startswith(f"{name}.")}
    for module, targets in graph.items():
        for target in targets:
            source_unit, target_unit = (dotted.split(".")[1:2] for dotted in (module, target))
            if module.split(".")[0] == target.split(".")[0] == name and source_unit and target_unit:
                units[source_unit[0]] |= set(target_unit) - set(source_unit)
    return Room(name, len(units), sum(map(len, units.values())), cycles_of(units))


def cycles_of(graph: Graph) -> list[list[str]]:
    """Strongly connected components of more than one node, sorted."""
    reached = {node: _reachable(graph, node) for node in graph}
    groups = {frozenset({node, *(other for other in reached[node] if node in reached[other])}) for node in graph}
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _reachable(graph: Graph, start: str) -> set[str]:
    found: set[str] = set()
    ahead = [start]
    while ahead:
        ahead += (new := graph.get(ahead.pop(), set()) - found)
        found |= new
    return found


def participle_functions(folder: str) -> tuple[list[str], int]:
    """`file:function` of each function of `folder` named by a past participle first, and the number of functions."""
    names, total = [], 0
    for file in python_files(folder):
        functions = outline_of(file).functions
        total += len(functions)
        names += [
            f"{file.relative_to(ROOT)}:{each}" for each in functions if is_participle(each.strip("_").split("_")[0])
        ]
    return names, total


def is_participle(word: str) -> bool:
    """Whether `word` is a past participle by its ending, or one of the irregular ones."""
    return word in IRREGULAR_PARTICIPLES.split() or (word.endswith("ed") and word not in NOT_PARTICIPLES)


def told_lines(*folders: str) -> list[str]:
    """`file:line` of each line of `folders` with the word told, tell or tells, as a word or part of a name."""
    word = re.compile(r"(?<![A-Za-z])(told|tells?)(?![A-Za-z])")
    return [
        f"{file.relative_to(ROOT)}:{number}"
        for file in python_files(*folders)
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if word.search(line)
    ]


def imports_between_tests() -> list[str]:
    """`importer -> test module` for each import of a test module by a test or benchmark."""
    return [
        f"{file.relative_to(ROOT)} -> {module}"
        for file, module in _imports_below("tests", "benchmarks")
        if module.startswith("tests.") and module.rsplit(".", 1)[1].startswith("test_")
    ]


def benchmarks_in_tests() -> list[str]:
    """`test -> benchmark` for each import of a benchmark below tests/."""
    return [
        f"{file.relative_to(ROOT)} -> {module}"
        for file, module in _imports_below("tests")
        if module.split(".")[0] == "benchmarks"
    ]


def _imports_below(*folders: str) -> Iterator[tuple[Path, str]]:
    modules = {module_name(file) for file in python_files("tests", "benchmarks")} | {"benchmarks", "tests"}
    for file in python_files(*folders):
        for module in sorted(imports_of(file, modules)):
            yield file, module


@dataclass(frozen=True)
class Weight:
    """A count that may fall and must not rise."""

    about: str
    count: int


def weights() -> list[Weight]:
    """What makes the product heavy: lines, folders, functions used once, shapes of a noun, features in many files."""
    core = {file: file.read_text(encoding="utf-8") for file in python_files(*CORE, "handeyed")}
    added = {file: file.read_text(encoding="utf-8") for file in python_files("extensions")}
    of_gateways = [file.read_text(encoding="utf-8") for file in python_files("gateways")]
    texts = core | added
    trees = [ast.parse(text) for text in texts.values()]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names = Counter(
        node.id if isinstance(node, ast.Name) else node.attr
        for node in nodes
        if isinstance(node, ast.Name | ast.Attribute)
    )
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    private = [one for one in functions if one.name.startswith("_") and not one.name.startswith("__")]
    once = [one for one in private if names[one.name] == 1]
    short = [one for one in once if (one.end_lineno or one.lineno) - one.lineno < SHORT_FUNCTION]
    wide = [one for one in functions if len(one.args.args) + len(one.args.kwonlyargs) >= MANY_PARAMETERS]
    folders = Counter(file.parent for file in texts)
    return [
        Weight("lines of Python of the core", _lines(core.values())),
        Weight("lines of Python with the extensions", _lines([*core.values(), *added.values()])),
        Weight("lines of Python of the core that the service imports", _lines(core[file] for file in of_the_service())),
        Weight("lines of Python of the gateways", _lines(of_gateways)),
        Weight("files of the fullest folder", max(folders.values())),
        Weight("private functions used once", len(once)),
        Weight(f"of them of at most {SHORT_FUNCTION} lines", len(short)),
        Weight(f"functions of {MANY_PARAMETERS} parameters or more", len(wide)),
        Weight("pairs of a dataclass and a document with the same fields", len(_twins(trees))),
        Weight("converters between them: of, of_row, of_record, row", _converters(trees)),
        *(
            Weight(f"files that name: {topic}", sum(bool(re.search(words, text)) for text in core.values()))
            for topic, words in TOPICS.items()
        ),
    ]


def _lines(texts: Iterable[str]) -> int:
    return sum(len(text.splitlines()) for text in texts)


def _twins(trees: Sequence[ast.Module]) -> list[tuple[str, str]]:
    """Pairs of a dataclass and a pydantic model of which at least three fields, and half of all, are the same."""
    classes = [node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)]
    bases: dict[str, set[str]] = {}
    for one in classes:  # of one name there may be several
        bases.setdefault(one.name, set()).update(ast.unparse(base).split("[")[0] for base in one.bases)
    models = {"BaseModel"}
    while more := {name for name, above in bases.items() if above & models and name not in models}:
        models |= more
    rows: list[tuple[str, set[str]]] = []
    documents: list[tuple[str, set[str]]] = []
    for one in classes:
        fields = {
            ast.unparse(each.target)
            for each in one.body
            if isinstance(each, ast.AnnAssign) and "ClassVar" not in ast.unparse(each.annotation)
        }
        if one.name in models:
            documents.append((one.name, fields))
        elif any("dataclass" in ast.unparse(decorator) for decorator in one.decorator_list):
            rows.append((one.name, fields))
    return [
        (row, document)
        for row, fields in rows
        for document, others in documents
        if len(fields & others) >= 3 and 2 * len(fields & others) >= len(fields | others)
    ]


def _converters(trees: Sequence[ast.Module]) -> int:
    """Methods that turn one shape of a noun into another."""
    return sum(
        isinstance(method, ast.FunctionDef) and method.name in {"of", "of_row", "of_record", "row"}
        for tree in trees
        for one in tree.body
        if isinstance(one, ast.ClassDef)
        for method in one.body
    )


def main() -> None:
    """Print all counts beside their limits."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", action="store_true", help="what makes the product heavy, beside its limits")
    if parser.parse_args().weights:
        for weight in weights():
            print(f"{weight.about:62}{weight.count:>8}{MAX_WEIGHTS[weight.about]:>8}")
        return
    graph = import_graph()
    print(f"{'room':14}{'units':>6}{'limit':>7}{'arrows':>8}  cycles of units")
    for name in ROOMS:
        room = room_of(graph, name)
        print(f"{name:14}{room.units:>6}{MAX_UNITS.get(name, '-'):>7}{room.arrows:>8}  {room.cycles or 'none'}")
    print(f"cycles of files: {cycles_of(graph) or 'none'}")
    shares: dict[str, tuple[int, int]] = defaultdict(lambda: (0, 0))
    for name in ROOMS:
        names, total = participle_functions(name)
        shares[name] = len(names), total
    found, functions = (sum(column) for column in zip(*shares.values(), strict=True))
    print(f"functions named by a participle: {found} of {functions}, {found / functions:.1%} (at most 3 %)")
    for name, (few, total) in shares.items():
        print(f"    {name}: {few} of {total}, {few / total:.1%}")
    print(f"lines with told, tell, tells: {len(told_lines(*ROOMS))} (fewer than {MAX_TOLD})")
    print(f"imports of a test module: {len(imports_between_tests())} (none)")
    print(f"imports of benchmarks in tests: {len(benchmarks_in_tests())} (none)")


if __name__ == "__main__":
    main()
