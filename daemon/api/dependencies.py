"""Routers, and the dependencies of their routes: application, body, query parameters, pages."""

import json
import pathlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Generic, TypeVar

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from fastapi.routing import APIRoute
from pydantic import AfterValidator, BaseModel, BeforeValidator

from calibration.documents.validation import (
    MAX_PROBLEMS,
    Document,
    limit_problems,
    nearest_fix,
    shortened,
    validate_json,
)
from calibration.errors import DocumentProblem
from daemon.api.http_errors import BodyMalformed, InvalidRequest
from daemon.api.negotiation import or_text
from daemon.api.problems import problem_responses
from daemon.api.schemas.answer import Row, documents_of, page_json
from daemon.application import Application, CellCamera
from daemon.sessions.pictures import Width
from daemon.store.damaged_rows import DamagedRow, split_damaged
from daemon.store.listings import NO_FILTERS, PageFilters

Model = TypeVar("Model", bound=BaseModel)


ORIGIN = "request body"

MAX_JSON_VALUES = 4000
"""Commas of a JSON body. It bounds the time to check a body: 40 ms when each value is wrong."""

VALUES_ON_THE_LOOP, BYTES_ON_THE_LOOP = 400, 40_000
"""Of a JSON body that is checked on the event loop, in at most 5 ms; a larger one is checked in a thread."""


async def _application(request: Request) -> Application:
    """Asynchronous, as all dependencies: FastAPI calls others in its thread pool, which readers fill."""
    application: Application = request.app.state.application
    return application


App = Annotated[Application, Depends(_application)]
CameraName = Annotated[
    str | None,
    Query(min_length=1, max_length=32, description="name of one of [cameras]; 'camera' is the one of [camera]"),
]
ScannerName = Annotated[
    str | None,
    Query(min_length=1, max_length=32, description="name of one of [scanners]; 'scanner' is the one of [scanner]"),
]


async def _camera(app: App, camera: CameraName = None) -> CellCamera:
    """Raises NotFound."""
    return app.camera(camera)


WithCamera = Annotated[CellCamera, Depends(_camera)]
"""The camera that the query names."""

Identifier = Annotated[str, Path(min_length=1, max_length=64, description="as in Location and in the list")]

DECIMAL = re.compile(r"[ +-]?[0-9]+(?:\.[0-9]*)?(?:[eE][ +-]?[0-9]{1,3})?")
"""A number in a query. A space is a plus sign: that is how a query is decoded."""

WHOLE = re.compile(r"[ +-]?[0-9]{1,20}")


def _require(pattern: re.Pattern[str], meaning: str) -> BeforeValidator:
    """Refuses what Python would read as a number and JSON would not: "1_000", " 5 ", digits of other scripts."""

    def check(given: str) -> str:
        if not pattern.fullmatch(given):
            raise ValueError(f"not {meaning} in digits from 0 to 9")
        return given.replace(" ", "+")

    return BeforeValidator(check)


IN_DIGITS = _require(DECIMAL, "a number")
IN_WHOLE_DIGITS = _require(WHOLE, "a whole number")
AS_NUMBER = BeforeValidator(int)
"""For numbers of a given list, which pydantic compares as they are; stands before IN_WHOLE_DIGITS, and runs after."""

Wait = Annotated[
    float, Query(ge=0, le=3600, description="seconds to wait for the run's end before answering"), IN_DIGITS
]
Limit = Annotated[int, Query(ge=1, le=500, description="how many at most"), IN_WHOLE_DIGITS]
Before = Annotated[
    str | None, Query(min_length=1, max_length=64, description="cursor: the last id of the page before; see `next`")
]


def _in_utc(text: str) -> str:
    """A moment as the store writes it, YYYY-MM-DDTHH:MM:SS in UTC; of a year or month its first day."""
    whole = text + "-01-01"[len(text) - 4 :] if len(text) in (4, 7) else text
    try:
        at = datetime.fromisoformat(whole.replace(" ", "+"))  # a plus that nobody has escaped
        return (at.astimezone(UTC) if at.tzinfo else at).replace(tzinfo=None).isoformat()
    except (ValueError, OverflowError):  # OverflowError: an offset that leads out of the years 1 to 9999
        raise ValueError("not a date, or a date and time: write 2026-11-21, or 2026-11-21T09:00:00Z") from None


Moment = Annotated[
    str | None,
    Query(
        min_length=4,
        max_length=40,
        description="ISO 8601, such as 2026-11-21 or 2026-11-21T09:00:00Z; UTC without offset",
    ),
    AfterValidator(lambda text: None if text is None else _in_utc(text)),
]
WidthQuery = Annotated[
    Width | None, Query(description="pixels; a smaller picture is not enlarged"), AS_NUMBER, IN_WHOLE_DIGITS
]
NUMBER = r"-?[0-9]{1,6}(\.[0-9]{1,6})?"
BOX_PATTERN = f"^{NUMBER}(,{NUMBER}){{5}}$"


def box_of(text: str | None) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
    """Lowest and highest corner of a box by BOX_PATTERN; None without one."""
    if text is None:
        return None
    a, b, c, d, e, f = map(float, text.split(","))
    return (a, b, c), (d, e, f)


async def respond_rows(
    app: Application, found: Sequence[Row | DamagedRow], limit: int, path: str, document: Callable[[Row], Any],
    filters: PageFilters = NO_FILTERS, **lists: Any,
) -> Response:  # fmt: skip
    """Answer the page of up to `limit` + 1 rows `found`, each as its `document`, with the ids of those damaged.

    The rows have the name of their path; `lists` stand beside them.
    """
    page = found[:limit]
    following = f"{path}?limit={limit}{filters.query}&before={page[-1].id}" if len(found) > limit else None

    def as_json() -> bytes:
        read, damaged = split_damaged(documents_of(document, page))
        return page_json({path.strip("/"): read, "damaged": damaged, **lists}, following)

    return await respond_page(app, as_json)


async def respond_page(app: Application, as_json: Callable[[], bytes]) -> Response:
    """Answer what `as_json` builds, in a thread: pages of 500 would hold the event loop up."""
    return Response(await app.service_workers.run(as_json), media_type="application/json")


@dataclass(frozen=True)
class JsonBody(Generic[Model]):
    """A dependency that parses the JSON body as `model`, an empty one as {}; `build_openapi` documents the model."""

    model: type[Model]
    max_values: int = MAX_JSON_VALUES

    async def __call__(self, request: Request) -> Model:
        """Raises DocumentError, BodyMalformed; WorkersBusy on a route that takes more than MAX_JSON_VALUES."""
        content = await request.body()
        workers = request.app.state.application.service_workers
        if self.max_values > MAX_JSON_VALUES:
            return await workers.run_if_free(self._parse, content)  # type: ignore[no-any-return]
        if len(content) > BYTES_ON_THE_LOOP or content.count(b",") > VALUES_ON_THE_LOOP:
            return await workers.run(self._parse, content)  # type: ignore[no-any-return]
        return self._parse(content)

    def _parse(self, content: bytes) -> Model:
        return validate_json(self.model, _json(content, self.max_values), ORIGIN)


class _Nothing(Document):
    """An empty object."""


async def no_body(request: Request) -> None:
    """A dependency for routes without a body; {} is allowed. Raises DocumentError, BodyMalformed."""
    await JsonBody(_Nothing)(request)


def _json(content: bytes, max_values: int) -> Any:
    if not content.strip():
        return {}
    if content.count(b",") > max_values:
        what = f"the body holds more than {max_values} values"
        raise BodyMalformed(what, "send less: a hundred poses are 1500 values")
    try:
        return json.loads(content.decode())
    except UnicodeDecodeError as error:
        raise BodyMalformed(f"the body is not UTF-8 (byte {error.start})", "send JSON as UTF-8") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise BodyMalformed(f"the body is not JSON ({error.msg} at {place})", "send JSON, or no body") from None
    except (RecursionError, ValueError):
        raise BodyMalformed("the body is JSON that nests too deep or holds an absurd number", "send less") from None


async def check_query_names(request: Request) -> None:
    """Raises InvalidRequest for unknown query parameters, naming the nearest known one."""
    dependant = getattr(request.scope.get("route"), "dependant", None)
    if dependant is None:
        return
    known = list(_query_names(dependant))
    unknown = [name for name in request.query_params if name not in known]
    if unknown:
        fixes = {name: nearest_fix(name, known) or "remove it" for name in unknown[:MAX_PROBLEMS]}
        what = "unknown query parameter"
        problems = [DocumentProblem(f"query.{shortened(name)}", what, fix) for name, fix in fixes.items()]
        raise InvalidRequest(limit_problems(problems, len(unknown)))


def _query_names(dependant: Any) -> Iterator[str]:
    for field in dependant.query_params:
        yield field.alias
    for inner in dependant.dependencies:
        yield from _query_names(inner)


def api_router(prefix: str = "", *, tags: Sequence[str] = (), include_in_schema: bool = True) -> APIRouter:
    """A router whose routes refuse unknown query parameters, answer 422 and 500 with problems, and have their names."""
    return APIRouter(  # of each noun, not one around all, for which FastAPI would build every route a second time
        prefix=prefix,
        tags=[*tags],
        include_in_schema=include_in_schema,
        dependencies=[Depends(check_query_names)],
        responses=problem_responses(422, 500),
        generate_unique_id_function=operation_name,
    )


def creates(model: Any, *refusals: int) -> dict[str, Any]:
    """What a route declares that answers `model` of what it has made, with its Location, or one of the refusals."""
    return {"response_model": model, "status_code": 201, "responses": problem_responses(*refusals)}


def in_words(model: Any, about_text: str, *refusals: int) -> dict[str, Any]:
    """What a route declares that answers `model`, or text where Accept prefers that, or one of the refusals."""
    return {"response_model": model, "responses": {200: or_text(about_text), **problem_responses(*refusals)}}


def in_content(about: str, content: Mapping[str, Any], *refusals: int) -> dict[str, Any]:
    """What a route declares that answers content by its media type, and no document, or one of the refusals."""
    answers = {200: {"description": about, "content": content}, **problem_responses(*refusals)}
    return {"response_class": Response, "responses": answers}


NAMES: dict[str, str] = json.loads(pathlib.Path(__file__).with_name("operation_names.json").read_text("utf-8"))


def operation_name(route: APIRoute) -> str:
    """Of a route in the table; of another one its own, which a test refuses."""
    asked = [f"{method} {route.path_format}" for method in sorted(route.methods or ())]
    return next((NAMES[each] for each in asked if each in NAMES), route.name)
