"""What `handeyed check` looks at, by the daemon that holds the devices. Nothing moves, and no scan is taken."""

from calibration.sentences.sentence import Sentence
from daemon.api.schemas.cell import CheckDocument
from daemon.application import Application
from daemon.cell.cell import motion_obstacles
from daemon.drift.cell_cameras import CellCamera
from daemon.errors import CellBusy, InterlockOpen
from drivers.errors import DeviceError


async def check_devices(app: Application) -> list[CheckDocument]:
    """One result for each thing that was looked at. Raises CellBusy while a run works."""
    if (run := app.supervisor.in_progress) is not None:
        raise CellBusy(Sentence("holder-run", run=run.id))
    results = [_storage(app), await _robot(app), *[await _camera(app, camera) for camera in app.cameras.cameras]]
    if app.settings.interlocks is not None:
        results.append(await _interlocks(app))
    links = {state.name: state for state in app.device_watch.states()}
    for name in app.settings.named_scanners():
        scanner = links[name]
        fix = "" if scanner.connected or scanner.last_error is None else scanner.last_error.fix
        results.append(CheckDocument.of(name, scanner.connected, scanner.detail, fix))
    return results


def _storage(app: Application) -> CheckDocument:
    reasons, free_gb = app.store.obstacles(), app.store.free_bytes() / 1e9
    if reasons:
        return CheckDocument.of("storage", False, "; ".join(reasons), "see docs/runbook.md")
    return CheckDocument.of("storage", True, Sentence("check-storage", folder=str(app.store.folder), free_gb=free_gb))


async def _robot(app: Application) -> CheckDocument:
    try:
        reading = await app.readings.robot.read()
    except DeviceError as error:
        app.device_watch.note("robot", error)
        return CheckDocument.of("robot", False, error.what, error.fix)
    if reasons := motion_obstacles(reading.status):
        what = Sentence("check-robot-not-ready", reasons=list(reasons))
        return CheckDocument.of("robot", False, what, Sentence("check-robot-fix"))
    x_mm, y_mm, z_mm = reading.pose.base_T_flange[:3, 3]
    could = "check-robot-moves" if app.cell.robot.capabilities.moves else "check-robot-reads"
    return CheckDocument.of("robot", True, Sentence(could, x_mm=x_mm, y_mm=y_mm, z_mm=z_mm))


async def _camera(app: Application, camera: CellCamera) -> CheckDocument:
    try:
        look = await camera.looks.read()
    except DeviceError as error:
        app.device_watch.note(camera.name, error)
        return CheckDocument.of(camera.name, False, error.what, error.fix)
    width, height = look.size
    expected = camera.settings.camera.intrinsics
    if expected is not None and look.size != tuple(expected.image_size):
        wanted_width, wanted_height = expected.image_size
        size = {"width": width, "height": height, "wanted_width": wanted_width, "wanted_height": wanted_height}
        what = Sentence("check-camera-size", **size)
        return CheckDocument.of(camera.name, False, what, Sentence("check-camera-size-fix"))
    found = 0 if look.detection is None else len(look.detection.ids)
    if not found:
        return CheckDocument.of(camera.name, True, Sentence("check-camera-no-target", width=width, height=height))
    what = Sentence("check-camera-points", width=width, height=height, found=found, of=look.of)
    return CheckDocument.of(camera.name, True, what)


async def _interlocks(app: Application) -> CheckDocument:
    try:
        await app.cell.require_interlocks()
    except InterlockOpen as error:
        return CheckDocument.of("interlocks", False, error.what, error.fix)
    return CheckDocument.of("interlocks", True, Sentence("check-interlocks"))
