"""A browser, a daemon with keys and the fake cell, and a page that fails the test on any console error."""

import os
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from daemon.cell import held_button
from tests.daemon.access_keys import with_keys
from tests.daemon.cell_under_test import Bench
from tests.support.cases import by_night
from tests.support.waiting import LIMIT_S

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
HARMLESS = (
    "GL Driver Message",
    "GPU stall",
    "the server responded with a status of 4",
    "the server responded with a status of 503",
    "net::ERR_",
)
"""Of the software renderer; and what Chromium writes of every refused request, which the page shows in words."""


@pytest.fixture(scope="session")
def chromium() -> str:
    if not Path(CHROMIUM).exists():
        pytest.skip(f"the page is tried with {CHROMIUM}: apt-get install chromium")
    return CHROMIUM


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser(chromium: str) -> AsyncIterator[Any]:
    """Debian's Chromium under Playwright; the tests are skipped where one of them is missing."""
    api = pytest.importorskip(
        "playwright.async_api", reason="the page is tried with Playwright: pip install playwright"
    )
    sandbox = [] if os.geteuid() else ["--no-sandbox"]
    async with api.async_playwright() as started:
        launched = await started.chromium.launch(executable_path=chromium, args=[*ARGUMENTS, *sandbox])
        yield launched
        await launched.close()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[tuple[Bench, dict[str, str]]]:
    """A daemon with a key of each role, and the fake cell's devices."""
    async with with_keys(tmp_path_factory.mktemp("page")) as running:
        yield running


AXE_FINDINGS = """async () => (await axe.run()).violations.map(
    ({ id, nodes }) => [id, nodes.map((one) => one.html.slice(0, 160))])"""
"""What axe-core, evaluated before, finds wrong on a page: rule and elements."""

COUNT_SHIFTS = """
    window.shifted = [];
    new PerformanceObserver((list) => list.getEntries().forEach(({ hadRecentInput, value, sources }) => {
        if (!hadRecentInput) shifted.push([value, sources.map(({ node }) => node?.outerHTML?.slice(0, 80))]);
    })).observe({ type: 'layout-shift', buffered: true });
"""
"""As https://wicg.github.io/layout-instability: the share of the window that moved, times how far."""

MAX_SHIFT = 0.02
"""Of one screen, and of a run from its start to its result (cockpit.md, B20)."""

HIDE = """hidden => {
  Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
  document.dispatchEvent(new Event('visibilitychange'));
}"""

LANGUAGES, THEMES = ("en", "de", "zh", "es"), ("light", "dark")
SHOWN = [*product(LANGUAGES, THEMES)] if by_night() else [*zip(LANGUAGES, 2 * THEMES, strict=True)]
"""How a screen is shown: in every language and every theme, and by night in each language by each theme."""

TWO_FRAMES = "() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))"

Opened = Callable[..., Any]


@pytest.fixture(scope="module")
def cookies() -> dict[str, Any]:
    """The cookies of each role that has signed in: a daemon takes ten attempts a minute from one address."""
    return {}


@pytest.fixture
def open_page(browser: Any, cell: tuple[Bench, dict[str, str]], cookies: dict[str, Any]) -> Opened:
    """`async with open_page(role="operator", place="cell", **context) as page`: signed in, without a console error."""
    bench, keys = cell

    @asynccontextmanager
    async def opened(
        role: str | None = None, place: str = "cell", query: str = "lang=en", **context: Any
    ) -> AsyncIterator[Any]:
        async with page_of(browser, **context) as page:
            window = page.context
            if role and role in cookies:
                await window.add_cookies(cookies[role])
            elif role:
                answer = await window.request.post(
                    f"{bench.url}/session", data={"key": keys[role]}, headers={"Origin": bench.url}
                )
                assert answer.ok, await answer.text()
                cookies[role] = await window.cookies()
            await page.goto(f"{bench.url}/page/?{query}#/{place}")
            yield page

    return opened


@asynccontextmanager
async def page_of(browser: Any, **context: Any) -> AsyncIterator[Any]:
    """An empty page in a window of its own; fails afterwards on any console error."""
    window = await browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **context})
    wrong: list[str] = []
    try:
        page = await window.new_page()
        page.set_default_timeout(1000 * LIMIT_S)
        window.on("page", lambda other: watch(other, wrong))
        watch(page, wrong)
        yield page
    finally:
        await window.close()
    assert wrong == []


def watch(page: Any, wrong: list[str]) -> None:
    """Collect what must not happen: errors in the console, faults of scripts, violations of the policy."""

    def on_console(message: Any) -> None:
        if message.type in ("error", "warning") and not any(text in message.text for text in HARMLESS):
            wrong.append(message.text)

    page.on("console", on_console)
    page.on("pageerror", lambda error: wrong.append(str(error)))


@pytest.fixture
def patient_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lease that a busy machine keeps; that silence ends it in time is tried in tests/daemon/runs."""
    monkeypatch.setattr(held_button, "LEASE_S", 10.0)
    monkeypatch.setattr(held_button, "FIRST_S", 30.0)  # then a button that the page let go unheard is forgotten


@pytest.fixture(scope="session")
def axe() -> str:
    """The source of axe-core; skipped where npm did not install it."""
    file = Path(os.environ.get("HANDEYED_NODE_MODULES", "")) / "axe-core" / "axe.min.js"
    if not file.is_file():
        pytest.skip("npm's axe-core is not here: npm install axe-core, and set HANDEYED_NODE_MODULES")
    return file.read_text()


@pytest.fixture(scope="session")
def node() -> str:
    found = shutil.which("node")
    if found is None:
        pytest.skip("the pure modules are tried with Node: apt-get install nodejs")
    return found
