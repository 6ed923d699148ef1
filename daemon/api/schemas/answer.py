"""The base class of all answers, and helpers for examples in openapi.json."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class Answer(BaseModel):
    """Base class of all answers."""

    model_config = ConfigDict(frozen=True)


def example(**answer: Any) -> ConfigDict:
    """A `model_config` with an example for openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"
