"""GET /robot and /camera/frame.png."""

from fastapi import APIRouter, Request, Response

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
    reading = await app.readings.robot.read()
    document = RobotDocument.of(reading, app.cell.robot.link, app.cell.holder, app.operations.rules.arm)
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
