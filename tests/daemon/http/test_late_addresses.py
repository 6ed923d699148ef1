"""An address that the PC gets later is no reason to die: the daemon listens there, and warns until it is here."""

import asyncio
from pathlib import Path

import pytest

from daemon.http.listen_socket import late_addresses, open_listener
from daemon.runtime.systemd import Systemd
from drivers.transports.late_address import is_here
from tests.daemon.cell_under_test import serving, settings_for

NOT_HERE = "192.0.2.77"
"""Of the documentation's network: nobody has it."""


@pytest.mark.parametrize("host", [NOT_HERE, "2001:db8::77"])
def test_a_listener_opens_at_an_address_that_is_not_here(host: str) -> None:
    with open_listener(host, 0) as listener:
        assert listener.getsockname()[0] == host


@pytest.mark.parametrize(
    ("host", "here"),
    [("127.0.0.1", True), ("127.9.9.9", True), ("0.0.0.0", True), ("::", True), (NOT_HERE, False), ("a-name", True)],
)
def test_an_address_is_here_or_not(host: str, here: bool) -> None:
    assert is_here(host) is here


def test_each_address_that_is_not_here_is_named_with_its_section() -> None:
    warnings = late_addresses({"server": "127.0.0.1", "plc": NOT_HERE})
    assert len(warnings) == 1
    assert warnings[0].startswith(f"this PC does not have the address {NOT_HERE} of [plc] host yet")


async def test_the_daemon_is_ready_with_a_warning_while_the_plc_s_address_is_not_here(tmp_path: Path) -> None:
    settings = settings_for(tmp_path, plc={"host": NOT_HERE, "port": 0}, drift={"every_h": 24.0})
    async with asyncio.timeout(60), serving(settings, systemd=Systemd(None, None)) as bench:
        ready = (await bench.client.get("/ready")).json()
        assert ready["ready"]
        assert [NOT_HERE in warning for warning in ready["warnings"]] == [True, False], "systemctl shows the first"
        bench.application.settings = settings_for(tmp_path)  # as a reload does
        assert not any(NOT_HERE in warning for warning in bench.application.warnings())
