"""GET /runs, one of them, its pictures; aborting it, jogging in it, taking a view, finishing it."""

from typing import Annotated

from fastapi import Depends, Path, Request, Response

from calibration.sentences.sentence import Sentence
from daemon.api.dependencies import (
    IN_WHOLE_DIGITS,
    App,
    Before,
    Identifier,
    JsonBody,
    Limit,
    Moment,
    Wait,
    WidthQuery,
    api_router,
    in_content,
    in_words,
    no_body,
    respond_page,
    respond_rows,
)
from daemon.api.middleware.abort_first import abort_of
from daemon.api.middleware.disconnects import wait_for_run
from daemon.api.negotiation import choose_picture_type, or_text
from daemon.api.problems import problem_responses
from daemon.api.routes.cell import PICTURES, stored_picture
from daemon.api.run_answers import answer_run, answer_started
from daemon.api.run_views import run_views
from daemon.api.schemas.runs import RunDocument, RunList, RunViewsDocument
from daemon.application import Application
from daemon.errors import NotFound
from daemon.model.records import RunKind, RunRecord
from daemon.model.requests import HoldRequest, JogRequest
from daemon.model.run_states import RunState
from daemon.sessions.session_files import SESSION_FILE
from daemon.store.listings import PageFilters

router = api_router(prefix="/runs", tags=["runs"])
robot = api_router(prefix="/robot", tags=["cell"])

JogBody = Annotated[JogRequest, Depends(JsonBody(JogRequest))]

STARTED = {200: or_text("The finished run, when `wait` was long enough"),
           202: {"description": "Started; follow Location", "model": RunDocument,
                 "headers": {"Location": {"schema": {"type": "string"}},
                             "Retry-After": {"schema": {"type": "integer"}}}},
           **problem_responses(400, 403, 404, 409, 413, 422, 500, 502, 503, 504, 507)}  # fmt: skip
BY_HAND = (400, 404, 409, 422, 500, 502, 503, 504, 507)
FINISHING = {status: answer for status, answer in STARTED.items() if status not in (400, 403, 413)}


@router.get("", response_model=RunList)
async def runs(
    app: App,
    limit: Limit = 50,
    before: Before = None,
    kind: RunKind | None = None,
    state: RunState | None = None,
    since: Moment = None,
    until: Moment = None,
) -> Response:
    """The newest first; with filters those that match all of them. `since` is included, `until` is not."""
    filters = PageFilters({"kind": kind, "state": state, "since": since, "until": until})
    found = await app.supervisor.listings(limit + 1, before, filters)
    return await respond_rows(app, found, limit, "/runs", RunDocument.of, filters)


@router.get("/{run_id}", **in_words(RunDocument, "The run", 404))
async def run(request: Request, app: App, run_id: Identifier, wait: Wait = 0.0) -> Response:
    """The state of a run; with `wait` answered when it is over."""
    return await answer_run(request, app, await wait_for_run(request, app, run_id, wait))


@router.post("/{run_id}/abort", **in_words(RunDocument, "Stopped", 404, 409, 502))
async def abort(request: Request, app: App, run_id: Identifier) -> Response:
    """Stop the run. 200: the controller has confirmed that the arm is stopped and disarmed.

    502 stop-unconfirmed: the run has ended, and `stopped` and `disarmed` say what of it is confirmed; the daemon goes
    on trying. Press the emergency stop.
    """
    return await answer_run(request, app, await abort_of(request))


@router.post(
    "/{run_id}/stations", dependencies=[Depends(no_body)], **in_words(RunDocument, "The view is taken", *BY_HAND)
)
async def station(request: Request, app: App, run_id: Identifier) -> Response:
    """Of a manual run: take one view from where the operator has jogged the arm to, and say where to go next.

    Nothing moves. Refused, and not counted: an arm that is not at rest, a picture without the target, the same pose
    again.
    """
    return await answer_run(request, app, await app.operations.submit_request(run_id, "a view"))


@router.post("/{run_id}/jog", **in_words(RunDocument, "The arm stands", *BY_HAND))
async def jog_in_run(request: Request, app: App, run_id: Identifier, body: JogBody) -> Response:
    """Of a manual run: move the arm as with POST /robot/jog, between two views; answered when it stands.

    The run keeps the cell and goes on waiting, also after a refused jog. `POST /runs/{id}/abort` stops the arm.
    """
    return await answer_run(request, app, await app.operations.jog_in_run(run_id, body))


@router.post(
    "/{run_id}/hold", status_code=204, response_class=Response, responses=problem_responses(400, 404, 409, 413, 422)
)
async def hold(app: App, run_id: Identifier, body: Annotated[HoldRequest, Depends(JsonBody(HoldRequest))]) -> Response:
    """Of a jog with `to`: its button is held, which is said every 0.1 s; or, with `released`, it was let go.

    The arm is stopped and disarmed when the last word was sent more than 0.3 s ago, and a later one is refused. Only
    who asked for the motion can hold it. No safety function.
    """
    await app.operations.hold(run_id, body)
    return Response(status_code=204)


@router.post("/{run_id}/finish", response_model=RunDocument, responses=FINISHING)
async def finish(request: Request, app: App, run_id: Identifier, wait: Wait = 0.0) -> Response:
    """Of a manual run: no more views; solve for X, judge and store it."""
    return await answer_run_start(request, app, await app.operations.submit_request(run_id, "the end"), wait)


@router.get("/{run_id}/views", response_model=RunViewsDocument, responses=problem_responses(404))
async def views(app: App, run_id: Identifier) -> Response:
    """The views of a calibration or verification run: the points found, and where its calibration predicts them."""
    found = await app.supervisor.run(run_id)
    calibration_id = (found.result or {}).get("calibration_id")  # that the run has made, or has verified
    calibration = None if calibration_id is None else (await app.store.calibration(calibration_id)).document
    arm = app.operations.rules.arm
    folder, own = app.store.run_folder(found.id), found.kind == "calibration"
    if found.kind in ("scan", "jog") or not (folder / SESSION_FILE).is_file():
        raise NotFound(Sentence("no-views-of-run", run=found.id), Sentence("look-at-other-run"))

    def as_json() -> bytes:
        return run_views(found.id, folder, calibration, arm, own=own).model_dump_json().encode()

    return await respond_page(app, as_json)


@router.get("/{run_id}/frames/{k}", **in_content(*PICTURES, 404, 406, 502))
async def frame(
    request: Request,
    app: App,
    run_id: Identifier,
    k: Annotated[
        int,
        Path(ge=0, le=999, description="view, from 0: of station k + 1, or of station k after a first look"),
        IN_WHOLE_DIGITS,
    ],
    width: WidthQuery = None,
) -> Response:
    """A stored picture of the run, in the format that Accept prefers. It never changes."""
    media_type = choose_picture_type(request)
    found = await app.supervisor.run(run_id)
    content = await stored_picture(app, found.id, k, media_type, width)
    headers = {"Cache-Control": "private, max-age=31536000, immutable", "Vary": "Accept"}
    return Response(content, media_type=media_type, headers=headers)


@robot.post("/jog", response_model=RunDocument, responses=STARTED)
async def jog(request: Request, app: App, body: JogBody, wait: Wait = 0.0) -> Response:
    """Move the arm by a small step, or all axes to their angles, for the first pose and for views by hand.

    A run of kind "jog": followed, stopped and audited as every run, and refused while another is in progress.
    """
    return await answer_run_start(request, app, await app.operations.jog(body), wait)


async def answer_run_start(request: Request, app: Application, run: RunRecord, wait: float) -> Response:
    """Answer 202 with Location, or 200 with the run when it is over within `wait` seconds."""
    return await answer_started(request, app, await wait_for_run(request, app, run.id, wait))
