"""Compares the headers of system.rapid with the syntax of ABB's manual.

`python -m tests.mock_robot.rapid.manual_signatures FILE`: FILE is `resources/rapid-language-data.json` of the public
project ichbinmeraj/abb-rws-vscode, 705 entries of the RobotWare 6 manual 3HAC050917-001, parsed from its text. It is no
part of this project.
"""

import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

from mock_robot.rapid.program import builtins
from mock_robot.rapid.scope import Builtin
from mock_robot.rapid.syntax import name, parse_system, parts
from mock_robot.rapid.types import Array

_ARGUMENT = re.compile(
    r"(\\\s*'?\s*)?\b([A-Za-z]\w*)\b\s*\]?'?\s*(?::?\s*=|:')\s*'?\s*\]?\s*<([^>]*)>"  # Name := < of type >
    r"|\\\s*'?\s*([A-Za-z]\w*)"  # a switch
)
_ALTERNATIVE = re.compile(r"\|\s*\[?\s*$")
_ENDS = re.compile(r"';|'\)'|A function with")
"""A syntax without one of these is cut off in the file: what is missing at its end is not counted."""
_TYPE = re.compile(r"of\s+(?:type\s+)?([\w ]+)")


class Argument(NamedTuple):
    """One argument as the manual has it."""

    name: str
    optional: bool
    type: str


def arguments_of(syntax: str) -> list[Argument]:
    """Arguments of a syntax in the manual's notation, in order; of required alternatives (num | dnum) the first."""
    found = []
    for match in _ARGUMENT.finditer(syntax):
        option, called, of, switch = (part or "" for part in match.groups())
        if not (option or switch) and _ALTERNATIVE.search(syntax[: match.start()]):
            continue
        kind = (_TYPE.findall(of) or [of or "switch"])[-1].strip().replace(" ", "").casefold()
        found.append(Argument((switch or called).casefold(), bool(option or switch), kind))
    return found


def differences(builtin: Builtin, syntax: str, aliases: dict[str, str]) -> list[str]:
    """What differs between a header and the manual's syntax."""
    manual = [argument._replace(type=aliases.get(argument.type, argument.type)) for argument in arguments_of(syntax)]
    if not manual:
        return []
    here = [_argument(parameter) for parameter in builtin.parameters]
    names, own = [each.name for each in manual], [each.name for each in here]
    whole = _ENDS.search(syntax) is not None
    found = []
    wanted, required = ([each for each in each_one if not each.optional] for each_one in (manual, here))
    if wanted != (required if whole else required[: len(wanted)]):
        found.append(f"required: {_listed(wanted)}, here {_listed(required)}")
    if [each for each in names if each in own] != [each for each in own if each in names]:
        found.append(f"order: {', '.join(names)}")
    if missing := [each.name for each in (manual if whole else manual[:-1]) if each.optional and each.name not in own]:
        found.append(f"options not here: {', '.join(missing)}")
    unknown = [each.name for each in here if each.optional and each.name not in names]
    if unknown and whole:
        found.append(f"options only here: {', '.join(unknown)}")
    return found


def _argument(parameter: object) -> Argument:
    kind = parameter.type  # type: ignore[attr-defined]
    while isinstance(kind, Array):
        kind = kind.element
    return Argument(parameter.name, parameter.optional, kind.name)  # type: ignore[attr-defined]


def _listed(arguments: list[Argument]) -> str:
    return ", ".join(f"{each.type} {each.name}" for each in arguments)


def main() -> None:
    """Print each header that differs, and how many were compared."""
    manual = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    aliases = {name(node, 2): name(node, 1) for node in parts(parse_system(), "alias")}
    known = [each for each in builtins() if each.name in manual and arguments_of(manual[each.name]["syntax"])]
    other = 0
    for builtin in known:
        found = differences(builtin, manual[builtin.name]["syntax"], aliases)
        other += bool(found)
        for each in found:
            print(f"{builtin.name}: {each}")
    print(f"{len(known)} headers compared, {len(known) - other} as in the manual")
    print("not in the file:", ", ".join(each.name for each in builtins() if each.name not in manual))


if __name__ == "__main__":
    main()
