"""[plc]: the interface follows a reload; without the extension the daemon refuses the section."""

import asyncio
import json
import socket
from pathlib import Path
from typing import Any

import pytest

from daemon.errors import NotInstalled
from extensions.installed import INSTALLED
from extensions.plc.extension import PLC, PlcSwitch
from tests.daemon.cell_under_test import Bench
from tests.daemon.settings_file import reload, serving_file, write
from tests.extensions.plc.plcs import plc_of

WITHOUT = tuple(extension for extension in INSTALLED if extension is not PLC)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write(tmp_path / "handeyed.toml")
    return tmp_path / "handeyed.toml"


def plc(**values: Any) -> str:
    """[plc] at any port."""
    return "\n".join(["[plc]", "port = 0", *(f"{name} = {json.dumps(value)}" for name, value in values.items()), ""])


async def answers_modbus(bench: Bench) -> bool:
    port = plc_of(bench).tcp.port
    _, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.close()
    await writer.wait_closed()
    return True


async def test_the_plc_s_interface_is_switched_on_over_and_off(file: Path) -> None:
    async with serving_file(file) as bench:
        for connections in (1, 2):
            write(file, more=plc(connections=connections))
            assert await reload(bench) == []
            assert plc_of(bench).tcp.limits.connections == connections
            assert await answers_modbus(bench)
        write(file)
        assert await reload(bench) == []
        assert bench.application.service(PlcSwitch).service is None


async def test_a_port_that_is_taken_leaves_the_plc_s_interface_as_it_was(file: Path) -> None:
    write(file, more=plc(connections=1))
    async with serving_file(file) as bench:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            write(file, more=plc(connections=2).replace("port = 0", f"port = {taken.getsockname()[1]}"))
            assert await reload(bench) == ["settings were changed that need a restart: plc"]
        assert plc_of(bench).tcp.limits.connections == 1
        assert await answers_modbus(bench)


async def test_a_plc_that_holds_abort_keeps_its_interface(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(file, more=plc(connections=1))
    async with serving_file(file) as bench:
        bench.application.supervisor.hold_abort(["the PLC at 127.0.0.1"])
        write(file)
        assert "settings were changed that need a restart: plc" in await reload(bench)
        assert "[plc] is as before: a PLC holds abort" in caplog.text
        assert await answers_modbus(bench)


async def test_without_the_extension_the_daemon_does_not_start_with_the_section(file: Path) -> None:
    write(file, more=plc())
    with pytest.raises(NotInstalled, match=r"no extension for \[plc\]: take \[plc\] out of the settings"):
        async with serving_file(file, WITHOUT):
            pass


async def test_without_the_extension_a_reload_refuses_the_section(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with serving_file(file, WITHOUT) as bench:
        write(file, more=plc())
        assert await reload(bench) == ["settings were changed that need a restart: plc"]
        assert "[plc] is as before: this daemon has no extension for [plc]" in caplog.text
