"""Map errors to problem details (RFC 9457): the status from one table, code and fix from the error."""

from dataclasses import replace
from typing import Any, Literal

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from calibration.documents.calibration import SentenceDocument
from calibration.documents.validation import problem_of_detail
from calibration.errors import (
    CalibrationError,
    ComparisonError,
    DetectionError,
    DocumentError,
    ExportRefused,
    UndeterminedError,
)
from calibration.sentences.sentence import Sentence
from daemon import errors
from daemon.access import errors as access
from daemon.api import http_errors
from daemon.api.negotiation import TEXT, wants_text
from daemon.http.problem_details import MEDIA_TYPE, Problem, reason_phrase
from daemon.reports.pdf import ReportExtraMissing, ReportTooSlow
from drivers import errors as device
from registration.errors import CloudIOError, CloudUnsupported, RegistrationError

STATUS: dict[type[Exception], int] = {kind: status for status, kinds in {
    400: (http_errors.BodyMalformed, http_errors.RequestMalformed),
    401: (access.KeyMissing,),
    403: (access.RoleTooLow, access.SetupRefused, access.PairingRefused, http_errors.CrossOrigin),
    404: (errors.NotFound,),
    406: (http_errors.NotAcceptable, ReportExtraMissing),
    409: (errors.RunInProgress, errors.CellBusy, errors.SetupConflict, errors.RunOver, errors.NotWaiting,
          errors.NotHeld, errors.SamePose, errors.TooFewViews, errors.NoCalibration, errors.CalibrationUnusable,
          errors.NoScanner, errors.ScanEmpty, errors.NoPoses, errors.ArmUnknown, errors.NotStill, errors.NotInstalled,
          http_errors.RequestInFlight, access.KeyExists, device.SweepNeeded, device.MoveRefused, ComparisonError,
          ExportRefused),
    412: (errors.AppliedMeanwhile,),
    413: (http_errors.BodyTooLarge, http_errors.CloudTooLarge),
    415: (http_errors.UnknownMediaType, CloudUnsupported),
    421: (http_errors.HostNotAllowed,),
    422: (errors.AnswerRefused, errors.PrintRefused, http_errors.KeyReused, errors.CursorUnknown, errors.PoseRefused,
          errors.ToleranceLoosened, http_errors.InvalidRequest, errors.TargetNotSeen, DocumentError, DetectionError,
          UndeterminedError, CalibrationError, RegistrationError),
    429: (errors.WorkersBusy, access.TooManyAttempts, ReportTooSlow),
    500: (errors.StorageError, errors.DaemonError, CloudIOError),
    502: (errors.StopUnconfirmed, errors.PictureUnusable, errors.PoseMismatch, errors.StaleCaptureError,
          device.GarbledAnswer, device.NothingMeasured, device.MoveFailed, device.DeviceError),
    503: (errors.CellNotReady, errors.Stopping, http_errors.TooManyListeners, errors.StorageInconsistent,
          device.DeviceUnreachable, device.DeviceTaken, device.WrongDevice, device.LinkLost),
    504: (device.DeviceTimeout,),
    507: (errors.StorageFull,),
}.items() for kind in kinds}  # fmt: skip
"""The statuses of error classes; the nearest base class decides."""

RETRY_AFTER_S = {429: "5", 503: "2", 504: "2"}
"""Retry-After by status."""

PASSING = frozenset(
    {errors.RunInProgress.code, errors.CellBusy.code, errors.NotStill.code, http_errors.RequestInFlight.code}
)
"""Codes of a 409 that passes by itself, with BUSY_S as Retry-After: no other one is mended by waiting."""

BUSY_S = "2"

HTTP_CODES = {404: ("no-such-page", "GET / lists what there is"), 405: ("method-not-allowed", "use one of: {allow}")}


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The `responses` of a route for statuses with a Problem."""
    retry_after = {"headers": {"Retry-After": {"schema": {"type": "integer"}, "description": "s, when it passes"}}}
    return {
        status: {
            "description": reason_phrase(status),
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
            **(retry_after if status in (409, *RETRY_AFTER_S) else {}),
        }
        for status in statuses
    }


def status_of_kind(error: type[Exception]) -> int:
    """The status of a class of errors: its own `status`, as an extension's errors have; else that of the table, 500
    when neither it nor a base class is there."""
    stated: int | None = getattr(error, "status", None)
    return stated or next((STATUS[kind] for kind in error.__mro__ if kind in STATUS), 500)


def problem_of(error: Exception) -> Problem:
    status = status_of_kind(type(error))
    code, what, fix = _words(error)
    problem = Problem.of(status, code, what, fix)
    problem.holder = getattr(error, "holder", None)
    if (reasons := getattr(error, "reasons", None)) is not None:
        problem.reasons = list(reasons)
    if (problems := getattr(error, "problems", None)) is not None:
        problem.problems = list(problems)
    if isinstance(what, Sentence):
        made, advice = SentenceDocument.each_of((what, fix))
        problem.details = {"what": made, "fix": advice}
    if isinstance(error, errors.StopUnconfirmed):
        problem.stopped, problem.disarmed = _confirmed(error.stopped), _confirmed(error.disarmed)
    return problem


def _confirmed(known: bool) -> Literal["confirmed", "unconfirmed"]:
    return "confirmed" if known else "unconfirmed"


def _words(error: Exception) -> tuple[str, str, str]:
    """Code, what and fix of an error."""
    match error:
        case DocumentError():
            what = "; ".join(f"{error.origin}: {p.place}: {p.what}" for p in error.problems)
            return "document-refused", what, "; ".join(dict.fromkeys(p.fix for p in error.problems))
        case device.DeviceError():
            return error.code, f"{error.device}: {error.what}", error.fix
        case (errors.DaemonError() | DetectionError() | UndeterminedError() | ComparisonError() | ExportRefused()
              | RegistrationError()):  # fmt: skip
            return error.code, error.what, error.fix
        case CalibrationError():
            return "calibration-error", str(error), "look at the poses and pictures"
        case _:
            return (
                "internal-error",
                "a defect of handeyed; the daemon stays up",
                "report it with the log of this moment",
            )


class ProblemResponse(Response):
    """A problem as JSON, or as text where Accept prefers that."""

    def __init__(self, problem: Problem, headers: dict[str, str]) -> None:
        super().__init__(problem.model_dump_json(exclude_none=True), problem.status, headers, media_type=MEDIA_TYPE)
        self._problem, self._given = problem, headers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not wants_text(Request(scope)):
            await super().__call__(scope, receive, send)
            return
        words = Response(problem_text(self._problem), self._problem.status, self._given, media_type=TEXT)
        await words(scope, receive, send)


def problem_text(problem: Problem) -> str:
    """The problem in words: code and what, each place, and what to do; ends with a newline."""
    places = [f"  {each.place}: {each.what}: {each.fix}" for each in problem.problems or ()]
    return "\n".join([f"{problem.status} {problem.code}: {problem.detail}", *places, f"do:   {problem.fix}", ""])


def answer(problem: Problem, headers: dict[str, str] | None = None) -> Response:
    every = {**(headers or {}), "Vary": "Accept"}
    if problem.status == 401:
        every["WWW-Authenticate"] = 'Bearer realm="handeyed"'
    retry_after_s = BUSY_S if problem.code in PASSING else RETRY_AFTER_S.get(problem.status)
    if retry_after_s is not None:
        every["Retry-After"] = retry_after_s
    return ProblemResponse(problem, every)


async def handle(_request: Request, error: Exception) -> Response:
    """Exception handler for the errors of the table."""
    passes = isinstance(error, device.MoveRefused) and error.status == "BUSY"  # another move is under way
    return answer(problem_of(error), {"Retry-After": BUSY_S} if passes else None)


async def handle_validation(_request: Request, error: Exception) -> Response:
    """Exception handler for query and path parameters that FastAPI refuses."""
    assert isinstance(error, RequestValidationError)
    problems = [
        replace(problem_of_detail(detail), place=".".join(str(part) for part in detail["loc"]))
        for detail in error.errors()
    ]
    return answer(problem_of(http_errors.InvalidRequest(problems)))


async def handle_http(_request: Request, error: Exception) -> Response:
    """Exception handler for what the router refuses."""
    assert isinstance(error, HTTPException)
    code, fix = HTTP_CODES.get(error.status_code, ("http-error", "see openapi.json"))
    headers = dict(error.headers or {})
    detail = str(error.detail or reason_phrase(error.status_code))
    problem = Problem.of(error.status_code, code, detail, fix.format(allow=headers.get("Allow", "")))
    return answer(problem, headers)
