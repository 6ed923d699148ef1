"""Context of a request: the controller, the session, and the version of the services (RWS 1.0 or 2.0)."""

from dataclasses import dataclass

from mock_robot.cabinet.cabinet import CabinetSymbol
from mock_robot.rws.exchange import RwsRequest
from mock_robot.rws.refusals import NO_SYMBOL, RwsRefused
from mock_robot.rws.sessions import Session
from mock_robot.rws.world import World


@dataclass(frozen=True)
class RequestContext:
    world: World
    version: int
    session: Session
    asked: RwsRequest
    now_s: float

    def require_symbol(self, path: str) -> tuple[str, CabinetSymbol]:
        """The full name of a RAPID persistent, and what it holds. Raises RwsRefused."""
        found = self.world.memory.symbol(path, self.world.cabinet)
        if found is None:
            raise RwsRefused(NO_SYMBOL[self.version])
        return found

    def require_master(self, domain: str) -> None:
        """Check that this session may write in the domain. Raises RwsRefused."""
        implicit = self.asked.query.get("mastership") == "implicit" or self.version == 1
        self.world.mastership.require(self.session, domain, self.world.mode, self.now_s, explicit=not implicit)
