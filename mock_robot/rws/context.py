"""What a handler is given: who asks, what, of which world, and which of the two dialects is spoken."""

from dataclasses import dataclass

from mock_robot.rws.exchange import Asked
from mock_robot.rws.refusals import Refusal
from mock_robot.rws.sessions import Session
from mock_robot.rws.world import World


@dataclass(frozen=True)
class Dialect:
    """Where 1.0 and 2.0 differ in what they say."""

    version: int
    explicit_mastership: bool
    unused_axis: str
    configuration_names: tuple[str, str, str, str]
    no_symbol: Refusal
    no_module: Refusal
    no_file: Refusal
    no_volume: Refusal


@dataclass(frozen=True)
class Context:
    """One request being answered."""

    world: World
    dialect: Dialect
    session: Session
    asked: Asked
    now_s: float

    def require_master(self, domain: str) -> None:
        """May this session write there? Raises RwsRefused."""
        implicit = self.asked.query.get("mastership") == "implicit" or not self.dialect.explicit_mastership
        self.world.mastership.require(self.session, domain, self.world.mode, self.now_s, explicit=not implicit)
