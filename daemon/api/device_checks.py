"""What `handeyed check` looks at, by the daemon that holds the devices. Nothing moves, and no scan is taken."""

from daemon.api.schemas.cell import CheckDocument
from daemon.application import Application
from daemon.cell.cell import motion_obstacles
from daemon.errors import CellBusy, InterlockOpen
from drivers.errors import DeviceError


async def check_devices(app: Application) -> list[CheckDocument]:
    """One result for each thing that was looked at. Raises CellBusy while a run works."""
    if (run := app.supervisor.in_progress) is not None:
        raise CellBusy(f"run {run.id}")
    results = [_storage(app), await _robot(app), await _camera(app)]
    if app.settings.interlocks is not None:
        results.append(await _interlocks(app))
    links = {state.name: state for state in app.device_watch.states()}
    if (scanner := links.get("scanner")) is not None:
        fix = "" if scanner.connected or scanner.last_error is None else scanner.last_error.fix
        results.append(CheckDocument(name="scanner", ok=scanner.connected, what=scanner.detail, fix=fix))
    return results


def _storage(app: Application) -> CheckDocument:
    reasons, free_gb = app.store.obstacles(), app.store.free_bytes() / 1e9
    if reasons:
        return CheckDocument(name="storage", ok=False, what="; ".join(reasons), fix="see docs/runbook.md")
    return CheckDocument(name="storage", ok=True, what=f"{app.store.folder}, {free_gb:.1f} GB free", fix="")


async def _robot(app: Application) -> CheckDocument:
    try:
        reading = await app.readings.robot.read()
    except DeviceError as error:
        app.device_watch.note("robot", error)
        return CheckDocument(name="robot", ok=False, what=error.what, fix=error.fix)
    if reasons := motion_obstacles(reading.status):
        found = "; ".join(reason.removeprefix("robot: ") for reason in reasons)
        fix = "put this right at the controller"
        return CheckDocument(name="robot", ok=False, what=f"answers, but {found}", fix=fix)
    x, y, z = reading.pose.base_T_flange[:3, 3]
    could = "could move" if app.cell.robot.capabilities.moves else "is read only: views are taken by hand"
    what = f"answers and {could}; the flange stands at ({x:.1f}, {y:.1f}, {z:.1f}) mm"
    return CheckDocument(name="robot", ok=True, what=what, fix="")


async def _camera(app: Application) -> CheckDocument:
    try:
        look = await app.looks.read()
    except DeviceError as error:
        app.device_watch.note("camera", error)
        return CheckDocument(name="camera", ok=False, what=error.what, fix=error.fix)
    width, height = look.size
    picture, expected = f"a picture of {width} x {height}", app.settings.camera.intrinsics
    if expected is not None and look.size != tuple(expected.image_size):
        wanted = f"{expected.image_size[0]} x {expected.image_size[1]}"
        what = f"{picture}, but the intrinsics are for {wanted}"
        return CheckDocument(name="camera", ok=False, what=what, fix="correct one of them")
    found = 0 if look.detection is None else len(look.detection.ids)
    seen = f"it shows {found} of the target's {look.of} points" if found else "the target is not in view now"
    return CheckDocument(name="camera", ok=True, what=f"{picture}; {seen}", fix="")


async def _interlocks(app: Application) -> CheckDocument:
    try:
        await app.cell.require_interlocks()
    except InterlockOpen as error:
        return CheckDocument(name="interlocks", ok=False, what=error.what, fix=error.fix)
    return CheckDocument(name="interlocks", ok=True, what="all allow motion", fix="")
