"""The interpreter knows what the product and a customer's program with EGM use of RAPID, and nothing else."""

import re
from collections.abc import Iterator
from pathlib import Path

from lark import Token

from calibration.documents.exports.formats import export, export_poses
from calibration.documents.exports.pose_list import pose_list
from mock_robot.rapid import instructions, statements
from mock_robot.rapid.controller import DEPLOYED
from mock_robot.rapid.program import builtins, system_types
from mock_robot.rapid.syntax import Node, name, parse_module, parse_system, parts
from tests.calibration.documents.exports.some_poses import ARM, POSES
from tests.conftest import ROOT
from tests.daemon.calibrations import a_calibration
from tests.mock_robot.rapid import customer_program

INTERPRETER = Path(instructions.__file__).parents[1]

UNUSED = {
    "exitcycle": "a program that calls the motion part may leave it so: the UNDO handlers of CELL_motion run then",
    **dict.fromkeys(
        ("signalai", "signalao", "signalgi", "signalgo"), "EIO.cfg of any HOME names signals of every kind"
    ),
}
"""Names that no program here uses, and why they are there."""
UNUSED_STATEMENTS = {
    **dict.fromkeys(("goto", "label"), "a controller refuses a GOTO into a loop, and the mock must, too"),
    "retry": "one of the four ends of a handler; the rules of deploy/rapid forbid it",
}
NUMBERS_AND_TEXTS = {"num", "dnum", "byte", "bool", "string", "errnum", "signaldo", "mecunit"}
"""Types of more than a list of values: a constant of them is used by its name only."""


def programs() -> Iterator[str]:
    """What is loaded into a controller, what is exported for one, and a customer's program with EGM."""
    yield from (path.read_text("ascii") for path in DEPLOYED.glob("CELL_*"))
    yield export(a_calibration("20261122-080000-abc123"), "rapid").decode("ascii")
    planned = pose_list("plan.json", POSES, ARM)
    yield from (export_poses(planned, f"rapid-{kind}").decode("ascii") for kind in ("robtarget", "jointtarget"))
    yield customer_program.PROGRAM


def words(node: Node) -> Iterator[str]:
    """Names in a program, without those of components and options."""
    if node.data == "component_of":
        return
    for child in node.children[node.data == "option" :]:
        if isinstance(child, Token):
            yield from [child.casefold()] if child.type == "NAME" else []
        elif child is not None:
            yield from words(child)


def header_types(header: Node) -> set[str]:
    """Types of a header's arguments and of its result."""
    result = {name(header, 0)} if header.data == "func_header" else set()
    return result | {name(each, 1) for each in header.find_data("parameter")}


def used(texts: Iterator[str]) -> set[str]:
    """Names of system.rapid that programs need: those they name, and what the headers and records of those name.

    A constant is needed as the value of an argument, too, and an error when the interpreter raises it.
    """
    found = {word for text in texts for word in words(parse_module(text, "a program"))}
    found |= {error.casefold() for file in INTERPRETER.rglob("*.py") for error in raised(file)}
    system = parts(parse_system())
    headers = {name(each, int(each.data == "func_header")): each for each in system if "header" in each.data}
    arguments = {kind for called in headers.keys() & found for kind in header_types(headers[called])}
    data = {name(each, 3): name(each, 2) for each in parts(parse_system(), "data")}
    found |= arguments | {each for each, kind in data.items() if kind in arguments - NUMBERS_AND_TEXTS}
    found |= {kind for each, kind in data.items() if each in found}
    records = {name(each, 1): {name(c, 0) for c in parts(each)} for each in system if each.data == "record"}
    while wider := {kind for each in records.keys() & found for kind in records[each]} - found:
        found |= wider
    return found


def raised(file: Path) -> list[str]:
    return re.findall(r'"(ERR_\w+)"', file.read_text("utf-8"))


def known() -> set[str]:
    data = {name(each, 3) for each in parts(parse_system(), "data")}
    return {each.name for each in builtins()} | system_types().keys() | data


def test_every_name_serves_the_product_or_a_customers_program() -> None:
    assert known() - used(programs()) == UNUSED.keys()


def test_every_statement_serves_one_of_them() -> None:
    used_there = {node.data for text in programs() for node in parse_module(text, "a program").iter_subtrees()}
    assert statements._KINDS.keys() - used_there == UNUSED_STATEMENTS.keys()


def test_a_name_that_no_program_uses_is_found() -> None:
    alone = ["MODULE one\nPROC main()\nWaitTime 1;\nENDPROC\nENDMODULE\n"]
    assert {"waittime", "num"} <= used(iter(alone))
    assert {"movej", "egmident", "v100", "robtarget"} <= known() - used(iter(alone))


def test_the_documentation_counts_them() -> None:
    shipped = used(path.read_text("ascii") for path in DEPLOYED.glob("CELL_*"))
    known_ones = {each.name for each in builtins()}
    with_egm, rest = known_ones - shipped - UNUSED.keys(), known_ones & UNUSED.keys()
    text = (ROOT / "docs" / "rapid.md").read_text("utf-8")
    assert f"{len(known_ones)} instructions and functions" in text
    assert (
        f"The shipped modules use {len(known_ones & shipped)} of them and a program with EGM {len(with_egm)} more"
        in text
    )
    assert rest == {"exitcycle"}
