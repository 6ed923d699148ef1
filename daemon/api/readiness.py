"""Whether the daemon could calibrate or register now."""

from daemon.api.schemas.health import Readiness, ReadyDocument
from daemon.application import Application
from daemon.errors import NoCalibration


async def readiness(app: Application) -> ReadyDocument:
    """Check the calibration in force, and the devices unless a run uses them."""
    run = app.supervisor.in_progress
    calibrate = [f"{run.kind} run {run.id} is in progress"] if run else [*await app.readings.obstacles.read()]
    calibrate += (*app.supervisor.obstacles(), *app.store.obstacles())
    register: list[str] = []
    try:
        await app.store.current()
    except NoCalibration as error:
        register.append(error.what)
    warnings = [*_disk_warnings(app), *(warning for source in app.warning_sources for warning in source.warnings())]
    return ReadyDocument(
        ready=not calibrate or not register,
        calibrate=Readiness(ready=not calibrate, reasons=calibrate),
        register_=Readiness(ready=not register, reasons=register),
        warnings=warnings,
    )


def _disk_warnings(app: Application) -> list[str]:
    free_mb = app.store.free_bytes() / 1e6
    if app.store.fault is not None or free_mb >= app.settings.storage.reserve_mb:
        return []
    return [f"only {free_mb:.0f} MB are left on the disk of {app.store.folder}: free some space"]
