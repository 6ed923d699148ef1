"""Schemas of health and readiness."""

from typing import Literal

from pydantic import ConfigDict

from daemon.api.schemas.answer import Answer, example


class HealthDocument(Answer):
    """The daemon answers."""

    model_config = example(status="alive", software="handeyed 0.1.0", uptime_s=86400.0)

    status: Literal["alive"]
    software: str
    uptime_s: float


class Readiness(Answer):
    """Whether this could be done now, and the reasons if not."""

    model_config = example(ready=False, reasons=["robot: motors are off"])

    ready: bool
    reasons: list[str]


class ReadyDocument(Answer):
    """`ready` when something can be done now: calibrate or register."""

    ready: bool
    calibrate: Readiness
    register_: Readiness
    warnings: list[str]

    model_config = ConfigDict(frozen=True, serialize_by_alias=True, alias_generator=lambda name: name.rstrip("_"),
                              populate_by_name=True)  # fmt: skip


class Welcome(Answer):
    """Links to all resources (GET /)."""

    software: str
    links: dict[str, str]
