"""Whether the daemon could calibrate or register now."""

import numpy as np

from calibration.documents.calibration import SentenceDocument
from calibration.sentences.sentence import Sentence
from daemon.api.schemas.health import Readiness, ReadyDocument
from daemon.application import Application, CellCamera
from daemon.errors import NoCalibration, NotFound


async def readiness(app: Application, camera: CellCamera, scanner: str | None = None) -> ReadyDocument:
    """Check the active calibration of the camera, and robot and camera unless a run uses them.

    With a `scanner`: whether it answers, and the active rig where that gives its place.
    """
    run = app.supervisor.in_progress
    calibrate: list[str] = (
        [Sentence("run-going-on", kind=Sentence(f"kind-{run.kind}"), run=run.id)]
        if run
        else [*await camera.obstacles.read()]
    )
    calibrate += (*app.supervisor.obstacles(), *app.store.obstacles())
    register = [] if scanner is None else [*app.cell.sensor_obstacles((scanner,))]
    try:
        if scanner is not None and app.settings.placed_by_rig(scanner):
            await app.operations.further_sensors(app.operations).base_T_sensor(scanner, np.eye(4))
        else:
            await app.store.current(camera.name)
    except (NoCalibration, NotFound) as error:
        register.append(error.what)
    free_mb, of_disk = app.store.free_bytes() / 1e6, list[str]()
    if app.store.fault is None and free_mb < app.settings.storage.reserve_mb:
        of_disk = [Sentence("disk-nearly-full", free_mb=free_mb, folder=str(app.store.folder))]
    warnings = list(dict.fromkeys([*of_disk, *app.warnings()]))
    return ReadyDocument(
        ready=not calibrate or not register,
        calibrate=Readiness(ready=not calibrate, reasons=calibrate, reason_details=SentenceDocument.each_of(calibrate)),
        register_=Readiness(ready=not register, reasons=register, reason_details=SentenceDocument.each_of(register)),
        warnings=warnings,
        warning_details=SentenceDocument.each_of(warnings),
    )
