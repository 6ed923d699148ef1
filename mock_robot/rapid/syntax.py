"""RAPID text to a tree; what cannot be read is an error that names file and line."""

from functools import cache
from importlib.resources import files

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput

from mock_robot.errors import MockError


class RapidSyntaxError(MockError):
    """A module that cannot be read: which, where, and what stands there."""

    def __init__(self, module: str, line: int, found: str) -> None:
        self.module, self.line, self.found = module, line, found
        super().__init__(f"{module}:{line}: {found}; only the RAPID subset of mock_robot/rapid/rapid.lark is read")


def parse_module(text: str, module: str) -> "Tree[Token]":
    """The tree of a module; raises RapidSyntaxError."""
    try:
        return _parser().parse(text)
    except UnexpectedInput as error:
        raise RapidSyntaxError(module, int(error.line), error.get_context(text, 30).strip()) from error


@cache
def _parser() -> Lark:
    grammar = files("mock_robot.rapid").joinpath("rapid.lark").read_text(encoding="ascii")
    return Lark(grammar, parser="lalr", propagate_positions=True)
