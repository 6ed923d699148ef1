"""What is wrong with a request as HTTP, before any of the daemon's work begins.

DaemonError
├── KeyReused             an Idempotency-Key that came with another request before
├── RequestInFlight       the request with this Idempotency-Key is still being answered; `holder`
├── HostNotAllowed        the request names a host that the daemon does not answer for
├── RequestRefused        the request cannot be understood; `problems`
├── BodyTooLarge          more bytes than the limit
├── BodyMalformed         the body is not JSON
├── UnknownMediaType      the body is of a kind that is not taken here
├── NotAcceptable         the answer exists in none of the kinds that were asked for
├── CloudTooLarge         a cloud of so many points does not travel as JSON
└── CrossOrigin           a page of somebody else's asks the browser to move the robot
"""

from calibration.errors import DocumentProblem
from daemon.errors import DaemonError


class KeyReused(DaemonError):
    """An Idempotency-Key that came with another request before."""

    code = "idempotency-key-reused"

    def __init__(self) -> None:
        super().__init__(
            "this Idempotency-Key came with another request before",
            "use a new key for each request, the same for its retries",
        )


class RequestInFlight(DaemonError):
    """The request with this Idempotency-Key is still being answered; `holder` is the run it started."""

    code = "request-in-flight"

    def __init__(self, holder: str | None) -> None:
        self.holder = holder
        follow = f"follow it with GET /runs/{holder}, or " if holder else ""
        super().__init__(
            "the first request with this Idempotency-Key is still being answered", f"{follow}ask again later"
        )


class HostNotAllowed(DaemonError):
    """The request names a host that the daemon does not answer for."""

    code = "host-not-allowed"

    def __init__(self, host: str) -> None:
        super().__init__(
            f"the daemon does not answer for host {host[:80]!r}",
            "use its address, or add the name to [server] allowed_hosts in the settings",
        )


class InvalidRequest(DaemonError):
    """The request cannot be understood; `problems` lists every place."""

    code = "request-refused"

    def __init__(self, problems: list[DocumentProblem]) -> None:
        self.problems = problems
        super().__init__("; ".join(f"{p.place}: {p.what}" for p in problems), "; ".join(p.fix for p in problems))


class BodyTooLarge(DaemonError):
    """More bytes than the limit."""

    code = "body-too-large"

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        super().__init__(
            f"the body is larger than {limit_bytes} bytes",
            "send less, or raise [server] body_limit_mb in the settings for clouds",
        )


class BodyMalformed(DaemonError):
    """The body is not JSON."""

    code = "body-malformed"


class UnknownMediaType(DaemonError):
    """The body is of a kind that is not taken here."""

    code = "unknown-media-type"


class NotAcceptable(DaemonError):
    """The answer exists in none of the kinds that were asked for."""

    code = "not-acceptable"


class CloudTooLarge(DaemonError):
    """A cloud of so many points does not travel as JSON."""

    code = "cloud-too-large-for-json"


class CrossOrigin(DaemonError):
    """A page of somebody else's asks the browser to do something here."""

    code = "cross-origin"
