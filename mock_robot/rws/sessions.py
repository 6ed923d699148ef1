"""Sessions of one service: at most 70, closed after five idle minutes, at most 20 requests per second each."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field

MAX_SESSIONS = 70
IDLE_S = 300.0
REQUESTS_PER_S = 20.0
BURST = 20.0
MAX_DELAY_S = 1.0
"""An early request is delayed by up to this much; beyond it the reply is 503."""
HTTP_COOKIE, ABB_COOKIE = "-http-session-", "ABBCX"


class SessionsExhausted(Exception):
    """No session is left, or this one sends too many requests: 503."""


@dataclass(eq=False)
class Session:
    """One client, identified by either cookie."""

    user: str
    http_cookie: str
    abb_cookie: str
    seen_s: float
    tokens: float = BURST

    @property
    def cookies(self) -> list[tuple[str, str]]:
        """Headers that set both cookies."""
        pairs = ((HTTP_COOKIE, self.http_cookie), (ABB_COOKIE, self.abb_cookie))
        return [("set-cookie", f"{name}={value}; path=/; httponly") for name, value in pairs]


@dataclass
class Sessions:
    """The open sessions. `ended` is called with each that ends."""

    on_end: Callable[[Session], None]
    _open: list[Session] = field(default_factory=list, init=False)
    _number: int = field(default=0, init=False)

    @property
    def count(self) -> int:
        return len(self._open)

    def find(self, cookie_header: str, now_s: float) -> Session | None:
        self._end_idle_sessions(now_s)
        pieces = (piece.strip().partition("=") for piece in cookie_header.split(";"))
        cookies = {name: value for name, _, value in pieces}
        for session in self._open:
            if session.http_cookie == cookies.get(HTTP_COOKIE) or session.abb_cookie == cookies.get(ABB_COOKIE):
                return session
        return None

    def open(self, user: str, now_s: float) -> Session:
        """Open a session. Raises SessionsExhausted."""
        self._end_idle_sessions(now_s)
        if len(self._open) >= MAX_SESSIONS:
            raise SessionsExhausted
        self._number += 1
        session = Session(user, f"{self._number}::http.session::{secrets.token_hex(16)}", secrets.token_hex(4), now_s)
        self._open.append(session)
        return session

    def fill_up(self, now_s: float) -> None:
        """Let other clients occupy every session that is left."""
        while len(self._open) < MAX_SESSIONS:
            self.open("somebody else", now_s)

    def wait_s(self, session: Session, now_s: float) -> float:
        """Delay of this request in seconds. Raises SessionsExhausted when it would be too long."""
        refill = max(now_s - session.seen_s, 0.0) * REQUESTS_PER_S
        session.tokens = min(BURST, session.tokens + refill) - 1.0
        session.seen_s = now_s
        wait_s = max(-session.tokens, 0.0) / REQUESTS_PER_S
        if wait_s > MAX_DELAY_S:
            session.tokens += 1.0
            raise SessionsExhausted
        return wait_s

    def end(self, session: Session) -> None:
        if session in self._open:
            self._open.remove(session)
            self.on_end(session)

    def end_all(self, user: str | None = None) -> None:
        """End all sessions, or those of a user."""
        for session in [each for each in self._open if user in (None, each.user)]:
            self.end(session)

    def _end_idle_sessions(self, now_s: float) -> None:
        for session in [each for each in self._open if now_s - each.seen_s > IDLE_S]:
            self.end(session)
