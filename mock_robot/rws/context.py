"""Context of a request: the controller, the session, and the dialect (RWS 1.0 or 2.0)."""

from dataclasses import dataclass

from mock_robot.rws.exchange import RwsRequest
from mock_robot.rws.refusals import Refusal
from mock_robot.rws.sessions import Session
from mock_robot.rws.world import World


@dataclass(frozen=True)
class ServiceDialect:
    """Differences of wording between 1.0 and 2.0."""

    version: int
    explicit_mastership: bool
    unused_axis: str
    configuration_names: tuple[str, str, str, str]
    no_symbol: Refusal
    no_module: Refusal
    no_file: Refusal
    no_volume: Refusal


@dataclass(frozen=True)
class RequestContext:
    """One request in progress."""

    world: World
    dialect: ServiceDialect
    session: Session
    asked: RwsRequest
    now_s: float

    def require_master(self, domain: str) -> None:
        """Check that this session may write in the domain. Raises RwsRefused."""
        implicit = self.asked.query.get("mastership") == "implicit" or not self.dialect.explicit_mastership
        self.world.mastership.require(self.session, domain, self.world.mode, self.now_s, explicit=not implicit)
