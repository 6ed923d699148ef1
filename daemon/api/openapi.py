"""Build openapi.json: FastAPI's document with bodies, problems, keys and examples added."""

import asyncio
import json
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import models_json_schema
from starlette.routing import BaseRoute

from calibration.errors import DocumentProblem
from daemon import errors
from daemon.access import errors as access
from daemon.access.roles import Role, role_for
from daemon.api import http_errors
from daemon.api.dependencies import JsonBody
from daemon.api.middleware.idempotency import KEY_PATTERN, MAX_KEY_LENGTH, NOT_STORED
from daemon.api.problems import problem_of
from daemon.api.route_table import TAGS
from daemon.api.schemas.answer import Answer
from daemon.api.schemas.drift import DriftDocument
from daemon.api.schemas.runs import RunDocument
from daemon.api.schemas.scans import ScanDocument
from daemon.http.problem_details import MEDIA_TYPE, Problem, reason_phrase
from daemon.runtime.workers import Workers
from drivers import errors as device

_RUN = "20261121-090000-3f9a1c"
_FULL = "the disk of /var/lib/handeyed/handeyed.sqlite is full"

EXAMPLES: dict[int, Exception] = {
    400: http_errors.BodyMalformed(
        "the body is not JSON (Expecting value at line 1, column 2)", "send JSON, or no body"
    ),
    401: access.KeyMissing("this needs a key"),
    403: http_errors.CrossOrigin("a page of 'https://elsewhere.example' asks", "ask from a page of this daemon"),
    404: errors.NotFound(f"there is no run {_RUN!r}", "GET /runs lists them"),
    406: http_errors.NotAcceptable("a cloud is not answered as 'image/png'", "set Accept to application/x-ply"),
    409: errors.RunInProgress("calibration", _RUN),
    412: errors.AppliedMeanwhile(7),
    413: http_errors.BodyTooLarge(1_000_000),
    415: http_errors.UnknownMediaType(
        "a cloud of type 'text/csv' is not taken", "set Content-Type to application/x-ply"
    ),
    421: http_errors.HostNotAllowed("elsewhere.example"),
    422: http_errors.InvalidRequest([DocumentProblem("cuont", "unknown key", "did you mean 'count'?")]),
    429: errors.WorkersBusy(4),
    500: errors.StorageError("/var/lib/handeyed: input/output error", "check the disk"),
    502: errors.PictureUnusable("the camera gave a picture of 640 x 480 pixels", "set its resolution back"),
    503: errors.CellNotReady(("robot: motors are off",)),
    504: device.DeviceTimeout("robot tcp://192.168.125.1:4242", "no answer within 2 s", "look at the controller"),
    507: errors.StorageFull(_FULL, "free some space there; what was stored before is unharmed"),
}

REF = "#/components/schemas/{model}"

PATH = "/openapi.json"

IDEMPOTENCY_KEY: dict[str, Any] = {
    "name": "Idempotency-Key",
    "in": "header",
    "required": False,
    "description": "A name for this request, such as a UUID. Sent again with the same name and body it is answered as"
    " the first time and nothing is done twice; with another body: 422; while the first is in progress: 409.",
    "schema": {
        "type": "string",
        "minLength": 1,
        "maxLength": MAX_KEY_LENGTH + 2,
        "pattern": f"^(?:{KEY_PATTERN.pattern})$",
    },
    "example": "8e03978e-40d5-43dd-bc93-6894a57f9324",
}
"""With or without the quotes of a structured field."""

EVERY_REQUEST = (400, 415, 421)
EVERY_POST = (403, 409, 413, 507)
"""Statuses from the middleware: a header repeated, a body encoded, another host; another origin, a key in use, a body
too large, a full disk."""

KEY_SCHEME: dict[str, Any] = {
    "type": "http",
    "scheme": "bearer",
    "description": "A key of role viewer, operator or admin: `x-role` is the lowest that an operation needs. Requests"
    " from the daemon's own machine need none until the first key exists.",
}

COOKIE_SCHEME: dict[str, Any] = {
    "type": "apiKey",
    "in": "cookie",
    "name": "__Host-handeyed",
    "description": "The session of a browser, from POST /session; on http://127.0.0.1 it is called handeyed. A request"
    " that changes something also needs an Origin of this daemon, or Sec-Fetch-Site: same-origin.",
}


COMPACT: dict[str, Any] = {"ensure_ascii": False, "separators": (",", ":")}


class OpenApiRoute:
    """GET /openapi.json: made by a worker when it is first asked for, 0.3 s that neither start nor event loop spend."""

    def __init__(self, app: FastAPI, workers: Workers) -> None:
        self._app, self._workers = app, workers
        self._content: asyncio.Task[bytes] | None = None

    async def respond(self, _: Request) -> Response:
        """The document; all who ask share the making of it."""
        if self._content is None:
            making = self._workers.run(lambda: json.dumps(build_openapi(self._app), **COMPACT).encode())
            self._content = asyncio.create_task(making)
        return Response(await asyncio.shield(self._content), media_type="application/json")


def build_openapi(app: FastAPI) -> dict[str, Any]:
    """The complete document, cached."""
    if app.openapi_schema is None:
        document = FastAPI.openapi(app)
        bodies = _bodies(app.routes)
        documented: dict[type[BaseModel], None] = dict.fromkeys([*bodies.values(), Problem])
        _, schemas = models_json_schema([(model, "validation") for model in documented], ref_template=REF)
        components = document.setdefault("components", {})
        models = components.setdefault("schemas", {})
        for unused in ("HTTPValidationError", "ValidationError"):
            models.pop(unused, None)
        models.update(schemas["$defs"])
        for answer in Answer.__subclasses__():
            extra: Any = answer.model_config.get("json_schema_extra")  # with the null values that FastAPI omits
            shown = extra.get("examples") if isinstance(extra, dict) else None
            if answer.__name__ in models and isinstance(shown, list):
                models[answer.__name__]["examples"] = shown
        for record in (DriftDocument, RunDocument, ScanDocument):
            models[record.__name__]["examples"] = TypeAdapter(record).json_schema()["examples"]
        components["securitySchemes"] = {"key": KEY_SCHEME, "session": COOKIE_SCHEME}
        components["parameters"] = {"IdempotencyKey": IDEMPOTENCY_KEY}
        document["tags"] = [{"name": name, "description": about} for name, about in TAGS.items()]
        document["servers"] = [{"url": "http://127.0.0.1:8372", "description": "this machine, as it comes"}]
        _make_portable(models)
        problems = _finish(document, bodies)
        components["responses"] = {str(status): _problem(status) for status in sorted(problems)}
        app.openapi_schema = document
    return app.openapi_schema


def _make_portable(schema: Any) -> None:
    """Write a schema so that OpenAPI Generator understands it, in the other of two ways that mean the same.

    An array of a fixed number of equal items as `items`, not `prefixItems`, which it reads as items of any type; and
    no default of a list or of a constant number, of which it makes R that is no R.
    """
    for inner in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        _make_portable(inner)
    if not isinstance(schema, dict):
        return
    first, *others = schema.get("prefixItems") or [None]
    if isinstance(first, dict) and all(one == first for one in others) and "maxItems" in schema:
        schema["items"] = schema.pop("prefixItems")[0]
    if isinstance(schema.get("default"), list) or isinstance(schema.get("const"), int):
        schema.pop("default", None)


def _bodies(routes: Sequence[BaseRoute]) -> dict[tuple[str, str], type[BaseModel]]:
    """The model of each route's JsonBody, by path and method."""
    return {
        (route.path, method): read.call.model
        for route in routes
        if isinstance(route, APIRoute)
        for read in route.dependant.dependencies
        if isinstance(read.call, JsonBody)
        for method in route.methods or ()
    }


def _finish(document: dict[str, Any], bodies: dict[tuple[str, str], type[BaseModel]]) -> set[int]:
    """Bodies and problems by reference, keys and statuses that every operation shares; returns all statuses."""
    used: set[int] = set()
    for path, item in document["paths"].items():
        for method, operation in item.items():
            if model := bodies.get((path, method.upper())):
                schema = {"$ref": REF.format(model=model.__name__)}
                operation["requestBody"] = {"required": False, "content": {"application/json": {"schema": schema}}}
            needed = role_for(method.upper(), path)
            operation["x-role"] = needed.word
            operation["security"] = [] if needed is Role.NOBODY else [{"key": []}, {"session": []}]
            if method == "post" and not NOT_STORED.fullmatch(path):
                reference = {"$ref": "#/components/parameters/IdempotencyKey"}
                operation.setdefault("parameters", []).append(reference)
            refused = () if needed is Role.NOBODY else (401, 403) if needed > Role.VIEWER else (401,)
            for status in (*EVERY_REQUEST, *refused, *(EVERY_POST if method == "post" else ())):
                operation["responses"].setdefault(str(status), {"content": {MEDIA_TYPE: {}}})
            for status, answer in operation["responses"].items():
                if MEDIA_TYPE in answer.get("content", {}):
                    operation["responses"][status] = {"$ref": f"#/components/responses/{status}"}
                    used.add(int(status))
            operation["responses"] = dict(sorted(operation["responses"].items()))
    return used


def _problem(status: int) -> dict[str, Any]:
    schema, example = {"$ref": "#/components/schemas/Problem"}, problem_of(EXAMPLES[status])
    return {
        "description": reason_phrase(status),
        "content": {MEDIA_TYPE: {"schema": schema, "example": example.model_dump(exclude_none=True)}},
    }
