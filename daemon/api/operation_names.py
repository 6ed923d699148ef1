"""The names of the operations in openapi.json, by method and path: what a generated client calls its functions."""

import json
from pathlib import Path

from fastapi.routing import APIRoute

NAMES: dict[str, str] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))


def operation_name(route: APIRoute) -> str:
    """Of a route in the table; of another one its own, which a test refuses."""
    asked = [f"{method} {route.path_format}" for method in sorted(route.methods or ())]
    return next((NAMES[each] for each in asked if each in NAMES), route.name)
