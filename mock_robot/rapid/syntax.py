"""Parses RAPID text to a tree; errors name file and line."""

from functools import cache
from importlib.resources import files
from typing import Literal

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput

from mock_robot.rapid.errors import RapidProgramError, RapidSyntaxError

Node = Tree[Token]
MAX_NAME_LENGTH = 32
_RESERVED_WORDS = """
alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc endrecord
endtest endtrap endwhile error exit false for from func goto if inout local mod module not or pers proc raise record
retry return step test then to trap true trynext undo var while with xor
"""
RESERVED = frozenset(_RESERVED_WORDS.split())
"""Words that are no names (kernel manual 3HAC050946, reserved words)."""


@cache
def parse_module(text: str, module: str) -> Node:
    """Parse a module; raises RapidSyntaxError, and RapidProgramError for a name that can be none."""
    tree = _parse(text, module, "module")
    for token in tree.scan_values(lambda leaf: isinstance(leaf, Token) and leaf.type == "NAME"):
        if token.casefold() in RESERVED:
            raise RapidProgramError(module, line_of(token), f"{token} is a reserved word")
        if len(token) > MAX_NAME_LENGTH:
            raise RapidProgramError(module, line_of(token), f"{token} is longer than {MAX_NAME_LENGTH} characters")
    return tree


@cache
def parse_system() -> Node:
    """Parse system.rapid, the declarations a controller provides."""
    text = files(__package__).joinpath("system.rapid").read_text(encoding="ascii")
    return _parse(text, "system.rapid", "system")


def _parse(text: str, module: str, start: Literal["module", "system"]) -> Node:
    try:
        return _parser().parse(text, start=start)
    except UnexpectedInput as error:
        raise RapidSyntaxError(module, int(error.line), error.get_context(text, 30).strip()) from error


@cache
def _parser() -> Lark:
    grammar = files(__package__).joinpath("rapid.lark").read_text(encoding="ascii")
    return Lark(grammar, parser="lalr", start=["module", "system"], propagate_positions=True)


def line_of(node: Node | Token) -> int:
    """First line of a node; 0 for an empty one."""
    return int((node.line if isinstance(node, Token) else getattr(node.meta, "line", 0)) or 0)


def part(node: Node, index: int) -> Node:
    """A child that is a tree."""
    child = node.children[index]
    assert isinstance(child, Tree), node
    return child


def optional_part(node: Node, index: int) -> Node | None:
    child: object = node.children[index]
    return child if isinstance(child, Tree) else None


def parts(node: Node, rule: str | None = None) -> list[Node]:
    """Children that are trees, of that rule; absent ones are skipped."""
    return [child for child in node.children if isinstance(child, Tree) and rule in (None, child.data)]


def word(node: Node, index: int) -> str:
    """A child that is a token."""
    child = node.children[index]
    assert isinstance(child, Token), node
    return str(child)


def name(node: Node, index: int) -> str:
    """A name in lower case, since the controller ignores case."""
    return word(node, index).casefold()
