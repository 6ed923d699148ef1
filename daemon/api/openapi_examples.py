"""One example problem for each status, for openapi.json."""

from typing import Any

from calibration.errors import DocumentProblem
from daemon import errors
from daemon.access import errors as access
from daemon.api import http_errors
from daemon.api.problems import problem_of
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


def example_of(status: int) -> dict[str, Any]:
    """The example as problem+json."""
    return problem_of(EXAMPLES[status]).model_dump(exclude_none=True)
