"""GET /, /health, /ready and /metrics."""

from typing import get_args

from fastapi import Request, Response

from calibration.errors import DocumentError
from daemon.api.dependencies import App, CameraName, ScannerName, api_router, in_content
from daemon.api.negotiation import or_text, respond
from daemon.api.plain_text import ready_text
from daemon.api.problems import problem_responses
from daemon.api.readiness import readiness
from daemon.api.schemas.health import HealthDocument, ReadyDocument
from daemon.application import Application
from daemon.config.settings import MAIN_CAMERA
from daemon.errors import NoCalibration
from daemon.model.records import RunKind
from daemon.model.run_states import FINAL_STATES
from daemon.runtime.metrics import Labels, Metric, exposition, merged
from daemon.runtime.version import SOFTWARE

router = api_router(tags=["health"])


@router.get("/health", response_model=HealthDocument)
async def health(app: App) -> HealthDocument:
    """The daemon answers; for its readiness see /ready."""
    return HealthDocument(status="alive", software=SOFTWARE, uptime_s=round(app.uptime_s(), 3))


@router.get(
    "/ready",
    response_model=ReadyDocument,
    responses={
        200: or_text("Ready"),
        503: {"description": "Not ready", "model": ReadyDocument},
        **problem_responses(404),
    },
)
async def ready(request: Request, app: App, camera: CameraName = None, scanner: ScannerName = None) -> Response:
    """Whether it could calibrate the camera now, or register by its calibration, and the reasons if not.

    503 when it could do neither. With `scanner`, of the camera beside it: `camera` is left out then.
    """
    if scanner is None:
        document = await readiness(app, app.camera(camera))
    elif camera is None:
        app.scans.settings_of(scanner)  # refuses an unknown one
        document = await readiness(app, app.camera(app.settings.camera_beside(scanner)), scanner)
    else:
        what = "the scanner's settings name its camera"
        raise DocumentError.one("query", "camera", what, "leave it out, or scanner")
    return respond(request, document, lambda: ready_text(document), 200 if document.ready else 503)


@router.get("/metrics", **in_content("Prometheus text", {"text/plain": {}}))
async def metrics(app: App) -> Response:
    """Metrics in Prometheus' text format."""
    connected: dict[Labels, float] = {
        (("device", name),): float(device.link.connected) for name, device in app.cell.links().items()
    }
    families = [
        Metric("handeyed_device_connected", "gauge", "1 while the device's link is up.", connected),
        Metric("handeyed_run_in_progress", "gauge", "1 while a run is in progress.",
               {(): float(app.supervisor.in_progress is not None)}),
        Metric("handeyed_runs_ended_total", "counter", "Runs that ended, by kind and state.",
               {(("kind", kind), ("state", state)): app.supervisor.end_counts[kind, state]
                for kind in get_args(RunKind) for state in sorted(FINAL_STATES)}),
        Metric("handeyed_uptime_seconds", "gauge", "Since the daemon started.", {(): app.uptime_s()}),
        Metric("handeyed_disk_free_bytes", "gauge", "Free where the store lies.",
               {(): float(app.store.free_bytes())}),
        *app.metrics.families(),
        *merged(family for service in app.services for family in service.families()),
    ]  # fmt: skip
    text = exposition([*families, *await _accuracies(app)])
    return Response(text, media_type="text/plain; version=0.0.4; charset=utf-8")


ACCURACY_GAUGES = {
    "expanded_mm": "U (k = 2) at the worst of the points that matter, of the active calibration.",
    "tolerance_mm": "Largest U that was accepted; label stated: whether somebody stated it.",
    "expected_mm": "U as expected before its run.",
    "before_mm": "U of the calibration that was active when it was made.",
}


async def _accuracies(app: Application) -> list[Metric]:
    """Of the active calibration of each camera that has one, with its arm's errors where they were taken up."""
    lengths_m: dict[str, dict[Labels, float]] = {field: {} for field in ACCURACY_GAUGES}
    for name in app.settings.camera_names:
        try:
            _, current = await app.store.current(name)
        except NoCalibration:
            continue
        accuracy = await app.operations.calibrations.accuracy(current.document)
        camera: Labels = () if name == MAIN_CAMERA else (("camera", name),)
        stated: Labels = (("stated", str(accuracy.tolerance_stated).lower()),)
        for field, by_camera in lengths_m.items():
            if (length_mm := getattr(accuracy, field)) is not None:
                by_camera[(*camera, *stated) if field == "tolerance_mm" else camera] = length_mm / 1e3
    return [
        Metric(f"handeyed_calibration_{field.removesuffix('_mm')}_meters", "gauge", about, lengths_m[field])
        for field, about in ACCURACY_GAUGES.items()
        if lengths_m[field]
    ]
