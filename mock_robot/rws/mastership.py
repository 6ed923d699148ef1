"""Mastership of cfg, rapid and motion, and the operator's consent to remote masters in manual mode (RMMP)."""

from dataclasses import dataclass, field
from enum import Enum

from mock_robot.cabinet.panel import Mode
from mock_robot.rws.refusals import HELD_BY_ANOTHER, NO_MASTERSHIP, REJECTED, RwsRefused
from mock_robot.rws.sessions import Session

DOMAINS = ("cfg", "rapid", "motion")
POLL_LIMIT_S = 10.0
PENDANT = Session("the FlexPendant", "", "", 0.0)


class Consent(Enum):
    """State of a request for remote mastership in manual mode."""

    NONE = "NONE"
    PENDING = "PENDING"
    GRANTED = "GRANTED"
    DENIED = "DENIED"


@dataclass
class Mastership:
    """At most one holder per domain. `operator_says` answers requests for consent; None: no operator is present."""

    operator_says: bool | None = None
    _holders: dict[str, Session] = field(default_factory=dict, init=False)
    _asked_by: Session | None = field(default=None, init=False)
    _privilege: str = field(default="", init=False)
    _polled_s: float = field(default=0.0, init=False)

    def holder(self, domain: str) -> Session | None:
        return self._holders.get(domain)

    def request(self, session: Session, domains: tuple[str, ...], mode: Mode, now_s: float) -> None:
        """Take all domains or none. Raises RwsRefused."""
        self._require_consent(session, mode, now_s)
        if any(self._holders.get(domain, session) is not session for domain in domains):
            raise RwsRefused(HELD_BY_ANOTHER)
        self._holders.update(dict.fromkeys(domains, session))

    def release(self, session: Session, domains: tuple[str, ...]) -> None:
        """Release the domains. Raises RwsRefused for one that the session does not hold."""
        held = [domain for domain in domains if self._holders.get(domain) is session]
        if not held:
            raise RwsRefused(NO_MASTERSHIP if not any(map(self.holder, domains)) else HELD_BY_ANOTHER)
        for domain in held:
            del self._holders[domain]

    def require(self, session: Session, domain: str, mode: Mode, now_s: float, *, explicit: bool) -> None:
        """Check mastership for a write. RWS 1.0 takes a free domain implicitly for the request. Raises RwsRefused."""
        self._require_consent(session, mode, now_s)
        holder = self._holders.get(domain)
        if holder is session:
            return
        if holder is not None:
            raise RwsRefused(HELD_BY_ANOTHER)
        if explicit:
            raise RwsRefused(NO_MASTERSHIP)

    def take_locally(self) -> None:
        """Take everything at the pendant."""
        self._holders = dict.fromkeys(DOMAINS, PENDANT)

    def release_all(self, session: Session) -> None:
        """Release what a session held that is closed, or the pendant."""
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder is not session}
        self.cancel_consent(session)

    # --- consent ---

    def ask_consent(self, session: Session, privilege: str, mode: Mode, now_s: float) -> None:
        """Ask for consent on the pendant. Raises RwsRefused in automatic mode."""
        if mode is Mode.AUTO:
            raise RwsRefused(REJECTED, "Remote mastership is requested in manual mode only")
        if self._asked_by not in (None, session):
            raise RwsRefused(HELD_BY_ANOTHER)
        self._asked_by, self._privilege, self._polled_s = session, privilege, now_s

    def poll_consent(self, session: Session, now_s: float) -> Consent:
        """State of the request for consent, which must be polled every ten seconds."""
        consent = self._consent(session, now_s)
        if consent in (Consent.PENDING, Consent.GRANTED):
            self._polled_s = now_s
        return consent

    def cancel_consent(self, session: Session) -> None:
        if self._asked_by is session:
            self._asked_by = None

    def may_execute(self, session: Session, mode: Mode, now_s: float) -> bool:
        """Whether the session may start the program: always in automatic, in manual mode with consent to execute."""
        return mode is Mode.AUTO or (self._privilege == "exec" and self._consent(session, now_s) is Consent.GRANTED)

    def _consent(self, session: Session, now_s: float) -> Consent:
        if self._asked_by is not session or now_s - self._polled_s > POLL_LIMIT_S:
            return Consent.NONE
        return {None: Consent.PENDING, True: Consent.GRANTED, False: Consent.DENIED}[self.operator_says]

    def _require_consent(self, session: Session, mode: Mode, now_s: float) -> None:
        if mode is not Mode.AUTO and self._consent(session, now_s) is not Consent.GRANTED:
            self._holders = {domain: holder for domain, holder in self._holders.items() if holder is PENDANT}
            raise RwsRefused(REJECTED, "In manual mode the operator has to grant remote mastership (RMMP)")
