"""Schemas of health and readiness."""

from typing import Literal

from pydantic import ConfigDict

from calibration.documents.calibration import SentenceDocument
from daemon.api.schemas.answer import Answer, example


class HealthDocument(Answer):
    """The daemon answers."""

    model_config = example(status="alive", software="handeyed 0.1.0", uptime_s=86400.0)

    status: Literal["alive"]
    software: str
    uptime_s: float


class Readiness(Answer):
    """Whether this could be done now, and the reasons if not; `reason_details`: what each is made of."""

    model_config = example(
        ready=False,
        reasons=["robot: motors are off"],
        reason_details=[
            {
                "id": "of-device",
                "params": {
                    "device": {"id": "device-robot", "params": {}},
                    "detail": {"id": "motors-off", "params": {}},
                },
            }
        ],
    )

    ready: bool
    reasons: list[str]
    reason_details: list[SentenceDocument]


class ReadyDocument(Answer):
    """`ready` when something can be done now: calibrate or register. `warning_details`: what each is made of."""

    ready: bool
    calibrate: Readiness
    register_: Readiness
    warnings: list[str]
    warning_details: list[SentenceDocument]

    model_config = ConfigDict(frozen=True, serialize_by_alias=True, alias_generator=lambda name: name.rstrip("_"),
                              populate_by_name=True)  # fmt: skip


class Welcome(Answer):
    """Links to all resources (GET /)."""

    software: str
    links: dict[str, str]
