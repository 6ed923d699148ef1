"""Whether the daemon could calibrate or register now."""

from calibration.documents.calibration import SentenceDocument
from calibration.sentences.sentence import Sentence
from daemon.api.schemas.health import Readiness, ReadyDocument
from daemon.application import Application
from daemon.drift.cell_cameras import CellCamera
from daemon.errors import NoCalibration


async def readiness(app: Application, camera: CellCamera) -> ReadyDocument:
    """Check the calibration in force of the camera, and robot and camera unless a run uses them."""
    run = app.supervisor.in_progress
    calibrate: list[str] = (
        [Sentence("run-going-on", kind=str(run.kind), run=run.id)] if run else [*await camera.obstacles.read()]
    )
    calibrate += (*app.supervisor.obstacles(), *app.store.obstacles())
    register: list[str] = []
    try:
        await app.store.current(camera.name)
    except NoCalibration as error:
        register.append(error.what)
    of_sources = (warning for source in app.warning_sources for warning in source.warnings())
    warnings = list(dict.fromkeys([*_disk_warnings(app), *of_sources]))
    return ReadyDocument(
        ready=not calibrate or not register,
        calibrate=Readiness(ready=not calibrate, reasons=calibrate, reason_details=SentenceDocument.each_of(calibrate)),
        register_=Readiness(ready=not register, reasons=register, reason_details=SentenceDocument.each_of(register)),
        warnings=warnings,
        warning_details=SentenceDocument.each_of(warnings),
    )


def _disk_warnings(app: Application) -> list[str]:
    free_mb = app.store.free_bytes() / 1e6
    if app.store.fault is not None or free_mb >= app.settings.storage.reserve_mb:
        return []
    return [Sentence("disk-nearly-full", free_mb=free_mb, folder=str(app.store.folder))]
