"""Errors of the CB link, raised for local misuse. Faults of the other side are reported as events instead.

Those without fields of their own: the caller asked for something the session's state does not allow.
"""

from protocols.cb.codes import Status


class FieldOutOfRange(Exception):
    """A value does not fit its field of the payload: `message` and `reason` say which and why."""

    def __init__(self, message: str, reason: str) -> None:
        self.message, self.reason = message, reason
        super().__init__(f"{message} cannot be packed: {reason}")


class PayloadRefused(Exception):
    """A payload cannot be decoded as the message. `status`, to answer with, is BAD_LEN or BAD_FIELD."""

    def __init__(self, message: str, reason: str, status: Status) -> None:
        self.message, self.reason, self.status = message, reason, status
        super().__init__(f"this is no {message}: {reason}")


class RequestOutstanding(Exception):
    """The previous request has no reply yet: repeat or abandon it first. Only STOP may overtake."""


class NotAllowedNow(Exception):
    """This command may not be sent in this state: HELLO comes first, and nothing follows the end."""


class NothingToAnswer(Exception):
    """There is no such request to repeat or to reply to."""
