"""The state of one end's session with the other, alike at both ends."""

from enum import Enum

from protocols.cb.codes import Command


class SessionState(Enum):
    """Whether HELLO was answered; BROKEN for good once the stream cannot be split into frames."""

    NOT_GREETED = "not greeted"
    GREETED = "greeted"
    BROKEN = "broken"


ALLOWED_COMMANDS: dict[SessionState, frozenset[Command]] = {
    SessionState.NOT_GREETED: frozenset({Command.PING, Command.HELLO}),
    SessionState.GREETED: frozenset(Command),
    SessionState.BROKEN: frozenset(),
}
"""Commands that a client may send, and a controller hands up, in each state."""

STATE_AFTER = {Command.HELLO: SessionState.GREETED, Command.BYE: SessionState.NOT_GREETED}
"""By the command that was answered; after any other the state is the same. Refusals leave it, too."""
