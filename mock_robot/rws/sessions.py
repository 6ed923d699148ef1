"""Sessions of one service: at most 70, idle ones die after five minutes, at most 20 requests a second each."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field

SESSIONS_MAX = 70
IDLE_S = 300.0
REQUESTS_PER_S = 20.0
BURST = 20.0
PATIENCE_S = 1.0
"""A request too early is slowed down by up to this much; beyond it the answer is 503."""
HTTP_COOKIE, ABB_COOKIE = "-http-session-", "ABBCX"


class SessionsExhausted(Exception):
    """There is no session left, or this one asks too often: 503."""


@dataclass(eq=False)
class Session:
    """One client, known by either cookie."""

    user: str
    http_cookie: str
    abb_cookie: str
    seen_s: float
    tokens: float = BURST

    @property
    def cookies(self) -> list[tuple[str, str]]:
        """The headers that hand out both cookies."""
        pairs = ((HTTP_COOKIE, self.http_cookie), (ABB_COOKIE, self.abb_cookie))
        return [("set-cookie", f"{name}={value}; path=/; httponly") for name, value in pairs]


@dataclass
class Sessions:
    """The open ones. `ended` is told of each that ends."""

    ended: Callable[[Session], None]
    _open: list[Session] = field(default_factory=list, init=False)
    _number: int = field(default=0, init=False)

    @property
    def count(self) -> int:
        """How many are open."""
        return len(self._open)

    def find(self, cookie_header: str, now_s: float) -> Session | None:
        """The session whose cookie this is."""
        self._let_idle_ones_die(now_s)
        pieces = (piece.strip().partition("=") for piece in cookie_header.split(";"))
        cookies = {name: value for name, _, value in pieces}
        for session in self._open:
            if session.http_cookie == cookies.get(HTTP_COOKIE) or session.abb_cookie == cookies.get(ABB_COOKIE):
                return session
        return None

    def open(self, user: str, now_s: float) -> Session:
        """A new one. Raises SessionsExhausted."""
        self._let_idle_ones_die(now_s)
        if len(self._open) >= SESSIONS_MAX:
            raise SessionsExhausted
        self._number += 1
        session = Session(user, f"{self._number}::http.session::{secrets.token_hex(16)}", secrets.token_hex(4), now_s)
        self._open.append(session)
        return session

    def fill_up(self, now_s: float) -> None:
        """Other clients take every session that is left."""
        while len(self._open) < SESSIONS_MAX:
            self.open("somebody else", now_s)

    def empty_of(self, user: str) -> None:
        """All sessions of a user end."""
        for session in [each for each in self._open if each.user == user]:
            self.end(session)

    def wait_s(self, session: Session, now_s: float) -> float:
        """How long this request has to wait. Raises SessionsExhausted when that is too long."""
        refill = max(now_s - session.seen_s, 0.0) * REQUESTS_PER_S
        session.tokens = min(BURST, session.tokens + refill) - 1.0
        session.seen_s = now_s
        wait_s = max(-session.tokens, 0.0) / REQUESTS_PER_S
        if wait_s > PATIENCE_S:
            session.tokens += 1.0
            raise SessionsExhausted
        return wait_s

    def end(self, session: Session) -> None:
        """Log out."""
        if session in self._open:
            self._open.remove(session)
            self.ended(session)

    def end_all(self) -> None:
        """A restart."""
        for session in list(self._open):
            self.end(session)

    def _let_idle_ones_die(self, now_s: float) -> None:
        for session in [each for each in self._open if now_s - each.seen_s > IDLE_S]:
            self.end(session)
