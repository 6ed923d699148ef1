"""The ASGI application: routes, middleware, and the error handlers that answer problem details."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import ASGIApp, Receive, Scope, Send

from calibration.errors import CalibrationError
from daemon.api import openapi, problems
from daemon.api.extension import Extensions
from daemon.api.live.live_feed import LiveFeed
from daemon.api.live.picture_stream import PictureStream
from daemon.api.middleware.abort_first import AbortFirst
from daemon.api.middleware.authentication import Authentication
from daemon.api.middleware.disconnects import Disconnects
from daemon.api.middleware.idempotency import Idempotency
from daemon.api.middleware.request_checks import RequestChecks
from daemon.api.route_table import routers
from daemon.api.routes.cell import RobotDocuments
from daemon.application import Application
from daemon.errors import DaemonError
from daemon.page import PageFiles
from daemon.runtime.version import RELEASE
from drivers.errors import DeviceError
from registration.errors import RegistrationError

ABOUT = (
    "Eye-in-hand calibration of an ABB robot cell, and point clouds in the robot's base frame. Lengths mm, angles deg,"
    " quaternions w first. Errors are application/problem+json with `code` and `fix`, or text where Accept prefers it."
)


def create_api(app: FastAPI, application: Application) -> ASGIApp:
    """The REST interface of `application`, stopped by its lifespan: `app`, for requests behind the middleware."""
    keyed = Idempotency(app, application, app.state.extensions)
    known = Authentication(AbortFirst(keyed, application), application)
    checked = RequestChecks(Disconnects(known), application.settings.server, application.metrics)

    async def api(scope: Scope, receive: Receive, send: Send) -> None:
        await (checked if scope["type"] == "http" else app)(scope, receive, send)

    return api


def routes(application: Application | None, extensions: Extensions = ()) -> FastAPI:
    """The routes without middleware; with `application` None only for openapi.json."""

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        assert application is not None
        yield
        await application.stop()

    app = FastAPI(
        title="handeyed",
        version=RELEASE,
        description=ABOUT,
        lifespan=lifespan,
        docs_url=None,  # its pages load scripts from other servers
        redoc_url=None,
        openapi_url=None,  # made on the event loop by FastAPI
        redirect_slashes=False,  # one spelling per path; redirections are not problem documents
        routes=[route for router in routers(extensions) for route in router.routes],
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
    )
    app.state.application, app.state.extensions = application, extensions
    if application is not None:
        app.state.live, cameras = LiveFeed(application), application.cameras
        app.state.picture_streams = {camera.name: PictureStream(application, camera) for camera in cameras}
        app.state.robot_documents = RobotDocuments(application)
        app.add_route(openapi.PATH, openapi.OpenApiRoute(app, application.service_workers).respond)
    app.state.page_files = PageFiles()
    for kind in (DaemonError, CalibrationError, DeviceError, RegistrationError, Exception):
        app.add_exception_handler(kind, problems.handle)
    app.add_exception_handler(RequestValidationError, problems.handle_validation)
    app.add_exception_handler(HTTPException, _http_error)
    app.openapi = lambda: openapi.build_openapi(app)  # type: ignore[method-assign]
    return app


async def _http_error(request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException) and error.status_code == 405:
        here = (route for route in request.app.routes if route.matches(request.scope)[0] is not Match.NONE)
        methods = {method for route in here for method in getattr(route, "methods", None) or ()}
        error = HTTPException(405, headers={"Allow": ", ".join(sorted(methods))})
    return await problems.handle_http(request, error)
