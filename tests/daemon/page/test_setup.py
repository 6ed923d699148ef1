"""The first set-up in the page, by keyboard: from an empty folder to an accepted calibration of the mock cell."""

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner

from daemon.cli import local_daemon
from daemon.cli.demo_run.processes import start_child
from daemon.cli.main import app
from tests.daemon.page.conftest import page_of
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

FAST = ["mock_robot", "run", "--with-parent", "--time-scale", "100"]
MAX_ANSWERS = 8
SMALL_SCREEN = {"width": 1366, "height": 768}


class Keyboard:
    """A person at the keys: `answers` counts what was typed or pressed for a question."""

    def __init__(self, page: Any) -> None:
        self.page, self.answers = page, 0

    async def go_to(self, one: Any) -> None:
        """Tab until it has the focus."""
        await one.wait_for()
        for _ in range(60):
            if await one.evaluate("one => one === document.activeElement"):
                return
            await self.page.keyboard.press("Tab")
        raise AssertionError("Tab does not reach it")

    async def type(self, name: str, text: str) -> None:
        await self.go_to(self.page.locator(name))
        await self.page.keyboard.press("Control+A")
        await self.page.keyboard.type(text)
        self.answers += 1

    async def press(self, name: str) -> None:
        await self.go_to(self.page.get_by_role("button", name=name))
        await self.page.keyboard.press("Enter")
        self.answers += 1

    async def go_on(self) -> None:
        """Enter in the last field: the step's one action, which is in view."""
        primary = self.page.locator("main .primary:visible")
        assert await primary.count() == 1
        box = await primary.bounding_box()
        assert box["y"] + box["height"] <= SMALL_SCREEN["height"]
        assert box["width"] >= 200
        await self.page.keyboard.press("Enter")


async def test_from_an_empty_folder_to_an_accepted_calibration(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cell" / "handeyed.toml"
    file.parent.mkdir()
    with (
        start_child("mock", FAST, tmp_path) as mock,
        start_child("daemon", ["daemon.cli", "serve", "--setup", str(file)], tmp_path) as daemon,
    ):
        cell, url = mock.announcement, daemon.announcement["url"]
        async with httpx.AsyncClient(timeout=LIMIT_S) as client:

            async def moves() -> int:
                return int((await client.get(f"{cell['control']}/state")).json()["moves_commanded"])

            port = int(url.rpartition(":")[2])
            monkeypatch.setattr(local_daemon, "free_port", lambda: port)
            typed = [cell["rws"]["1.0"], cell["camera"], "", "", "200/10 calliper", "1", "program"]
            again = tmp_path / "init.toml"
            ran = await asyncio.to_thread(CliRunner().invoke, app, ["init", str(again)], "\n".join(typed) + "\n")
            assert ran.exit_code == 0, ran.output
            async with page_of(browser, viewport=SMALL_SCREEN) as page:
                page.set_default_timeout(1000 * LIMIT_S)
                keys = Keyboard(page)
                await page.goto(url)
                await keys.type("#controller", cell["rws"]["1.0"])
                await keys.type("#camera", cell["camera"])
                await keys.go_on()
                await page.get_by_text("12 × 9 squares").wait_for()
                await keys.type("#length", "200")
                await keys.go_on()
                await keys.press("The box of the robot's program")
                while not await page.locator(".wizard-box input").first.input_value():
                    await page.wait_for_timeout(100)
                await keys.type("#tolerance", "1")
                await keys.go_on()
                await page.wait_for_url("**/#/cell")
                assert file.read_bytes() == again.read_bytes()
                while not (await client.get(f"{url}/calibrate")).json()["ready"]:
                    await page.wait_for_timeout(200)
            assert keys.answers <= MAX_ANSWERS
            assert await moves() == 0

            for _ in range(5):  # beside much else the mock may take longer for a picture than a camera may
                run = (await client.post(f"{url}/calibrate", json={"count": 8}, params={"wait": LIMIT_S})).json()
                if (run["cause"] or {}).get("code") != "device-timeout":
                    break
            assert run["state"] == "finished", run["cause"]
            found = (await client.get(f"{url}/calibrations/{run['result']['calibration_id']}")).json()
            assert found["verdict"]["accepted"], found["verdict"]
            assert await moves() > 0
