"""What `handeyed.Client` raises: what is wrong, where, and what to do."""

from typing import Any


class ClientError(Exception):
    """The daemon could not be asked, or did not do what it was asked: `where` (an address), `what`, `fix`."""

    def __init__(self, where: str, what: str, fix: str) -> None:
        self.where, self.what, self.fix = where, what, fix
        super().__init__(f"{where}: {what}: {fix}")


class NotAnAddress(ClientError):
    """The address of the daemon, or the certificate of its authority, cannot be used."""


class NoDaemon(ClientError):
    """Nothing listens at the address."""


class ConnectionBroke(ClientError):
    """No answer came in time, or the connection ended before it: the daemon may have done what it was asked."""


class Refused(ClientError):
    """The daemon's answer is an error. `status` of HTTP; `code`, stable and for programs, "" when it is no daemon's.

    `retry_after_s`: when to ask again, where that passes by itself; `problem`: the whole answer.
    """

    def __init__(
        self, where: str, what: str, fix: str, *, status: int, problem: dict[str, Any], retry_after_s: float | None
    ) -> None:
        super().__init__(where, what, fix)
        self.status, self.problem, self.retry_after_s = status, problem, retry_after_s
        self.code = str(problem.get("code", ""))


class RunFailed(ClientError):
    """A run ended without a result. `code` says why, "" when somebody ended it."""

    def __init__(self, where: str, what: str, fix: str, *, code: str) -> None:
        super().__init__(where, what, fix)
        self.code = code
