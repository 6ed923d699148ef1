"""`handeyed check` of [plc] and [interlocks]: what is read, what can be had, and what to do about the rest."""

import asyncio
import json
import socket
from pathlib import Path
from typing import Any

import pytest

from daemon.cli.checks import check_interlocks, check_line, check_plc, check_port
from daemon.config.plc_settings import InterlockSettings, PlcSerialSettings, PlcSettings
from daemon.model.check_result import CheckResult
from tests.daemon.cli.running import handeyed
from tests.daemon.daemon_process import SETTINGS
from tests.drivers.modbus_terminal import terminal
from tests.support.serial_pair import cable


def interlocks(port: int, **changes: Any) -> InterlockSettings:
    signals = [
        {"name": "gate closed", "address": 0},
        {"name": "part present", "kind": "coil", "address": 3},
        {"name": "door not open", "address": 1, "allows": False},
        {"name": "a ninth", "address": 8},
    ]
    return InterlockSettings.model_validate(
        {"address": f"tcp://127.0.0.1:{port}", "limit_s": 5, "signals": signals, **changes}
    )


async def test_each_interlock_is_read_and_reported() -> None:
    async with terminal() as device:
        device.inputs[0] = False
        found = await check_interlocks(interlocks(device.port))
    assert [(result.ok, result.what) for result in found[:3]] == [
        (False, "gate closed is 0"),
        (True, "part present: allows motion"),
        (True, "door not open: allows motion"),
    ]
    assert found[0].fix == "put this right at the cell"
    assert not found[3].ok
    assert "discrete-input 8 is refused with exception 2" in found[3].what
    assert "[interlocks]" in found[3].fix


async def test_a_terminal_that_is_not_there_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    found = await check_interlocks(interlocks(port))
    assert not any(result.ok for result in found)
    assert all(f"tcp://127.0.0.1:{port}" in result.what for result in found)


PLC = [
    ({}, True, "nobody may write, triggers may not move the arm"),
    ({"writers": ["127.0.0.1"], "motion": True}, True, "127.0.0.1 may write, triggers may move the arm"),
    ({"motion": True}, False, "motion is allowed to nobody: name the PLC in [plc] writers"),
    ({"writers": ["192.168.125.10"]}, False, "which 192.168.125.10 cannot reach: set [plc] host"),
    ({"host": "0.0.0.0", "writers": ["192.168.125.0/24"]}, True, "192.168.125.0/24 may write"),
]


@pytest.mark.parametrize(("changes", "ok", "words"), PLC)
def test_the_plcs_port_and_what_it_may(changes: dict[str, Any], ok: bool, words: str) -> None:
    found = check_port(PlcSettings.model_validate({"port": 0, **changes}))
    assert found.ok is ok
    assert words in found.line()


def test_a_port_that_is_taken_is_reported() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        found = check_port(PlcSettings(port=other.getsockname()[1]))
    assert not found.ok
    assert "cannot listen for PLCs" in found.what


def test_a_port_without_the_right_to_it_is_reported_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "bind", refused, raising=False)
    found = check_port(PlcSettings(port=502))
    assert not found.ok
    assert "docs/plc.md" in found.fix


async def test_the_plcs_line_is_opened_and_left_alone() -> None:
    async with cable() as (ours, _):
        line = PlcSerialSettings(port=ours, parity="N")
        assert await check_plc(PlcSettings(port=0, serial=line)) == [
            CheckResult(
                "plc",
                True,
                "Modbus TCP can listen on 127.0.0.1 port 0; nobody may write, triggers may not move the arm",
            ),
            CheckResult("plc", True, f"the line {ours} opens, 19200 baud, as unit 1"),
        ]
        refused = await asyncio.to_thread(check_line, PlcSerialSettings(port=ours, parity="E"))
        assert "Invalid argument" in refused.what  # a pseudo terminal knows no parity
    gone = check_line(PlcSerialSettings(port="/dev/does-not-exist"))
    assert not gone.ok
    assert "dialout" in gone.fix


@pytest.mark.slow
def test_the_command_asks_them_too(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        more = (
            f"[plc]\nport = {taken.getsockname()[1]}\n"
            '[interlocks]\naddress = "tcp://127.0.0.1:9"\nsignals = [{ name = "gate closed", address = 0 }]\n'
        )
        (tmp_path / "handeyed.toml").write_text(SETTINGS + more)
        ran = handeyed("check", tmp_path / "handeyed.toml", "--json")
    assert ran.status == 1
    found = {result["name"]: result for result in json.loads(ran.out)}
    assert not found["plc"]["ok"] and not found["interlock"]["ok"]
    assert "gate closed cannot be read" in found["interlock"]["what"]
