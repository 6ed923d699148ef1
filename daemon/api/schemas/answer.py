"""What every answer has in common, and the values that examples in openapi.json show."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class Answer(BaseModel):
    """Base: answers are written, never read back."""

    model_config = ConfigDict(frozen=True)


def example(**answer: Any) -> ConfigDict:
    """For `model_config`: shown in openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"
