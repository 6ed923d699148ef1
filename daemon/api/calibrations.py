"""Calibrations: the list, one of them, the one in force, applying one."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response

from calibration.documents.calibration import CalibrationDocument
from daemon.api.access import App, Before, Identifier, Limit, body_of, takes
from daemon.api.documents import AppliedDocument, CalibrationList, CalibrationSummary, CurrentCalibration
from daemon.api.negotiation import negotiated, or_text
from daemon.api.problems import documented
from daemon.api.text import current_in_words
from daemon.cli.summary import summary
from daemon.errors import NoCalibration, NotFound
from daemon.requests import ApplyRequest

router = APIRouter(prefix="/calibrations", tags=["calibrations"])


@router.get("", response_model=CalibrationList)
async def calibrations(app: App, limit: Limit = 50, before: Before = None) -> CalibrationList:
    """The newest first, and what was applied."""
    found = await app.store.calibrations(limit, before)
    applied = await app.store.applied(limit)
    current = applied[0].calibration_id if applied else None
    return CalibrationList(
        calibrations=[CalibrationSummary.of(record, current) for record in found],
        applied=[AppliedDocument.of(row) for row in applied],
        next=f"/calibrations?limit={limit}&before={found[-1].id}" if len(found) == limit else None,
    )


@router.get("/current", response_model=CurrentCalibration, responses={200: or_text("In words"), **documented(404)})
async def current(request: Request, app: App) -> Response:
    """The calibration in force."""
    try:
        applied, record = await app.store.current()
    except NoCalibration as error:
        raise NotFound(error.what, error.fix) from None
    document = CurrentCalibration(applied=AppliedDocument.of(applied), calibration=record.document)
    return negotiated(request, document, lambda: current_in_words(document))


@router.get(
    "/{calibration_id}",
    response_model=CalibrationDocument,
    responses={200: or_text("In words"), **documented(404)},
)
async def calibration(request: Request, app: App, calibration_id: Identifier) -> Response:
    """calibration.json."""
    document = (await app.store.calibration(calibration_id)).document
    return negotiated(request, document, lambda: summary(f"calibration {document.id}", document))


@router.post(
    "/{calibration_id}/apply",
    response_model=AppliedDocument,
    responses=documented(400, 404, 409, 413, 500, 507),
    openapi_extra=takes(ApplyRequest),
)
async def apply(
    app: App, calibration_id: Identifier, body: Annotated[ApplyRequest, Depends(body_of(ApplyRequest))]
) -> AppliedDocument:
    """Make this calibration the one in force. What was in force before stays in the history."""
    return AppliedDocument.of(await app.operations.apply(calibration_id, body))
