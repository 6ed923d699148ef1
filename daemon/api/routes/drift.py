"""GET /drift: the control chart of the active calibration."""

from typing import Annotated

from fastapi import Query, Request, Response
from pydantic import RootModel

from daemon.api.dependencies import IN_WHOLE_DIGITS, App, WithCamera, api_router, in_words
from daemon.api.negotiation import respond
from daemon.api.plain_text import drift_text
from daemon.api.schemas.drift import DriftDocument
from daemon.drift.samples import MAX_VERIFICATIONS

MAX_CHECKS = 100

router = api_router(tags=["calibrate"])


@router.get("/drift", **in_words(DriftDocument, "The chart", 404, 507))
async def drift(
    request: Request,
    app: App,
    camera: WithCamera,
    limit: Annotated[
        int, Query(ge=1, le=MAX_VERIFICATIONS, description="how many points at most, the last ones"), IN_WHOLE_DIGITS
    ] = 100,
    calibration: Annotated[
        str | None, Query(min_length=1, max_length=64, description="id of one that was active; else the one that is")
    ] = None,
) -> Response:
    """The control chart: where the fixed target was seen by each verification, its limits, and what follows from it."""
    chart = await (camera.drift.refresh() if calibration is None else camera.drift.chart_of_earlier(calibration))
    most, extensions = min(limit, MAX_CHECKS), request.app.state.extensions
    touched = [check for extension in extensions if extension.checks
               for check in await extension.checks(app, chart.report.calibration_id or "", most)]  # fmt: skip
    scanner = app.settings.scanner_beside(camera.name)
    accepted = await app.store.acceptances_of(scanner, most)
    document = await app.service_workers.run(DriftDocument.of, chart, app.settings.drift, limit, touched, accepted)
    return respond(request, RootModel[DriftDocument](document), lambda: drift_text(document))
