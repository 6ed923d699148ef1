"""What GET /live tells of the cell, as JSON by key: equal texts mean that nothing has changed."""

import json
from typing import Any

from pydantic import BaseModel

DECIMALS = 6
"""Digits after the point: 1 nm, 1e-6 degrees. Readings are noisier, and their text is sent every second."""

Snapshot = dict[str, str]
"""The JSON of each key of the message."""


def json_of(value: BaseModel | list[BaseModel] | str | None) -> str:
    """Compact JSON with DECIMALS digits."""
    if isinstance(value, BaseModel):
        return json.dumps(_rounded(value.model_dump(mode="json", by_alias=True)), separators=(",", ":"))
    if isinstance(value, list):
        return f"[{','.join(json_of(one) for one in value)}]"
    return json.dumps(value)


def message_of(snapshot: Snapshot, sent: Snapshot) -> bytes:
    """The server-sent event with `at` and every key that differs from what was sent before."""
    changed = {key: text for key, text in snapshot.items() if key == "at" or sent.get(key) != text}
    fields = ",".join(f'"{key}":{text}' for key, text in changed.items())
    return f"event: live\ndata: {{{fields}}}\n\n".encode()


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DECIMALS)
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return value
