"""Every router of the REST interface, the nouns its routes are listed under, and the links of GET /."""

from fastapi import APIRouter

from daemon.api.routes import admin, calibrate, calibrations, cell, drift, events, health, register, runs, scans
from daemon.api.schemas.health import Welcome
from daemon.runtime.version import SOFTWARE

LINKS = {
    "how to calibrate": "/calibrate",
    "runs": "/runs",
    "calibrations": "/calibrations",
    "calibration in force": "/calibrations/current",
    "drift": "/drift",
    "scans": "/scans",
    "robot": "/robot",
    "camera": "/camera/frame.png",
    "ready": "/ready",
    "health": "/health",
    "events": "/events",
    "metrics": "/metrics",
    "openapi": "/openapi.json",
}

TAGS = {
    "calibrate": "The main job: where the camera sits on the flange, and whether that still holds.",
    "runs": "What the arm was asked to do: at most one run at a time.",
    "calibrations": "Results, and which of them is in force.",
    "cell": "Robot and camera as they are now.",
    "register": "One cloud into the robot's base frame, while it passes by.",
    "scans": "Parts larger than one view.",
    "events": "What happens, as it happens.",
    "access": "Keys, and who did what.",
    "health": "Is it alive, could it work, what has it counted.",
}

root = APIRouter(tags=["health"])


@root.get("/", response_model=Welcome)
async def welcome() -> Welcome:
    """What there is."""
    return Welcome(software=SOFTWARE, links=LINKS)


ROUTERS: tuple[APIRouter, ...] = (
    root,
    health.router,
    calibrate.router,
    runs.router,
    calibrations.router,
    drift.router,
    cell.router,
    events.router,
    register.router,
    scans.router,
    admin.router,
)
