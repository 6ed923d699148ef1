"""A changed settings file is taken over while the daemon runs, as far as it can be; the rest is named."""

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from daemon.config.settings import ExposureSettings, Settings, load_settings_file
from daemon.server import changes, taken_over
from tests.daemon.cell_under_test import Bench, settings_for
from tests.daemon.settings_file import reload, serving_file, write


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write(tmp_path / "handeyed.toml")
    return tmp_path / "handeyed.toml"


async def shown(bench: Bench) -> Any:
    return (await bench.client.get("/settings")).json()["settings"]


async def test_tolerance_and_log_level_are_taken_over_and_the_file_is_then_the_daemon_s(file: Path) -> None:
    async with serving_file(file) as bench:
        write(file, tolerance=0.5, level="warning")
        assert await reload(bench) == []
        settings = await shown(bench)
        assert (settings["calibration"]["tolerance_mm"], settings["server"]["log_level"]) == (0.5, "warning")
        assert logging.getLogger().level == logging.WARNING
        assert bench.application.cameras[0].operations.settings.calibration.tolerance_mm == 0.5
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


def limits_of(bench: Bench) -> ExposureSettings | None:
    control = bench.application.cameras[0].operations.cell.exposure
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
        assert limits_of(bench) == ExposureSettings(exposure_us=(20.0, 500.0))
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
