"""GET /calibrations/{id}/exports: X and the poses it was taken from, as files of other systems."""

from typing import Annotated, Any

import numpy as np
from fastapi import Path, Query, Response

from calibration.documents.exports.formats import FORMATS, POSE_FORMATS, ExportFormat, export, export_poses
from calibration.documents.exports.pose_list import PoseList, pose_list
from calibration.documents.exports.subject import (
    DEFAULT_DECIMALS,
    FRAME_NAME,
    MAX_DECIMALS,
    OPTICAL_FRAME,
    ExportOptions,
)
from calibration.documents.session import SessionDocument
from calibration.documents.validation import parse_document
from calibration.kinematics.abb_arms import find_arm
from daemon.api.dependencies import IN_WHOLE_DIGITS, App, Identifier, api_router, in_content
from daemon.api.problems import problem_responses
from daemon.api.schemas.calibrations import ExportDocument, ExportList
from daemon.application import Application
from daemon.errors import NotFound
from daemon.sessions.session_files import SESSION_FILE

router = api_router(prefix="/calibrations", tags=["calibrations"])

FRAME = f"^(?:{FRAME_NAME.pattern})$"
Format = Annotated[str, Path(min_length=1, max_length=40, description="as in the list")]
Parent = Annotated[str | None, Query(pattern=FRAME, max_length=250, description="name of the flange's or base's frame")]
CHILD = "name of the camera's frame; one that ends with camera_link is its body frame (REP 103)"
Child = Annotated[str, Query(pattern=FRAME, max_length=250, description=CHILD)]
Decimals = Annotated[int, Query(ge=0, le=MAX_DECIMALS, description="of lengths in mm"), IN_WHOLE_DIGITS]
EVERY: dict[str, ExportFormat[Any]] = {**FORMATS, **POSE_FORMATS}


@router.get("/{calibration_id}/exports", response_model=ExportList, responses={**problem_responses(404, 409)})
async def exports(app: App, calibration_id: Identifier) -> ExportList:
    """The formats in which this calibration and its poses can be had. "current" is the active one."""
    document = await app.operations.calibrations.find(calibration_id)
    here = f"/calibrations/{document.id}/exports"
    listed = [ExportDocument(**vars(each), format=each.name, href=f"{here}/{each.name}") for each in EVERY.values()]
    return ExportList(exports=listed)


@router.get(
    "/{calibration_id}/exports/{export_format}",
    **in_content("The file", {each.media_type: {} for each in EVERY.values()}, 404, 409),
)
async def exported(
    app: App,
    calibration_id: Identifier,
    export_format: Format,
    parent: Parent = None,
    child: Child = OPTICAL_FRAME,
    decimals: Decimals = DEFAULT_DECIMALS,
) -> Response:
    """The calibration as a file of another system. Frames, units and the calibration's id stand in a comment."""
    known = EVERY.get(export_format)
    if known is None:
        raise NotFound(
            f"there is no format {export_format!r}", f"GET /calibrations/{calibration_id}/exports lists them"
        )
    document = await app.operations.calibrations.find(calibration_id)
    if export_format in POSE_FORMATS:
        content = export_poses(await _poses(app, document.id), export_format)
    else:
        content = export(document, export_format, ExportOptions(parent, child, decimals))
    headers = {"Content-Disposition": f'attachment; filename="{known.file}"'}
    return Response(content, media_type=known.media_type, headers=headers)


async def _poses(app: Application, calibration_id: str) -> PoseList:
    """The poses of the flange of the run that made the calibration. Raises NotFound without its session."""
    record = await app.store.calibration(calibration_id)
    if record.run_id is None:
        raise NotFound(f"calibration {calibration_id} was made by no run", "export the poses of its session.json")
    content = await app.store.read_file(app.store.session_folder(record.run_id, record.camera) / SESSION_FILE)
    session = parse_document(SessionDocument, content, SESSION_FILE)
    model = app.settings.robot.model if app.settings.robot.axes == 6 else None
    poses = np.array([view.base_T_flange.transform() for view in session.views]).reshape(-1, 4, 4)
    return pose_list(f"calibration {calibration_id}", poses, find_arm(model) if model else None)
