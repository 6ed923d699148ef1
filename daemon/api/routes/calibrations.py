"""GET /calibrations, one of them, the active one, and applying one."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from fastapi import Depends, Header, Query, Request, Response

from calibration.documents.arm import ArmErrorsDocument, arm_summary
from calibration.documents.arm_field import MAX_STEPS, ArmFieldDocument, arm_field, arm_field_text
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_text import summary
from calibration.errors import DocumentProblem
from calibration.monitoring.comparison import ComparisonDocument, compare, comparison_text
from calibration.sentences.sentence import Sentence
from daemon.access.errors import RoleTooLow
from daemon.access.roles import LOCAL, Role
from daemon.api.dependencies import (
    BOX_PATTERN,
    IN_DIGITS,
    IN_WHOLE_DIGITS,
    App,
    Before,
    Identifier,
    JsonBody,
    Limit,
    WithCamera,
    api_router,
    box_of,
    creates,
    in_words,
    respond_rows,
)
from daemon.api.http_errors import InvalidRequest
from daemon.api.middleware.authentication import caller_of
from daemon.api.negotiation import or_text, respond, respond_created
from daemon.api.problems import problem_responses
from daemon.api.schemas.calibrations import AppliedDocument, CalibrationList, CalibrationSummary, CurrentCalibration
from daemon.application import Application
from daemon.errors import NoCalibration, NotFound, StorageInconsistent
from daemon.model.requests import ApplyRequest, ObservationsRequest, SolveRequest
from daemon.store.listings import CalibrationListing, PageFilters

TAG = re.compile(r'"applied-([0-9]{1,18})"')
ANY = range(1, 2**62)
"""Every sequence number from 1: "*" does not match while nothing is active."""

LIST = re.compile(r'^\s*(\*|(W/)?"[\x21\x23-\x7e]*"(\s*,\s*(W/)?"[\x21\x23-\x7e]*")*)\s*$')

IfMatch = Annotated[
    str | None,
    Header(max_length=500, description='ETag of GET /calibrations/current; "*": whatever is active',
           examples=['"applied-7"']),
]  # fmt: skip
IfNoneMatch = Annotated[str | None, Header(max_length=500, description="ETag of an earlier answer: 304 when unchanged")]

ETAG_HEADER: dict[str, Any] = {"ETag": {"schema": {"type": "string"}, "description": "changes with what is active"}}
UNCHANGED: dict[str, Any] = {"description": "The same as before", "headers": ETAG_HEADER}


def tag_of(sequence: int) -> str:
    """The ETag of the calibration that was applied as number `sequence`."""
    return f'"applied-{sequence}"'


def parse_if_match(if_match: str | None) -> Sequence[int] | None:
    """The sequence numbers that If-Match allows, no unknown or weak tag's; None: any. Raises InvalidRequest."""
    if if_match is None:
        return None
    if if_match.strip() == "*":
        return ANY
    if not LIST.match(if_match):
        fix = 'send the ETag as it came, with its quotes: "applied-7"'
        raise InvalidRequest([DocumentProblem("header.If-Match", "not a list of entity tags", fix)])
    return [int(number) for tag in if_match.split(",") for number in TAG.findall(tag) if "W/" not in tag]


MAX_SESSION_VALUES = 40_000
"""Commas of a session in a request: a hundred views of a hundred points in space."""

router = api_router(prefix="/calibrations", tags=["calibrations"])

With = Annotated[str, Query(alias="with", min_length=1, max_length=64, description='id of the other, or "current"')]
FalseAlarm = Annotated[
    float,
    Query(ge=1e-12, le=0.5, description="probability that two that agree are said to contradict each other"),
    IN_DIGITS,
]
Steps = Annotated[int, Query(ge=2, le=MAX_STEPS, description="places along each edge of the box"), IN_WHOLE_DIGITS]
FIELD_BOX = "places of the flange in the base, mm: least x, y, z, largest x, y, z; without it around the session's"
FieldBox = Annotated[str | None, Query(pattern=BOX_PATTERN, max_length=100, description=FIELD_BOX)]


@router.get("", response_model=CalibrationList)
async def calibrations(app: App, limit: Limit = 50, before: Before = None, accepted: bool | None = None) -> Response:
    """The calibrations, newest first, and the latest applied ones; with `accepted` those of that verdict only."""
    filters = PageFilters({"accepted": accepted})
    found = await app.store.listings.calibrations(limit + 1, before, filters)
    history = await app.store.history(limit)
    current = frozenset({row.camera: row.calibration_id for row in reversed(history)}.values())
    in_force = [row for row in found if isinstance(row, CalibrationListing) and row.id in current]
    accurate = {row.id: await _as_in_force(app, row) for row in in_force}
    found = [accurate.get(row.id, row) for row in found]
    return await respond_rows(
        app, found, limit, "/calibrations",
        lambda row: CalibrationSummary.of(row, row.accuracy, current=row.id in current), filters, applied=history,
    )  # fmt: skip


async def _as_in_force(app: Application, listing: CalibrationListing) -> CalibrationListing:
    """With the uncertainty that holds while the errors of its arm are taken out; as it is where it cannot be read."""
    try:
        document = (await app.store.calibration(listing.id)).document
    except StorageInconsistent:
        return listing
    return replace(listing, accuracy=await app.operations.calibrations.accuracy(document))


@router.post("", **creates(CalibrationDocument, 400, 409, 413, 422, 429, 500, 507))
async def solve(
    app: App, body: Annotated[ObservationsRequest, Depends(JsonBody(ObservationsRequest, MAX_SESSION_VALUES))]
) -> Response:
    """Solve views that another program has taken: session.json whose views hold `corners_px`, `points_mm` or
    `camera_T_target`. A calibration of its own, not applied. 409 while a run is in progress."""
    record = await app.operations.solve_observations(body, app.new_id())
    return respond_created(record.document, f"/calibrations/{record.id}")


@router.get(
    "/current",
    response_model=CurrentCalibration,
    responses={200: {**or_text("In words"), "headers": ETAG_HEADER}, 304: UNCHANGED, **problem_responses(404)},
)
async def current(request: Request, app: App, camera: WithCamera, if_none_match: IfNoneMatch = None) -> Response:
    """The active calibration. Its ETag is what `If-Match` of POST /calibrations/{id}/apply expects."""
    try:
        applied, record = await app.store.current(camera.name)
    except NoCalibration as error:
        raise NotFound(error.what, error.fix) from None
    accuracy = await app.operations.calibrations.accuracy(record.document)
    document = CurrentCalibration(
        applied=AppliedDocument(**vars(applied)), calibration=record.document, **vars(accuracy)
    )
    tag = tag_of(applied.sequence)
    known = [part.strip().removeprefix("W/") for part in (if_none_match or "").split(",")]  # compared weakly
    if tag in known:
        return Response(status_code=304, headers={"ETag": tag, "Vary": "Accept"})
    title = f"calibration {record.id}, applied {applied.applied_at} by {applied.applied_by}"
    return respond(request, document, lambda: summary(title, record.document), headers={"ETag": tag})


@router.get("/{calibration_id}", **in_words(CalibrationDocument, "In words", 404))
async def calibration(request: Request, app: App, calibration_id: Identifier) -> Response:
    """calibration.json."""
    document = (await app.store.calibration(calibration_id)).document
    return respond(request, document, lambda: summary(f"calibration {document.id}", document))


@router.get("/{calibration_id}/arm", **in_words(ArmErrorsDocument, "In words", 404, 409))
async def arm(request: Request, app: App, calibration_id: Identifier) -> Response:
    """arm.json: the errors of the arm that were identified with this calibration, active with it. "current" is the
    active one."""
    _, found = await _arm_of(app, calibration_id)
    return respond(request, found, lambda: arm_summary(found))


@router.get("/{calibration_id}/arm/field", **in_words(ArmFieldDocument, "In words", 404, 409, 422, 503))
async def error_field(
    request: Request, app: App, calibration_id: Identifier, steps: Steps = 5, box: FieldBox = None
) -> Response:
    """By how much the arm as drawn misses a registered point, and what is left with its errors taken out, on a grid of
    places of the flange. "current" is the active calibration."""
    document, errors = await _arm_of(app, calibration_id)
    corners = box_of(box)
    found = await app.service_workers.run_if_free(arm_field, errors, document, steps, corners)
    return respond(request, found, lambda: arm_field_text(found))


@router.get("/{calibration_id}/compare", **in_words(ComparisonDocument, "In words", 404, 409))
async def compare_with(
    request: Request, app: App, calibration_id: Identifier, other: With, false_alarm_probability: FalseAlarm = 0.01
) -> Response:
    """How far the calibration `with` is from this one: in mm and degrees, at the points that matter of this one, beside
    what both claim to know. "current" is the active one."""
    a, b = await app.operations.calibrations.find(calibration_id), await app.operations.calibrations.find(other)
    found = compare(a, b, false_alarm_probability)
    return respond(request, found, lambda: comparison_text(found))


@router.post("/{calibration_id}/solve", **creates(CalibrationDocument, 400, 404, 409, 413, 422, 429, 500, 507))
async def solve_again(
    app: App, calibration_id: Identifier, body: Annotated[SolveRequest, Depends(JsonBody(SolveRequest))]
) -> Response:
    """Solve the same pictures again, `without` some of the views or with another method: a calibration of its own,
    not applied. 409 while a run is in progress."""
    app.supervisor.require_free()
    camera = app.camera((await app.store.calibration(calibration_id)).camera)
    record = await camera.operations.solve_again(calibration_id, body, app.new_id())
    return respond_created(record.document, f"/calibrations/{record.id}")


@router.post(
    "/{calibration_id}/apply",
    response_model=AppliedDocument,
    responses={200: {"description": "It is active", "headers": ETAG_HEADER},
               **problem_responses(400, 403, 404, 409, 412, 413, 500, 507)},
)  # fmt: skip
async def apply(
    request: Request,
    app: App,
    response: Response,
    calibration_id: Identifier,
    body: Annotated[ApplyRequest, Depends(JsonBody(ApplyRequest))],
    if_match: IfMatch = None,
) -> AppliedDocument:
    """Make this calibration the active one. What was active before stays in the history.

    With `If-Match`, the ETag of GET /calibrations/current: only if nothing else was applied meanwhile. A verdict is
    overruled by admins only.
    """
    caller = caller_of(request)
    if body.despite_verdict and caller.role < Role.ADMIN:
        raise RoleTooLow(caller.name, caller.role.word, Role.ADMIN.word)
    if caller != LOCAL:  # the key's name stands beside a given one: no client can claim the name of another key
        given = body.applied_by
        name = caller.name if given == ApplyRequest().applied_by else f"{given} ({caller.name})"
        body = body.model_copy(update={"applied_by": name})
    applied = await app.operations.calibrations.apply(calibration_id, body, parse_if_match(if_match))
    response.headers["ETag"] = tag_of(applied.sequence)
    return AppliedDocument(**vars(applied))


async def _arm_of(app: Application, calibration_id: str) -> tuple[CalibrationDocument, ArmErrorsDocument]:
    """The calibration, and arm.json identified with it. Raises NotFound where that was not."""
    document = await app.operations.calibrations.find(calibration_id)
    found = await app.store.arm(document.id)
    if found is None:
        what = Sentence("arm-errors-not-identified", calibration=document.id)
        raise NotFound(what, Sentence("calibrate-with-arm", body='{"arm": true}'))
    return document, found
