"""The link's address is the one of the controller's networks at which set-up reached it, and no other."""

from typing import Any, cast

import pytest

from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.robots.abb.setup.survey import read_networks

LISTED = (("X6", "LAN1", "Private", "192.168.125.1"), ("X23", "WAN", "Public", "10.0.0.5"), ("X2", "", "", "0.0.0.0"))


class AController:
    """Names its networks as RobotWare 7.20 does."""

    def __init__(self, host: str) -> None:
        self.address = RwsAddress.parse(f"rws://{host}")

    async def read(self, path: str) -> list[dict[str, Any]]:
        assert path == "/ctrl/network"
        return [dict(zip(("_title", "logical-name", "network", "addr"), row, strict=True)) for row in LISTED]


@pytest.mark.parametrize(
    ("host", "reached"),
    [
        ("192.168.125.1", "192.168.125.1 (X6, Private)"),
        ("10.0.0.5", "10.0.0.5 (X23, Public)"),
        ("203.0.113.9", "None"),  # behind a router: none of the controller's own
        ("0.0.0.0", "None"),
    ],
)
async def test_the_network_at_which_the_controller_was_reached(host: str, reached: str) -> None:
    networks, at = await read_networks(cast("RwsAdministration", AController(host)))
    assert [each.address for each in networks] == ["192.168.125.1", "10.0.0.5"]
    assert str(at) == reached
