"""The cell's devices: /robot, /arm, /devices, /check and the camera's pictures."""

from typing import Any

from fastapi import Depends, Request, Response

from calibration.documents.calibration import SentenceDocument
from calibration.sentences.sentence import Sentence
from daemon.api.dependencies import App, WidthQuery, WithCamera, api_router, in_content, in_words, no_body
from daemon.api.live.picture_stream import STREAM, StreamedPictures, working_run
from daemon.api.negotiation import PICTURE_TYPES, choose_picture_type, respond
from daemon.api.plain_text import robot_text
from daemon.api.problems import problem_responses
from daemon.api.schemas.cell import (
    ArmDocument,
    ArmTemperatureDocument,
    ArmTemperatureRequest,
    CheckDocument,
    CheckList,
    DeviceDocument,
    LookDocument,
    RobotDocument,
)
from daemon.application import Application, CellCamera
from daemon.cell.cell import motion_obstacles
from daemon.cell.readings import RobotReading
from daemon.config.settings import MAIN_CAMERA
from daemon.errors import CellBusy, InterlockOpen
from daemon.model.check_result import CheckResult
from daemon.sessions.pictures import PictureType, Width, encode_file
from daemon.sessions.session_writer import image_name
from daemon.tools.support_bundle.bundle import redact
from drivers.errors import DeviceError
from drivers.interfaces import CaptureSettings

router = api_router(tags=["cell"])


@router.get("/robot", **in_words(RobotDocument, "The robot", 502, 503, 504))
async def robot(request: Request, app: App) -> Response:
    """The pose of the arm, and the status of the controller, of at most the last 0.1 s."""
    documents: RobotDocuments = request.app.state.robot_documents
    document = await documents.read()
    return respond(request, document, lambda: robot_text(document))


@router.get("/arm", response_model=ArmDocument, responses=problem_responses(404))
async def arm(app: App, camera: WithCamera) -> ArmDocument:
    """The arm, its limits, the target and the poses of the settings: the same until the daemon starts again."""
    return ArmDocument.of_settings(camera.settings, app.operations.rules.model, app.cell.robot.capabilities.moves)


@router.get("/arm/temperature", response_model=ArmTemperatureDocument)
async def arm_temperature(app: App) -> ArmTemperatureDocument:
    """The temperature of the arm's links as stated last; null where it was not, or too long ago."""
    now = app.cell.arm
    return ArmTemperatureDocument(temperature_c=now.conditions().temperature_c, age_s=now.temperature_age_s)


@router.post("/arm/temperature", response_model=ArmTemperatureDocument, responses=problem_responses(400))
async def state_arm_temperature(body: ArmTemperatureRequest, app: App) -> ArmTemperatureDocument:
    """State the temperature of the arm's links, which holds for `[robot] temperature_minutes`.

    Views are recorded with it, and with an arm whose errors were identified with its temperatures points are placed for
    this one.
    """
    app.cell.arm.state_temperature(body.temperature_c)
    return await arm_temperature(app)


@router.get("/devices", response_model=list[DeviceDocument])
async def devices(app: App) -> list[DeviceDocument]:
    """Each device: its address, whether its link is up, since when, and its last error. Nothing is sent to it."""
    settings = app.settings
    addresses = {"robot": settings.robot.address, "camera": settings.camera.address}
    addresses |= {name: camera.address for name, camera in settings.cameras.items()}
    addresses |= {name: scanner.address for name, scanner in settings.named_scanners().items()}
    devices = ((state, redact(addresses.get(state.name, ""))) for state in app.device_watch.states())
    return [DeviceDocument(**vars(one), kind=at.partition(":")[0], address=at) for one, at in devices]


@router.post("/check", response_model=CheckList, dependencies=[Depends(no_body)], responses=problem_responses(400, 500))
async def check(app: App) -> CheckList:
    """Ask robot, camera and interlocks, and look at the store: what is well, and what to do about the rest.

    Nothing moves and no scan is taken. 409 while a run works.
    """
    results = []
    for one in await check_devices(app):
        what, fix = SentenceDocument.each_of((one.what, one.fix))
        results.append(CheckDocument(**vars(one), what_detail=what, fix_detail=fix))
    return CheckList(results=results)


PICTURES: tuple[str, dict[str, Any]] = "A picture", {media_type: {} for media_type in PICTURE_TYPES}


@router.get("/camera/frame", **in_content(*PICTURES, 404, 406, 409, 502, 503, 504))
async def camera_picture(request: Request, app: App, camera: WithCamera, width: WidthQuery = None) -> Response:
    """What the camera sees, as Accept prefers: one grab for all who ask within 0.5 s.

    `Handeyed-Bits`, `Handeyed-Exposure-Us` and `Handeyed-Gain-Db`: of the picture, where the camera reports them.

    While a run works, its last picture, and never one taken for this; 409 before its first.
    """
    return await _picture(app, camera, choose_picture_type(request), width, {"Vary": "Accept"})


@router.get("/camera/frame.png", **in_content("What the camera sees now", {"image/png": {}}, 404, 409, 502, 503, 504))
async def camera_frame(app: App, camera: WithCamera) -> Response:
    """The same as PNG, in the camera's own size, whatever Accept says."""
    return await _picture(app, camera, "image/png", None, {})


async def _picture(
    app: Application, camera: CellCamera, media_type: PictureType, width: Width | None, headers: dict[str, str]
) -> Response:
    headers = {"Cache-Control": "no-store", **headers}
    run = working_run(app)
    if run is None:
        picture = await camera.pictures.read(media_type, width)
        headers |= {"Handeyed-Source": "camera", **_capture_headers(picture.capture)}
        return Response(picture.content, media_type=media_type, headers=headers)
    if run.kind == "scan" or run.pictures == 0 or run.request.get("camera", MAIN_CAMERA) != camera.name:
        raise CellBusy(Sentence("holder-run-without-picture", run=run.id))
    content = await stored_picture(app, run.id, run.pictures - 1, media_type, width)
    source = f"/runs/{run.id}/frames/{run.pictures - 1}"
    return Response(content, media_type=media_type, headers={**headers, "Handeyed-Source": source})


def _capture_headers(capture: CaptureSettings | None) -> dict[str, str]:
    """Bits, exposure and gain as headers, as far as the camera reports them."""
    if capture is None:
        return {}
    values = {"Bits": capture.bits, "Exposure-Us": capture.exposure_us, "Gain-Db": capture.gain_db}
    return {f"Handeyed-{name}": f"{value:g}" for name, value in values.items() if value is not None}


@router.get("/camera/stream", **in_content("Pictures", {STREAM: {}}, 404, 503))
async def camera_stream(request: Request, camera: WithCamera, width: WidthQuery = 480) -> Response:
    """JPEG pictures as they come, for `<img>` or fetch: up to ten a second while they change, else two.

    Headers of a part: `Handeyed-Picture` (its number), `Handeyed-Age-S`, and `Handeyed-Look`: GET /camera/look of this
    picture, in pixels of its own size; not with every one where that takes long. A part of application/problem+json:
    why none can be taken. While a run works, its pictures come, and none is taken for this. Who is slow misses some.
    At most 64 listeners of a camera share one reader, 32 of one address.
    """
    address = request.client.host if request.client else "unknown"
    return StreamedPictures(request.app.state.picture_streams[camera.name], address, width or 480)


@router.get("/camera/look", response_model=LookDocument, responses=problem_responses(404, 409, 502, 503, 504))
async def look(app: App, camera: WithCamera) -> LookDocument:
    """The target in a picture of at most the last 0.5 s, searched once for all who ask. 409 while a run works."""
    if (run := working_run(app)) is not None:
        raise CellBusy(Sentence("holder-run", run=run.id))
    return LookDocument.of_look(await camera.looks.read())


async def stored_picture(app: Application, run_id: str, k: int, media_type: PictureType, width: Width | None) -> bytes:
    """View `k` of a run in that size and format. Raises NotFound, PictureUnusable."""
    file = app.store.run_folder(run_id) / image_name(k)
    if media_type == "image/png" and width is None:
        return await app.store.read_file(file)
    return await app.service_workers.run(encode_file, file, media_type, width)


async def check_devices(app: Application) -> list[CheckResult]:
    """One result for each thing that was looked at. Raises CellBusy while a run works."""
    if (run := app.supervisor.in_progress) is not None:
        raise CellBusy(Sentence("holder-run", run=run.id))
    results = [_storage(app), await _robot(app), *[await _camera(app, camera) for camera in app.cameras]]
    if app.settings.interlocks is not None:
        results.append(await _interlocks(app))
    links = {state.name: state for state in app.device_watch.states()}
    for name in app.settings.named_scanners():
        scanner = links[name]
        fix = "" if scanner.connected or scanner.last_error is None else scanner.last_error.fix
        results.append(CheckResult(name, scanner.connected, scanner.detail, fix))
    return results


def _storage(app: Application) -> CheckResult:
    reasons, free_gb = app.store.obstacles(), app.store.free_bytes() / 1e9
    if reasons:
        return CheckResult("storage", False, "; ".join(reasons), "see docs/runbook.md")
    return CheckResult("storage", True, Sentence("check-storage", folder=str(app.store.folder), free_gb=free_gb))


async def _robot(app: Application) -> CheckResult:
    try:
        reading = await app.readings.robot.read()
    except DeviceError as error:
        app.device_watch.note("robot", error)
        return CheckResult("robot", False, error.what, error.fix)
    if reasons := motion_obstacles(reading.status):
        what = Sentence("check-robot-not-ready", reasons=list(reasons))
        return CheckResult("robot", False, what, Sentence("check-robot-fix"))
    x_mm, y_mm, z_mm = reading.pose.base_T_flange[:3, 3]
    could = "check-robot-moves" if app.cell.robot.capabilities.moves else "check-robot-reads"
    return CheckResult("robot", True, Sentence(could, x_mm=x_mm, y_mm=y_mm, z_mm=z_mm))


async def _camera(app: Application, camera: CellCamera) -> CheckResult:
    try:
        look = await camera.looks.read()
    except DeviceError as error:
        app.device_watch.note(camera.name, error)
        return CheckResult(camera.name, False, error.what, error.fix)
    width, height = look.size
    expected = camera.settings.camera.intrinsics
    if expected is not None and look.size != tuple(expected.image_size):
        wanted_width, wanted_height = expected.image_size
        size = {"width": width, "height": height, "wanted_width": wanted_width, "wanted_height": wanted_height}
        what = Sentence("check-camera-size", **size)
        return CheckResult(camera.name, False, what, Sentence("check-camera-size-fix"))
    found = 0 if look.detection is None else len(look.detection.ids)
    if not found:
        return CheckResult(camera.name, True, Sentence("check-camera-no-target", width=width, height=height))
    what = Sentence("check-camera-points", width=width, height=height, found=found, of=look.of)
    return CheckResult(camera.name, True, what)


async def _interlocks(app: Application) -> CheckResult:
    try:
        await app.cell.require_interlocks()
    except InterlockOpen as error:
        return CheckResult("interlocks", False, error.what, error.fix)
    return CheckResult("interlocks", True, Sentence("check-interlocks"))


class RobotDocuments:
    """One document a reading, ten a second at most: each takes 0.5 ms of the event loop, half of a request."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._last: tuple[RobotReading, RobotDocument] | None = None

    async def read(self) -> RobotDocument:
        """The document of a reading of at most the last 0.1 s. Raises DeviceError."""
        reading = await self._app.readings.robot.read()
        if self._last is None or self._last[0] is not reading:
            cell, arm = self._app.cell, self._app.operations.rules.model
            self._last = reading, RobotDocument.of(reading, cell.robot, cell.holder, arm)
        return self._last[1]
