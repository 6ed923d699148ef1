"""Descriptions of fields in JSON schemas: the text below a field, read from the source when a schema is asked for.

Pydantic's own use_attribute_docstrings reads it at import, and parses a module again for each of its classes.
"""

import ast
import inspect
import sys
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import GetJsonSchemaHandler


class Described:
    """Base of models and dataclasses at the top of a module: the text below a field describes it in JSON schemas."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for base in (each for each in cls.__mro__ if issubclass(each, Described)):
            for name, text in field_texts(base.__module__, base.__name__).items():
                if name in properties:
                    properties[name].setdefault("description", text)
        return schema


def field_texts(module: str, name: str) -> dict[str, str]:
    """The text below each field of a class at the top of a module, by the field's name."""
    texts = {}
    for pair in pairwise(class_bodies(module).get(name, ())):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=field)), ast.Expr(value=ast.Constant(value=str(text))):
                texts[field] = inspect.cleandoc(text)
    return texts


@cache
def class_bodies(module: str) -> dict[str, list[ast.stmt]]:
    """The statements of each class at the top of a module, which is parsed once."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
