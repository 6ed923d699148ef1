"""Every router of the REST interface, the nouns its routes are listed under, and the links of GET /."""

from fastapi import APIRouter, Request, Response

from daemon.api.dependencies import api_router
from daemon.api.extension import Extensions
from daemon.api.routes import (
    admin,
    calibrate,
    calibrations,
    cell,
    drift,
    events,
    exports,
    health,
    help_codes,
    keys,
    page,
    register,
    reports,
    runs,
    scans,
    session,
    setup,
)
from daemon.api.schemas.health import Welcome
from daemon.runtime.version import SOFTWARE

_PLACES = """
runs calibrations drift scans robot arm devices acceptances help about ready health events live metrics
"""
LINKS = {
    "how to calibrate": "/calibrate",
    **{name: f"/{name}" for name in _PLACES.split()},
    "calibration in force": "/calibrations/current",
    "camera": "/camera/frame.png",
    "openapi": "/openapi.json",
}

TAGS = {
    "calibrate": "The main job: the camera's pose on the flange, and its verification.",
    "runs": "Calibration, verification and scan runs: at most one at a time.",
    "calibrations": "Calibrations, and which of them is active.",
    "cell": "The present state of robot and camera.",
    "register": "Transform one cloud into the robot's base frame while it is streamed.",
    "scans": "Scans of parts from several views.",
    "events": "Server-sent events.",
    "access": "Keys, browser sessions and the audit log.",
    "health": "Health, readiness and metrics.",
}

root = api_router(tags=["health"])


@root.get("/", response_model=Welcome)
async def welcome(request: Request) -> Response | Welcome:
    """Links to all resources; a browser is sent to the page."""
    place = "/page/#/setup" if request.app.state.application.setup_file else "/page/"
    if "text/html" in request.headers.get("accept", ""):
        return Response(status_code=303, headers={"Location": place, "Vary": "Accept"})
    added = (extension.links for extension in request.app.state.extensions)
    built = {"docs": "/docs/"} if page.SITE.is_dir() else {}
    links = LINKS | built | {name: path for links in added for name, path in links.items()}
    return Welcome(software=SOFTWARE, links=links)


ROUTERS: tuple[APIRouter, ...] = (
    register.router,  # tried in this order: the route of every cloud before fifty others
    root,
    health.router,
    calibrate.router,
    runs.router,
    calibrations.router,
    exports.router,
    reports.router,
    drift.router,
    cell.router,
    runs.robot,
    events.router,
    scans.router,
    admin.router,
    setup.router,
    session.router,
    page.router,
    page.docs,
    keys.router,
    help_codes.router,
)


def routers(extensions: Extensions) -> tuple[APIRouter, ...]:
    """Those of the core, then those of the extensions."""
    return ROUTERS + tuple(router for extension in extensions for router in extension.routers)
