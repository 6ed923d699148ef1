"""The answers that show a run: JSON, or text."""

from fastapi import Request, Response
from pydantic import RootModel

from calibration.documents.calibration import CalibrationDocument
from daemon.api.negotiation import respond
from daemon.api.plain_text import run_text
from daemon.api.schemas.runs import RunDocument
from daemon.application import Application
from daemon.model.records import RunRecord

POLL_S = 1
"""Retry-After of a run in progress: a station takes seconds."""


async def answer_run(
    request: Request, app: Application, run: RunRecord, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """A run as JSON or text, with its calibration."""
    calibration: CalibrationDocument | None = None
    if run.result is not None and run.kind == "calibration":
        calibration = (await app.store.calibration(run.result["calibration_id"])).document
    every = dict(headers or {})
    if not run.is_over:
        every["Retry-After"] = str(POLL_S)
    document = RootModel[RunDocument](RunDocument.of(run))
    return respond(request, document, lambda: run_text(run, calibration), status, every)


async def answer_started(request: Request, app: Application, run: RunRecord) -> Response:
    """The answer to the request that started the run: 202 with Location, or 200 when it is over."""
    return await answer_run(request, app, run, 200 if run.is_over else 202, {"Location": f"/runs/{run.id}"})
