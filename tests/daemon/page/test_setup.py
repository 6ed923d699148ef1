"""The first set-up in the page, by keyboard: from an empty folder to an accepted calibration of the mock cell."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import httpx
import pytest
from typer.testing import CliRunner

from calibration.documents.target import described
from calibration.documents.target_text import target_of_text
from daemon.cli import rest_client
from daemon.cli.demo_run.processes import start_child
from daemon.cli.main import app
from daemon.config.settings import load_settings
from daemon.config.toml_text import toml_text
from tests.daemon.cli.running import handeyed
from tests.daemon.page.conftest import AXE_FINDINGS, HIDE, page_of
from tests.support.ports import free_port, usual_port
from tests.support.waiting import LIMIT_S

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.slow]

FAST = ["mock_robot", "run", "--with-parent", "--time-scale", "100"]
MAX_ANSWERS, MAX_S = 8, 240.0
SMALL_SCREEN, PHONE = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
MAX_RATIO = 1.5
MAX_LIVE_PER_S, TIMER_MS = 5, 10.0
SHOWS = "number => Number(document.querySelector('.wizard-side figure')?.dataset.number) >= number"
NEAR_MM = ("400", "900", "-300", "300", "450", "900")
"""Two corners, by axis, that every arm of the mock cell reaches."""
EXPECTED = r"expected with 8 pictures: ± ([\d.]+) mm"

TOO_SMALL = """() => [...document.querySelectorAll('main :is(a, button, input, select)')]
    .filter((one) => one.offsetParent).map((one) => [one, (one.closest('label.check') ?? one).getBoundingClientRect()])
    .filter(([, { width, height }]) => width < 44 || height < 44).map(([one]) => one.outerHTML.slice(0, 120))"""
"""What is pressed or typed into on a screen, and is smaller than a finger: 44 px (cockpit.md, B19)."""
DROPPED = """text => {
    const held = new DataTransfer();
    held.items.add(new File([text], 'other.toml'));
    return held;
}"""
LOW_CONTRAST = """async () => (await axe.run({ runOnly: ['color-contrast-enhanced'] })).violations.flatMap(
    ({ nodes }) => nodes.map(({ html }) => html.slice(0, 160)))"""
"""Text of less than 7 to 1, or of 4.5 to 1 where it is large (WCAG 2.2, 1.4.6)."""


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
        usual_port(),
        start_child("mock", FAST, tmp_path) as mock,
        start_child("daemon", ["daemon.cli", "serve", "--setup", str(file)], tmp_path) as daemon,
    ):
        cell, url = mock.announcement, daemon.announcement["url"]
        async with httpx.AsyncClient(timeout=LIMIT_S) as client:

            async def moves() -> int:
                return int((await client.get(f"{cell['control']}/state")).json()["moves_commanded"])

            port = int(url.rpartition(":")[2])
            monkeypatch.setattr(rest_client, "free_port", lambda: port)
            typed = [cell["rws"]["1.0"], cell["camera"], "", "", "200/10 calliper", "1", "program"]
            again = tmp_path / "init.toml"
            ran = await asyncio.to_thread(CliRunner().invoke, app, ["init", str(again)], "\n".join(typed) + "\n")
            assert ran.exit_code == 0, ran.output
            said = re.search(EXPECTED, ran.output)
            assert said is not None
            async with page_of(browser, viewport=SMALL_SCREEN) as page, asyncio.timeout(MAX_S):
                page.set_default_timeout(1000 * LIMIT_S)
                keys = Keyboard(page)
                await page.goto(url)
                await keys.type("#controller", cell["rws"]["1.0"])
                await keys.type("#camera", cell["camera"])
                await keys.go_on()
                await page.get_by_text("12 × 9 squares").wait_for()
                await keys.type("#length", "200")
                await keys.go_on()
                await page.get_by_text(f"expected {said[1]}").wait_for()
                await keys.press("The program's box")
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
                checked = await asyncio.to_thread(handeyed, "check", file)
                assert checked.status == 0, checked.out

                for _ in range(5):  # beside much else the mock may take longer for a picture than a camera may
                    run = (await client.post(f"{url}/calibrate", json={"count": 8}, params={"wait": LIMIT_S})).json()
                    if (run["cause"] or {}).get("code") != "device-timeout":
                        break
            assert run["state"] == "finished", run["cause"]
            found = (await client.get(f"{url}/calibrations/{run['result']['calibration_id']}")).json()
            assert found["verdict"]["accepted"], found["verdict"]
            assert 1 / MAX_RATIO < found["accuracy"]["expected_mm"] / float(said[1]) < MAX_RATIO
            assert await moves() > 0


@asynccontextmanager
async def page_of_set_up(browser: Any, folder: Path) -> AsyncIterator[tuple[Any, dict[str, Any], str]]:
    """The page of a daemon that sets a cell up in the folder, what the mock announces, and the daemon's address."""
    serve = ["daemon.cli", "serve", "--setup", str(folder / "handeyed.toml")]
    with usual_port(), start_child("mock", FAST, folder) as mock, start_child("daemon", serve, folder) as daemon:
        async with page_of(browser, viewport=SMALL_SCREEN) as page:
            page.set_default_timeout(1000 * LIMIT_S)
            yield page, mock.announcement, daemon.announcement["url"]


async def test_each_step_is_read_and_pressed_by_everybody(browser: Any, axe: str, tmp_path: Path) -> None:
    async with page_of_set_up(browser, tmp_path) as (page, cell, url):

        async def look() -> None:
            for viewport in (PHONE, SMALL_SCREEN):
                await page.set_viewport_size(viewport)
                await page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
                for scheme in ("dark", "light"):
                    await page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
                    assert await page.evaluate(AXE_FINDINGS) == []
                    assert await page.evaluate(LOW_CONTRAST) == []
                assert await page.evaluate(TOO_SMALL) == []

        async def find(route: Any) -> None:
            """As if both had answered by themselves."""
            answer = await route.fetch()
            camera = {"address": cell["camera"], "vendor": "Basler", "model": "acA1920-40gm", "problem": ""}
            found = {"controllers": ["192.168.125.1", cell["rws"]["1.0"]], "cameras": [camera]}
            await route.fulfill(response=answer, json={**await answer.json(), **found})

        await page.route("**/setup", find)
        await page.goto(url)
        await page.evaluate(axe)
        assert await page.get_by_role("radio", name="acA1920-40gm").is_checked()
        await page.get_by_role("radio", name=cell["rws"]["1.0"]).check()
        assert await page.locator("#controller").input_value() == cell["rws"]["1.0"]
        await look()
        for press in ("Try it", "Take a picture"):
            await page.get_by_role("button", name=press).click()
            await page.locator("form[aria-busy=false]").wait_for()
        await page.locator("#robot").wait_for()
        await look()
        await page.locator("main .primary").click()
        await page.locator("#length").fill("200")
        await look()
        printed = await page.get_by_role("link", name="Print this target").get_attribute("href")
        assert "charuco:12x9:20:15:" in unquote(printed)
        assert (await page.request.get(urljoin(page.url, printed))).headers["content-type"] == "application/pdf"
        await page.locator("main .primary").click()
        await page.locator("#tolerance").fill("0.2")
        await page.get_by_text("more than your limit").wait_for()
        await page.get_by_role("button", name="The program's box").click()
        await page.get_by_text("% of the box").wait_for()
        await look()
        far = page.get_by_label("X opposite corner, mm")
        before = float(await far.input_value())
        face = page.locator("[data-face=X2]")
        await face.hover()  # waits until the scene, which has another size now, has put it where it stays
        knob = await face.bounding_box()
        x, y = knob["x"] + knob["width"] / 2, knob["y"] + knob["height"] / 2
        await page.mouse.down()
        await page.mouse.move(x + 20, y + 12, steps=3)
        await page.mouse.up()
        assert float(await far.input_value()) > before, "the face goes towards who looks"
        for one, mm in zip(await page.locator(".wizard-box input").all(), NEAR_MM, strict=True):
            await one.fill(mm)
        await page.get_by_text("Red where the arm cannot reach: nowhere").wait_for()


async def test_a_settings_file_answers_and_nothing_is_tried_before_one_goes_on(browser: Any, tmp_path: Path) -> None:
    file, other = tmp_path / "handeyed.toml", tmp_path / "other.toml"
    report = '[report]\ncell = "Line 3"\n[calibration]\ntolerance_mm = 0.4\n'
    file.write_text(f'{report}[server]\nport = {free_port()}\n[storage]\nfolder = "store"\n')
    with (
        start_child("mock", FAST, tmp_path) as mock,
        start_child("daemon", ["daemon.cli", "serve", "--setup", str(file)], tmp_path) as daemon,
    ):
        cell = mock.announcement
        board = "charuco:12x9:20:15:DICT_5X5_100"
        other.write_text(
            f'[robot]\naddress = "{cell["rws"]["1.0"].replace("http", "rws")}"\n'
            "box_mm = [[0, -900, 0], [1400, 900, 1600]]\n"
            f'[camera]\naddress = "{cell["camera"]}"\n[target]\n{toml_text(described(target_of_text(board)))}'
        )
        async with page_of(browser, viewport=SMALL_SCREEN) as page:
            page.set_default_timeout(1000 * LIMIT_S)
            asked: list[str] = []
            page.on("request", lambda one: asked.append(f"{one.method} {urlsplit(one.url).path}"))
            await page.goto(f"{daemon.announcement['url']}/page/?lang=en#/setup")
            await page.get_by_text(f"Filled in from {file}.").wait_for()
            assert "stays as it is: report" in await page.locator(".wizard-from").inner_text()
            assert await page.locator("#controller").input_value() == ""
            wrong = {"name": "wrong.toml", "mimeType": "text/plain", "buffer": b"[robot]\nspeed_mm_s = 9000"}
            await page.locator("input[type=file]").set_input_files(wrong)
            await page.get_by_text("· robot.speed_mm_s").wait_for()
            dropped = await page.evaluate_handle(DROPPED, other.read_text())
            await page.dispatch_event(".wizard", "drop", {"dataTransfer": dropped})
            await page.get_by_text("Filled in from other.toml.").wait_for()
            assert await page.locator("#camera").input_value() == cell["camera"]
            assert not [one for one in asked if one.endswith("/setup/try")]
            for _ in range(2):
                await page.locator("main .primary").click()
                await page.locator("form[aria-busy=false]").wait_for()
                if await page.locator("#length").count():
                    assert await page.locator("#length").input_value() == "20"
                    assert await page.locator("#second").input_value() == "15"
                    assert await page.get_by_role("radio", name="12 × 9 squares").is_checked()
            assert await page.get_by_label("X first corner, mm").input_value() == "0"
            await page.locator("main .primary").click()
            await page.wait_for_url("**#/cell")
    settings = load_settings(file)
    assert (settings.target, settings.robot.box_mm[1]) == (target_of_text(board), (1400.0, 900.0, 1600.0))
    assert settings.report.cell is None, "that of the file that was dropped has none"


async def test_the_picture_of_the_target_step_is_live(browser: Any, tmp_path: Path) -> None:
    """One at a time, at most five a second; none in a hidden tab, beside a try, or once the step is left."""
    async with page_of_set_up(browser, tmp_path) as (page, cell, url):
        under_way, most, asked, live = 0, 0, [], []
        page.on("requestfinished", lambda one: live.append(one) if "target" in (one.post_data or "")[:22] else None)

        async def count(route: Any) -> None:
            nonlocal under_way, most
            asked.append(route.request.post_data_json["question"])
            under_way += 1
            most = max(most, under_way)
            answer = await route.fetch()
            under_way -= 1
            await route.fulfill(response=answer)

        async def until(number: int) -> None:
            await page.wait_for_function(SHOWS, arg=number)

        async def stands() -> None:
            """No picture comes any more, however long one waits."""
            while under_way:
                await page.wait_for_timeout(50)
            before = len(asked)
            await page.clock.fast_forward(60_000)
            await page.evaluate("() => fetch('/health')")
            assert len(asked) == before

        await page.clock.install()
        await page.route("**/setup/try", count)
        await page.goto(f"{url}/page/?lang=en#/setup")
        await page.locator("#controller").fill(cell["rws"]["1.0"])
        await page.locator("#camera").fill(cell["camera"])
        await page.locator("main .primary").click()
        await page.locator("#length").wait_for()
        await until(4)
        assert asked[:2] == ["controller", "camera"]
        assert set(asked[2:]) == {"target"}
        await page.get_by_text("of 88 corners found").wait_for()
        await page.evaluate(HIDE, True)
        await stands()
        await page.evaluate(HIDE, False)
        await until(5)
        apart_ms = [after - before for before, after in pairwise(one.timing["startTime"] for one in live)]
        assert min(apart_ms) >= 1000 / MAX_LIVE_PER_S - TIMER_MS
        await page.get_by_role("button", name="Take another picture").click()
        await until(8)
        await page.get_by_role("button", name="Back").click()
        await stands()
        await page.unroute_all(behavior="ignoreErrors")
    assert most == 1
