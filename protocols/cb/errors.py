"""Errors of the CB link, raised for local misuse. Faults of the other side are reported as events instead.

CbError
├── FieldOutOfRange      a value does not fit its place in the payload
├── PayloadRefused       a payload that cannot be decoded as its message; carries the status to answer with
└── LocalMistake         the caller asked for something the session's state does not allow
    ├── RequestOutstanding   the previous request has no answer yet
    ├── NotAllowedNow        this command may not be sent in this state
    └── NothingToAnswer      there is no such request to repeat or to reply to
"""

from protocols.cb.codes import Status


class CbError(Exception):
    """Root of the CB link's errors."""


class FieldOutOfRange(CbError):
    """A value does not fit its field of the payload: `message` and `reason` say which and why."""

    def __init__(self, message: str, reason: str) -> None:
        self.message, self.reason = message, reason
        super().__init__(f"{message} cannot be packed: {reason}")


class PayloadRefused(CbError):
    """A payload cannot be decoded as the message. `status` is BAD_LEN or BAD_FIELD."""

    def __init__(self, message: str, reason: str, status: Status) -> None:
        self.message, self.reason, self.status = message, reason, status
        super().__init__(f"this is no {message}: {reason}")


class LocalMistake(CbError):
    """The caller asked for something the session's state does not allow."""


class RequestOutstanding(LocalMistake):
    """The previous request has no reply yet: repeat or abandon it first. Only STOP may overtake."""


class NotAllowedNow(LocalMistake):
    """This command may not be sent in this state: HELLO comes first, and nothing follows the end."""


class NothingToAnswer(LocalMistake):
    """There is no such request to repeat or to reply to."""
