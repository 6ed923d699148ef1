"""A gateway that is patient with its daemons."""

import pytest

from gateways.opcua import cell
from tests.support.waiting import LIMIT_S


@pytest.fixture(autouse=True)
def a_busy_daemon_is_not_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test here is about how long a daemon may be silent: one that goes closes its connections."""
    for limit in ("CONNECT_S", "ANSWER_S", "SILENCE_S"):
        monkeypatch.setattr(cell, limit, LIMIT_S)
