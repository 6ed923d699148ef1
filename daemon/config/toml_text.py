"""Settings as the text of a TOML file."""

import json
from collections.abc import Mapping
from typing import Any


def toml_text(table: Mapping[str, Any], name: str = "") -> str:
    """The table and those in it, one key a line; a value that is None and an empty table are left out.

    A table below a section that holds no further one is written in a line, too.
    """
    tables = {key: each for key, each in table.items() if isinstance(each, Mapping)}
    deep = [key for key, each in tables.items() if not name or any(isinstance(it, Mapping) for it in each.values())]
    own = {key: value for key, value in table.items() if key not in deep and value not in (None, {})}
    lines = "".join(f"{key} = {toml_value(value)}\n" for key, value in own.items())
    inner = [toml_text(table[key], f"{name}.{key}".lstrip(".")) for key in deep]
    return "\n".join(filter(None, [f"[{name}]\n{lines}" if name and lines else lines, *inner]))


def toml_value(value: Any) -> str:
    """A value as inline TOML; numbers, strings and booleans are written as in JSON, tables of a list line by line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items() if item is not None) + " }"
    if isinstance(value, list | tuple):
        begin, between, end = ("\n  ", ",\n  ", ",\n") if value and isinstance(value[0], dict) else ("", ", ", "")
        return f"[{begin}{between.join(map(toml_value, value))}{end}]"
    return json.dumps(value)
