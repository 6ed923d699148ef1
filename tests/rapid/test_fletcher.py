"""The sum as the RAPID computes it, step by step from the module's own tree, on the published frames."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lark import Token, Tree

from mock_robot.rapid.syntax import parse_module

COMM = Path(__file__).parents[2] / "deploy" / "rapid" / "CELL_comm.mod"
OPERATORS = {
    "+": lambda a, b: a + b,
    "*": lambda a, b: a * b,
    "MOD": lambda a, b: a % b,
    "<>": lambda a, b: a != b,
}


class Returned(Exception):
    pass


def evaluate(node: "Tree[Token]", names: dict[str, Any]) -> Any:
    match node.data:
        case "number":
            return float(str(node.children[0]))
        case "target":
            return names[str(node.children[0])]
        case "conjunction":
            return all(evaluate(child, names) for child in node.children)  # type: ignore[arg-type]
        case _:
            value = evaluate(node.children[0], names)  # type: ignore[arg-type]
            for operator, right in zip(node.children[1::2], node.children[2::2], strict=True):
                value = OPERATORS[str(operator)](value, evaluate(right, names))  # type: ignore[arg-type]
            return float(np.float32(value)) if isinstance(value, float) else value


def run(statement: Any, names: dict[str, Any]) -> None:
    parts = statement.children
    match statement.data:
        case "assign":
            names[str(parts[0].children[0])] = evaluate(parts[1], names)
        case "call":
            data, position, into, option = parts[1].children
            assert str(parts[0]) == "UnpackRawBytes"
            assert str(option.children[1].children[0]) == "USINT"
            names[str(into.children[0])] = float(names[str(data.children[0])][int(evaluate(position, names)) - 1])
        case "for_":
            for number in range(int(evaluate(parts[1], names)), int(evaluate(parts[2], names)) + 1):
                for inner in parts[3].children:
                    names[str(parts[0])] = float(number)
                    run(inner, names)
        case "if_":
            if evaluate(parts[0], names):
                for inner in parts[1].children:
                    run(inner, names)
        case "return_":
            raise Returned(evaluate(parts[0], names))
        case other:
            raise AssertionError(other)


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("43 42 01 01 01 00 00 00 00 00 88 0a", 0x0A88),
        ("43 42 01 02 02 00 00 00 08 00 94 c7 01 00 00 00 01 00 00 00", 0xC794),
    ],
)
def test_the_published_sums_come_out_of_the_rapid(frame: str, expected: int) -> None:
    tree = parse_module(COMM.read_text("ascii"), COMM.name)
    function = next(f for f in tree.find_data("func") if str(f.children[1]) == "cell_fletcher")
    data = bytes.fromhex(frame)
    names: dict[str, Any] = {"data": data, "count": float(len(data)), "low": 0.0, "high": 0.0}
    body = next(child for child in function.children if isinstance(child, Tree) and child.data == "body")
    with pytest.raises(Returned) as returned:
        for statement in body.children:
            if isinstance(statement, Tree) and statement.data != "data":
                run(statement, names)
    assert returned.value.args[0] == expected
