"""Errors of the CB link. What comes from the other side is an event; what our own side does wrong is one of these.

CbError
├── FieldOutOfRange      a value does not fit its place in the payload
├── PayloadRefused       a payload that is not this message; carries the status a controller answers with
└── LocalMistake         our own side asked for something the session's state does not allow
    ├── RequestOutstanding   the previous request has no answer yet
    ├── NotAllowedNow        this command may not be sent in this state
    └── NothingToAnswer      there is no such request to repeat or to reply to
"""

from protocols.cb.codes import Status


class CbError(Exception):
    """Root."""


class FieldOutOfRange(CbError):
    """A value does not fit its place in the payload: `message` and `reason` say which and why."""

    def __init__(self, message: str, reason: str) -> None:
        self.message, self.reason = message, reason
        super().__init__(f"{message} cannot be packed: {reason}")


class PayloadRefused(CbError):
    """A payload that is not this message. `status` is BAD_LEN or BAD_FIELD."""

    def __init__(self, message: str, reason: str, status: Status) -> None:
        self.message, self.reason, self.status = message, reason, status
        super().__init__(f"this is no {message}: {reason}")


class LocalMistake(CbError):
    """Our own side asked for something the session's state does not allow."""


class RequestOutstanding(LocalMistake):
    """The previous request has no answer yet: repeat it or abandon it first. Only STOP may overtake."""


class NotAllowedNow(LocalMistake):
    """This command may not be sent in this state: say HELLO first, and nothing after the end."""


class NothingToAnswer(LocalMistake):
    """There is no such request to repeat or to reply to."""
