"""POST /touch, POST /touch/approach, GET /touches: where a known tip touches what the camera has seen."""

from typing import Annotated

from fastapi import Depends, Request, Response

from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchesDocument
from daemon.api.dependencies import App, Before, Identifier, JsonBody, Limit, Wait, api_router, respond_rows
from daemon.api.negotiation import or_text, respond, respond_created
from daemon.api.problems import problem_responses
from daemon.api.routes.runs import STARTED, answer_run_start
from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.api.schemas.runs import RunDocument
from daemon.application import Application
from daemon.store.documents import DocumentRecord
from extensions.touch.approach import TouchApproach
from extensions.touch.mathematics.report import touch_test_text
from extensions.touch.requests import ApproachRequest, TouchRequest
from extensions.touch.touch_tests import TOUCH_TESTS, StoredTouchTest, TouchTests

router = api_router(tags=["calibrate"])


class StoredTouch(StoredAnswer):
    """A touch test, and what it was made from. `verification`: the run that saw the points, or null."""

    verification: str | None
    tip: TipDocument
    touches: TouchesDocument
    result: TouchTestDocument

    @classmethod
    def of_record(cls, record: DocumentRecord) -> "StoredTouch":
        return cls(**vars(record), **vars(record.parsed(StoredTouchTest)))


class TouchList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    touches: list[StoredTouch]
    damaged: list[str]
    next: str | None


@router.post(
    "/touch",
    operation_id="judge_touches",
    response_model=StoredTouch,
    status_code=201,
    responses=problem_responses(400, 404, 409, 413, 422, 429, 500, 502, 503, 504, 507),
)
async def touch(app: App, body: Annotated[TouchRequest, Depends(JsonBody(TouchRequest))]) -> Response:
    """Judge where an operator has brought a known tip to points that the camera saw: the misses, their uncertainty, the
    tolerance. Stored; Location says where. Never moves anything; 409 while a run is in progress and a pose is read."""
    stored = StoredTouch.of_record(await _touch_tests(app, body.camera).evaluate(body, app.new_id()))
    return respond_created(stored, f"/touches/{stored.id}")


@router.post("/touch/approach", operation_id="approach_point", response_model=RunDocument, responses=STARTED)
async def approach(
    request: Request, app: App, body: Annotated[ApproachRequest, Depends(JsonBody(ApproachRequest))], wait: Wait = 0.0
) -> Response:
    """Move the arm: the tip to a stand-off before a point that the camera saw, or one step nearer, never beyond it.

    A run of kind "jog", one for each request: followed, stopped and audited as every run. Judge with POST /touch.
    """
    point = await _touch_tests(app, body.camera).find(body)
    move = TouchApproach(app.cell, app.operations.rules, body, point)
    return await answer_run_start(request, app, await app.operations.move_once(move), wait)


@router.get("/touches", operation_id="list_touch_tests", response_model=TouchList)
async def touches(app: App, limit: Limit = 50, before: Before = None) -> Response:
    """The touch tests, newest first."""
    found = await app.store.documents(TOUCH_TESTS).page(limit + 1, before)
    return await respond_rows(app, found, limit, "/touches", StoredTouch.of_record)


@router.get(
    "/touches/{touch_id}",
    operation_id="get_touch_test",
    response_model=StoredTouch,
    responses={200: or_text("In words"), **problem_responses(404)},
)
async def touch_of(request: Request, app: App, touch_id: Identifier) -> Response:
    """One touch test."""
    stored = StoredTouch.of_record(await app.store.documents(TOUCH_TESTS).get(touch_id))
    return respond(request, stored, lambda: touch_test_text(stored.result))


def _touch_tests(app: Application, camera: str | None) -> TouchTests:
    """Raises NotFound for a name that is no camera's."""
    app.camera(camera)
    return TouchTests(app.store, app.cell, app.service_workers, app.clock, app.settings)
