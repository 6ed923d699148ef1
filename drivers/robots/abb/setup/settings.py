"""Settings of the robot program, which are PERS of its shared module: read and replaced in the module's text."""

import re
from collections.abc import Mapping

from drivers.errors import AddressNotUnderstood

_NAME = re.compile(r"^\s*MODULE\s+(\w+)", re.IGNORECASE | re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def module_name(text: str) -> str:
    """Name in the MODULE line; "" without one."""
    found = _NAME.search(text)
    return found.group(1) if found else ""


def value_in(text: str, setting: str) -> str | None:
    """Value of a PERS in a module's text; None when it has none of that name."""
    found = _declaration(setting).search(text)
    return found.group("value").strip() if found else None


def replace_settings(text: str, settings: Mapping[str, str]) -> str:
    """The module's text with other values. Raises AddressNotUnderstood for a name or value that cannot be."""
    for name, value in settings.items():
        found = _declaration(name).search(text)
        if found is None:
            raise AddressNotUnderstood(name, "the robot program has no such setting", "CELL_shared.sys lists them")
        written = rapid_value(found.group("type"), name, value)
        text = text[: found.start("value")] + written + text[found.end("value") :]
    return text


def rapid_value(kind: str, name: str, value: str) -> str:
    """The value as RAPID spells it: a string gets its quotes. Raises AddressNotUnderstood."""
    value = value.strip()
    kind = kind.lower()
    if kind == "string" and not value.startswith('"'):
        value = f'"{value}"'
    well = {
        "bool": value.upper() in ("TRUE", "FALSE"),
        "num": _NUMBER.fullmatch(value) is not None,
        "string": len(value) <= 82 and value.count('"') == 2,
    }.get(kind, value.startswith("[") and value.endswith("]") and value.count("[") == value.count("]"))
    if not well:
        raise AddressNotUnderstood(f"{name}={value}", f"this is no {kind}", "write it as CELL_shared.sys does")
    return value.upper() if kind == "bool" else value


def _declaration(setting: str) -> re.Pattern[str]:
    return re.compile(
        rf"^\s*(?:LOCAL\s+|TASK\s+)?PERS\s+(?P<type>\w+)\s+{re.escape(setting)}\s*:=(?P<value>[^;]*);",
        re.IGNORECASE | re.MULTILINE,
    )
