"""Problem details (RFC 9457), the body of every error answer, and the reason phrases of RFC 9110."""

from http import HTTPStatus
from typing import Literal

from pydantic import BaseModel, ConfigDict

from calibration.documents.calibration import SentenceDocument
from calibration.errors import DocumentProblem

MEDIA_TYPE = "application/problem+json"

_PHRASES = {413: "Content Too Large", 414: "URI Too Long", 416: "Range Not Satisfiable", 422: "Unprocessable Content"}
"""Phrases that Python 3.13 changed."""


def reason_phrase(status: int) -> str:
    """The reason phrase of a status, such as "Not Found" for 404."""
    return _PHRASES.get(status) or HTTPStatus(status).phrase


class Problem(BaseModel):
    """problem+json. `code` is stable, `detail` and `fix` are for people; `details`: what these two are made of.

    `stopped`, `disarmed`: of stop-unconfirmed, what the controller has confirmed of the arm.
    """

    model_config = ConfigDict(json_schema_extra={"examples": [{
        "type": "urn:handeyed:problem:run-in-progress", "title": "Conflict", "status": 409,
        "code": "run-in-progress", "detail": "calibration run 20261121-090000-3f9a1c is in progress",
        "fix": "wait for it to end, or stop it with POST /runs/20261121-090000-3f9a1c/abort",
        "holder": "20261121-090000-3f9a1c",
    }]})  # fmt: skip

    type: str
    title: str
    status: int
    code: str
    detail: str
    fix: str
    holder: str | None = None
    reasons: list[str] | None = None
    problems: list[DocumentProblem] | None = None
    details: dict[Literal["what", "fix"], SentenceDocument] | None = None
    stopped: Literal["confirmed", "unconfirmed"] | None = None
    disarmed: Literal["confirmed", "unconfirmed"] | None = None

    @classmethod
    def of(cls, status: int, code: str, detail: str, fix: str) -> "Problem":
        """A problem with `type` and `title` derived from code and status."""
        kind, title = f"urn:handeyed:problem:{code}", reason_phrase(status)
        return cls(type=kind, title=title, status=status, code=code, detail=detail, fix=fix)
