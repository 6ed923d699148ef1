"""The base class of all answers, and helpers for examples in openapi.json."""

import json
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ConfigDict


class Answer(BaseModel):
    """Base class of all answers."""

    model_config = ConfigDict(frozen=True)


def page_json(name: str, items: Iterable[str], following: str | None, **beside: Iterable[str]) -> bytes:
    """The JSON of a page: the list `name` of `items`, which are JSON, the lists `beside` it, and the link `next`."""
    lists = {name: items, **beside}
    fields = (f"{json.dumps(key)}:[{','.join(each)}]" for key, each in lists.items())
    return f'{{{",".join(fields)},"next":{json.dumps(following)}}}'.encode()


def example(**answer: Any) -> ConfigDict:
    """A `model_config` with an example for openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"
