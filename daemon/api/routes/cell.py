"""GET /robot and /camera/frame.png."""

import math

from fastapi import APIRouter, Request, Response

from calibration.documents.pose import PoseDocument
from daemon.api.dependencies import App
from daemon.api.negotiation import or_text, respond
from daemon.api.plain_text import robot_text
from daemon.api.problems import problem_responses
from daemon.api.schemas.cell import RobotDocument

router = APIRouter(tags=["cell"])


@router.get(
    "/robot", response_model=RobotDocument, responses={200: or_text("The robot"), **problem_responses(502, 503, 504)}
)
async def robot(request: Request, app: App) -> Response:
    """The pose of the arm, and the status of the controller, of at most the last 0.1 s."""
    link = app.cell.robot.link
    reading = await app.readings.robot.read()
    status, pose = reading.status, reading.pose
    cf1, cf4, cf6, cfx = pose.posture
    document = RobotDocument(
        connected=link.connected,
        detail=link.detail,
        base_T_flange=PoseDocument.of(pose.base_T_flange),
        configuration=(cf1, cf4, cf6, cfx),
        joints_deg=[math.degrees(angle) for angle in reading.joints],
        still=pose.still,
        motors_on=status.motors_on,
        automatic=status.automatic,
        emergency_stop=status.emergency_stop,
        moving=status.moving,
        armed=status.armed,
        program_running=status.program_running,
        speed_limited=status.speed_limited,
        held_by=app.cell.holder,
    )
    return respond(request, document, lambda: robot_text(document))


@router.get(
    "/camera/frame.png",
    response_class=Response,
    responses={200: {"description": "What the camera sees now", "content": {"image/png": {}}},
               **problem_responses(502, 503, 504)},
)  # fmt: skip
async def camera_frame(app: App) -> Response:
    """A picture of at most the last 0.1 s, or one taken for those who asked meanwhile."""
    content = await app.readings.picture.read()
    return Response(content, media_type="image/png", headers={"Cache-Control": "no-store"})
