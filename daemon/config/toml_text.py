"""Settings as the text of a TOML file."""

import json
from collections.abc import Mapping
from typing import Any


def toml_text(sections: Mapping[str, Mapping[str, Any]]) -> str:
    """The sections, one key a line; a value that is None and an empty section are left out."""
    return "\n".join(f"[{name}]\n{_lines(values)}\n" for name, values in sections.items() if _lines(values))


def _lines(values: Mapping[str, Any]) -> str:
    return "\n".join(f"{key} = {toml_value(value)}" for key, value in values.items() if value is not None)


def toml_value(value: Any) -> str:
    """A value as inline TOML; numbers, strings and booleans are written as in JSON."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return json.dumps(value)
