"""GET and POST /calibrate, POST /verify."""

from typing import Annotated

from fastapi import Depends, Request, Response

from calibration.documents.pose import PoseDocument
from daemon.api.dependencies import (
    App,
    Before,
    Identifier,
    JsonBody,
    Limit,
    Wait,
    WithCamera,
    api_router,
    in_words,
    respond_page,
    respond_rows,
)
from daemon.api.middleware.disconnects import client_of
from daemon.api.negotiation import respond
from daemon.api.plain_text import status_text
from daemon.api.problems import problem_responses
from daemon.api.readiness import readiness
from daemon.api.routes.runs import STARTED, answer_run_start
from daemon.api.schemas.answer import Answer, StoredAnswer
from daemon.api.schemas.calibrations import AppliedDocument, CalibrateStatus, CalibrationSummary
from daemon.api.schemas.cell import ForesightDocument, frame_warning
from daemon.api.schemas.runs import RunDocument
from daemon.application import Application, CellCamera
from daemon.config.settings import CalibrationSettings
from daemon.errors import NoCalibration
from daemon.model.requests import CalibrateRequest, VerifyRequest
from daemon.runs.adaptive_sequence import draw_poses
from daemon.runs.pose_selection import stopping_rule
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.store.actor import current_audit_context
from daemon.store.damaged_rows import split_damaged
from daemon.store.documents import DocumentRecord
from daemon.store.listings import PageFilters
from drivers.errors import DeviceError

router = api_router(tags=["calibrate"])

HOW_TO_START = (
    "POST /calibrate with no body, or with poses, count, tolerance_mm, uncertainty_mm, target, manual, arm or camera;"
    " ?wait=SECONDS answers the finished run"
)


@router.get("/calibrate", **in_words(CalibrateStatus, "In words", 404))
async def calibrate_status(request: Request, app: App, camera: WithCamera) -> Response:
    """Where calibration stands and how to start. Never moves anything."""
    status = await _status(app, camera)
    return respond(request, status, lambda: status_text(status, str(request.base_url)))


@router.post("/calibrate", response_model=RunDocument, responses=STARTED)
async def calibrate(
    request: Request, app: App, body: Annotated[CalibrateRequest, Depends(JsonBody(CalibrateRequest))], wait: Wait = 0.0
) -> Response:
    """Drive the arm through calibration poses, look at the target from each, solve for X, store it."""
    return await answer_run_start(request, app, await app.camera(body.camera).operations.calibrate(body), wait)


@router.post(
    "/plan",
    response_model=ForesightDocument,
    responses=problem_responses(400, 404, 409, 413, 422, 429, 500, 502, 503, 504),
)
async def plan(app: App, body: Annotated[CalibrateRequest, Depends(JsonBody(CalibrateRequest))]) -> Response:
    """What POST /calibrate would do from where the arm stands. Never moves anything; 409 while a run is in progress."""
    reading = await app.readings.robot.read()
    found = await app.camera(body.camera).operations.foresee(body, reading.pose, reading.joints)

    def as_json() -> bytes:
        poses = list(draw_poses(app.operations.rules.arm, found.base_T_flange, found.joints_rad))
        document = ForesightDocument(poses=poses, predicted_mm=list(found.predicted_mm), note=found.note)
        return document.model_dump_json().encode()

    return await respond_page(app, as_json)


class StoredAcceptance(StoredAnswer):
    """A verification of the scanner, as POST /verify answered it."""

    acceptance: AcceptanceDocument


class AcceptanceList(Answer):
    """The newest first; `next` asks for those before them. `damaged`: ids of rows that cannot be read."""

    acceptances: list[StoredAcceptance]
    damaged: list[str]
    next: str | None


@router.get("/acceptances", response_model=AcceptanceList)
async def acceptances(app: App, limit: Limit = 50, before: Before = None) -> Response:
    """The scanner's verifications, newest first."""
    found = await app.store.acceptances.page(limit + 1, before)
    return await respond_rows(app, found, limit, "/acceptances", StoredAcceptance.of_record)


@router.get("/acceptances/{acceptance_id}", response_model=StoredAcceptance, responses=problem_responses(404))
async def acceptance(app: App, acceptance_id: Identifier) -> StoredAcceptance:
    """One verification of the scanner."""
    return StoredAcceptance.of_record(await app.store.acceptances.get(acceptance_id))


@router.post(
    "/verify", response_model=RunDocument | AcceptanceDocument, responses={**STARTED, **problem_responses(404, 429)}
)
async def verify(
    request: Request, app: App, body: Annotated[VerifyRequest, Depends(JsonBody(VerifyRequest))], wait: Wait = 0.0
) -> Response:
    """Look at the target again from three positions: each point in base coordinates, and how far they scatter.

    With `artefact` and `scan_id`: the scanner's probing and sphere-spacing errors, from a scan of spheres or ball bars;
    stored, Location says where.
    """
    if body.artefact is not None and body.scan_id is not None:
        async with client_of(request).until_disconnected():
            found = await app.scans.assess_scanner(body.scan_id, body.artefact)
        content, stored_id = found.model_dump_json(), app.new_id()
        at, actor = app.clock.timestamp(), current_audit_context().actor
        await app.store.acceptances.save(DocumentRecord(stored_id, body.scan_id, at, actor, content))
        return Response(content, headers={"Location": f"/acceptances/{stored_id}"}, media_type="application/json")
    return await answer_run_start(request, app, await app.camera(body.camera).operations.verify(body), wait)


async def _status(app: Application, camera: CellCamera) -> CalibrateStatus:
    try:
        applied, record = await app.store.current(camera.name)
    except NoCalibration:
        current, in_force, on_flange = None, None, None
    else:
        accuracy = await camera.operations.calibrations.accuracy(record.document)
        current, in_force = CalibrationSummary.of(record, accuracy, current=True), AppliedDocument(**vars(applied))
        on_flange = record.document.flange_T_camera or record.document.flange_T_target
    ready = (await readiness(app, camera)).calibrate
    running = app.supervisor.in_progress
    calibrations = PageFilters({"kind": "calibration"})
    listed, _ = split_damaged(await app.supervisor.listings(2, None, calibrations))  # one may be in progress
    ended = next((run.id for run in listed if run.is_over), None)
    last = None if ended is None else await app.supervisor.run(ended)
    return CalibrateStatus(
        current=current,
        applied=in_force,
        in_progress=None if running is None else RunDocument.of(running),
        last_run=None if last is None else RunDocument.of(last),
        ready=ready.ready,
        reasons=ready.reasons,
        policy=camera.settings.calibration.policy,
        poses=_poses_text(camera.settings.calibration),
        how_to_start=HOW_TO_START,
        warnings=[*app.operations.rules.warnings(), *await _frame_warnings(app)],
        fastest_mm_s=await _fastest_mm_s(app, camera, on_flange),
    )


async def _fastest_mm_s(app: Application, camera: CellCamera, applied: PoseDocument | None) -> float | None:
    """Largest speed of what moves; camera or target is where the active calibration, or else the guess, has it."""
    guesses = camera.settings.calibration
    on_flange = applied or guesses.flange_T_camera_guess or guesses.flange_T_target_guess
    if not app.cell.robot.link.connected:
        return None
    try:
        setup = await app.readings.setup.read()
    except DeviceError:
        return None
    if setup is None:
        return None
    return app.operations.rules.fastest_mm_s(setup.reach_mm, None if on_flange is None else on_flange.transform())


async def _frame_warnings(app: Application) -> list[str]:
    """What the axes of a known arm say against the pose that its controller reports."""
    arm = app.operations.rules.model
    if arm is None or not app.cell.robot.link.connected:
        return []
    try:
        found = frame_warning(arm, await app.readings.robot.read())
    except DeviceError:
        return []
    return [] if found is None else [found]


def _poses_text(settings: CalibrationSettings) -> str:
    if settings.poses:
        return f"{len(settings.poses)} taught in the settings"
    rule = stopping_rule(settings, CalibrateRequest())
    usual = "" if settings.tolerance_mm else " (not stated by you)"
    goals = ((rule.tolerance_mm, f"to U = {{:g}} mm{usual}"), (rule.uncertainty_mm, "to {:g} mm"))
    met = " and ".join(words.format(goal_mm) for goal_mm, words in goals if goal_mm)
    enough = f", until a measured point is known {met}" if met else ""
    return f"a first look from where the arm stands, then up to {rule.views_left} planned one after the other{enough}"
