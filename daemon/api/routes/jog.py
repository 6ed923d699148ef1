"""POST /robot/jog."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response

from daemon.api.dependencies import App, JsonBody, Wait
from daemon.api.routes.runs import STARTED, answer_run_start
from daemon.api.schemas.runs import RunDocument
from daemon.model.requests import JogRequest

router = APIRouter(tags=["cell"])


@router.post("/robot/jog", response_model=RunDocument, responses=STARTED)
async def jog(
    request: Request, app: App, body: Annotated[JogRequest, Depends(JsonBody(JogRequest))], wait: Wait = 0.0
) -> Response:
    """Move the arm by a small step, or all axes to their angles, for the first pose and for views by hand.

    A run of kind "jog": followed, stopped and audited as every run, and refused while another is in progress.
    """
    return await answer_run_start(request, app, await app.operations.jog(body), wait)
