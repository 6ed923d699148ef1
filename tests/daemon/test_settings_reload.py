"""A changed settings file is taken over while the daemon runs, as far as it can be; the rest is named."""

import asyncio
import json
import logging
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from daemon.cell.exposure_control import ExposureLimits
from daemon.config.settings import ExposureSettings, Settings, load_settings_file
from daemon.plc.switch import PlcSwitch
from daemon.server import changes, taken_over
from tests.daemon.cell_under_test import Bench, serving, settings_for

SETTINGS = """
[robot]
address = "tcp://robot:11111"
box_mm = [[-2000, -2000, -500], [2000, 2000, 2500]]
{robot}
[camera]
address = "http://camera/frame.png"
[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0
[calibration]
tolerance_mm = {tolerance}
[server]
port = 0
log_level = "{level}"
[storage]
folder = "store"
reserve_mb = 0
{more}
"""


def write(file: Path, tolerance: float = 1.0, level: str = "info", robot: str = "", more: str = "") -> None:
    file.write_text(SETTINGS.format(tolerance=tolerance, level=level, robot=robot, more=more))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write(tmp_path / "handeyed.toml")
    return tmp_path / "handeyed.toml"


@pytest.fixture(autouse=True)
def root_level() -> Any:
    """The level of the root logger is the process's: it is put back."""
    before = logging.getLogger().level
    yield
    logging.getLogger().setLevel(before)


@asynccontextmanager
async def serving_file(file: Path) -> AsyncIterator[Bench]:
    settings, loaded = load_settings_file(file)
    async with serving(settings, settings_file=loaded) as bench:
        yield bench


async def reload(bench: Bench) -> list[str]:
    """Reload; returns the warnings of /ready."""
    assert bench.application.reload is not None
    await bench.application.reload()
    warnings: list[str] = (await bench.client.get("/ready")).json()["warnings"]
    return warnings


async def shown(bench: Bench) -> Any:
    return (await bench.client.get("/settings")).json()["settings"]


async def test_tolerance_and_log_level_are_taken_over_and_the_file_is_then_the_daemon_s(file: Path) -> None:
    async with serving_file(file) as bench:
        write(file, tolerance=0.5, level="warning")
        assert await reload(bench) == []
        settings = await shown(bench)
        assert (settings["calibration"]["tolerance_mm"], settings["server"]["log_level"]) == (0.5, "warning")
        assert logging.getLogger().level == logging.WARNING
        assert bench.application.cameras.main.operations.settings.calibration.tolerance_mm == 0.5
        assert bench.application.settings_file == load_settings_file(file)[1]


async def test_a_fragment_is_taken_over_and_the_hash_of_about_covers_it(file: Path) -> None:
    async with serving_file(file) as bench:
        before = (await bench.client.get("/about")).json()["settings"]
        (file.parent / "conf.d").mkdir()
        (file.parent / "conf.d" / "plant.toml").write_text("[calibration]\ntolerance_mm = 0.25\n")
        assert await reload(bench) == []
        assert (await shown(bench))["calibration"]["tolerance_mm"] == 0.25
        after = (await bench.client.get("/about")).json()["settings"]
        assert (after["file"], after["sha256"] != before["sha256"]) == (before["file"], True)
        assert after == {"file": str(file), "sha256": load_settings_file(file)[1].sha256}


def limits_of(bench: Bench) -> ExposureLimits | None:
    control = bench.application.cameras.main.operations.cell.exposure
    return None if control is None else control.limits


async def test_the_limits_of_the_camera_s_exposure_are_taken_over_when_no_run_is_in_progress(file: Path) -> None:
    async with serving_file(file) as bench:
        assert limits_of(bench) is None
        run = (await bench.client.post("/calibrate", json={"manual": True})).json()["id"]
        write(file, more="[camera.exposure]\nexposure_us = [20.0, 500.0]\n")
        assert bench.application.reload is not None
        reloading = asyncio.create_task(bench.application.reload())
        await asyncio.sleep(0)
        assert limits_of(bench) is None
        await bench.client.post(f"/runs/{run}/abort")
        await reloading
        assert limits_of(bench) == ExposureLimits((20.0, 500.0), (0.0, 6.0))
        assert (await shown(bench))["camera"]["exposure"]["exposure_us"] == [20.0, 500.0]
        assert (await bench.client.get("/ready")).json()["warnings"] == []
        write(file)
        assert await reload(bench) == []
        assert limits_of(bench) is None


async def test_what_needs_a_restart_is_named_and_not_taken_over(file: Path) -> None:
    async with serving_file(file) as bench:
        before = bench.application.settings_file
        write(file, tolerance=0.5, robot="speed_mm_s = 50.0")
        assert await reload(bench) == ["settings were changed that need a restart: robot.speed_mm_s"]
        settings = await shown(bench)
        assert (settings["calibration"]["tolerance_mm"], settings["robot"]["speed_mm_s"]) == (0.5, 100.0)
        assert bench.application.settings_file == before  # `handeyed check` then says what is not active
        write(file, tolerance=0.5)
        assert await reload(bench) == []


async def test_a_file_that_cannot_be_read_changes_nothing(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with serving_file(file) as bench:
        write(file, robot="speed_mms = 50.0")
        assert await reload(bench) == []
        assert "robot.speed_mms: unknown key: did you mean 'speed_mm_s'?" in caplog.text
        assert (await shown(bench))["robot"]["speed_mm_s"] == 100.0


def plc(**values: Any) -> str:
    """[plc] at any port."""
    return "\n".join(["[plc]", "port = 0", *(f"{name} = {json.dumps(value)}" for name, value in values.items()), ""])


def switch_of(bench: Bench) -> PlcSwitch:
    return next(one for one in bench.application.services if isinstance(one, PlcSwitch))


async def answers_modbus(bench: Bench) -> bool:
    port = switch_of(bench).service.tcp.port
    _, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.close()
    await writer.wait_closed()
    return True


async def test_the_plc_s_interface_is_switched_on_over_and_off(file: Path) -> None:
    async with serving_file(file) as bench:
        for connections in (1, 2):
            write(file, more=plc(connections=connections))
            assert await reload(bench) == []
            assert switch_of(bench).service.tcp.limits.connections == connections
            assert await answers_modbus(bench)
        write(file)
        assert await reload(bench) == []
        with pytest.raises(LookupError):
            assert switch_of(bench).service


async def test_a_port_that_is_taken_leaves_the_plc_s_interface_as_it_was(file: Path) -> None:
    write(file, more=plc(connections=1))
    async with serving_file(file) as bench:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            write(file, more=plc(connections=2).replace("port = 0", f"port = {taken.getsockname()[1]}"))
            assert await reload(bench) == ["settings were changed that need a restart: plc"]
        assert switch_of(bench).service.tcp.limits.connections == 1
        assert await answers_modbus(bench)


async def test_a_plc_that_holds_abort_keeps_its_interface(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(file, more=plc(connections=1))
    async with serving_file(file) as bench:
        bench.application.supervisor.hold_abort(["the PLC at 127.0.0.1"])
        write(file)
        assert "settings were changed that need a restart: plc" in await reload(bench)
        assert "a PLC holds abort" in caplog.text
        assert await answers_modbus(bench)


async def test_webhooks_are_taken_over_or_as_before_when_a_secret_cannot_be_read(file: Path) -> None:
    secret = file.parent / "secret"
    secret.write_text("0" * 64)
    webhook = '[[webhooks]]\nreceiver = "mes"\nurl = "http://127.0.0.1:9/x"\nsecret_file = "{}"\n'
    async with serving_file(file) as bench:
        write(file, more=webhook.format("nowhere"))
        assert await reload(bench) == ["settings were changed that need a restart: webhooks"]
        write(file, more=webhook.format("secret"))
        assert await reload(bench) == []
        assert 'receiver="mes"' in (await bench.client.get("/metrics")).text


def changed(settings: Settings, section: str, **values: Any) -> Settings:
    return settings.model_copy(update={section: getattr(settings, section).model_copy(update=values)})


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda s: s, []),
        (lambda s: changed(s, "robot", speed_mm_s=1.0), ["robot.speed_mm_s"]),
        (lambda s: s.model_copy(update={"scanner": None}), ["scanner"]),
        (
            lambda s: changed(s, "camera", limit_s=1.0, exposure=ExposureSettings()),
            ["camera.exposure", "camera.limit_s"],
        ),
        (lambda s: changed(s, "server", port=1, log_level="debug"), ["server.log_level", "server.port"]),
    ],
)
def test_changes_have_the_names_of_the_file(
    tmp_path: Path, change: Callable[[Settings], Settings], names: list[str]
) -> None:
    before = settings_for(tmp_path)
    after = change(before)
    assert changes(before, after) == names
    taken = [name for name in names if name in ("server.log_level", "camera.exposure")]
    assert changes(taken_over(before, after, taken), after) == [name for name in names if name not in taken]
