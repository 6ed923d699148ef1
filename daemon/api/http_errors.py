"""Errors of HTTP requests, raised before any of the daemon's work begins."""

from calibration.errors import DocumentProblem
from daemon.errors import DaemonError


class KeyReused(DaemonError, code="idempotency-key-reused"):
    """The Idempotency-Key was used with another request."""

    def __init__(self) -> None:
        super().__init__(
            "this Idempotency-Key came with another request before",
            "use a new key for each request, the same for its retries",
        )


class RequestInFlight(DaemonError, code="request-in-flight"):
    """The request with this Idempotency-Key is in progress; `holder` is the run it started."""

    def __init__(self, holder: str | None) -> None:
        self.holder = holder
        follow = f"follow it with GET /runs/{holder}, or " if holder else ""
        super().__init__(
            "the first request with this Idempotency-Key is still being answered", f"{follow}ask again later"
        )


class HostNotAllowed(DaemonError, code="host-not-allowed"):
    """The Host header names another host."""

    def __init__(self, host: str) -> None:
        super().__init__(
            f"the daemon does not answer for host {host[:80]!r}",
            "use its address, or add the name to [server] allowed_hosts in the settings",
        )


class InvalidRequest(DaemonError, code="request-refused"):
    """The request is invalid; `problems` lists every place."""

    def __init__(self, problems: list[DocumentProblem]) -> None:
        self.problems = problems
        super().__init__("; ".join(f"{p.place}: {p.what}" for p in problems), "; ".join(p.fix for p in problems))


class RequestMalformed(DaemonError, code="request-malformed"):
    """A header that may stand there once is repeated."""

    def __init__(self, header: str) -> None:
        super().__init__(f"the header {header} is there more than once", "send it once")


class BodyTooLarge(DaemonError, code="body-too-large"):
    """The body has more bytes than the limit."""

    def __init__(self, limit_bytes: int) -> None:
        super().__init__(
            f"the body is larger than {limit_bytes} bytes",
            "send less, or raise [server] body_limit_mb in the settings for clouds",
        )


class BodyMalformed(DaemonError, code="body-malformed"):
    """The body is not JSON."""


class UnknownMediaType(DaemonError, code="unknown-media-type"):
    """The body's media type is not supported."""


class NotAcceptable(DaemonError, code="not-acceptable"):
    """None of the accepted media types is available."""


class CloudTooLarge(DaemonError, code="cloud-too-large-for-json"):
    """The cloud has too many points for JSON."""


class TooManyListeners(DaemonError, code="too-many-listeners"):
    """As many clients listen to a stream as may."""

    def __init__(self, listeners: int) -> None:
        super().__init__(f"{listeners} clients listen already", "close some, or share one stream among the tabs")


class CrossOrigin(DaemonError, code="cross-origin"):
    """The request comes from a page of another origin."""
