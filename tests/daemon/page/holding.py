"""How people press a button of the page, and how they hold one for a second: by mouse, finger or key."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from tests.daemon.page.conftest import TWO_FRAMES
from tests.support.waiting import LIMIT_S

HOLD_MS = 1400


async def press(one: Any, key: str = "Enter") -> None:
    """Press a key on a button, link or box once it is seen and can be used: its data may be on the way, the page old.

    What is hidden takes no focus, and the key would go to another place.
    """
    usable = one.and_(one.page.locator(":not([aria-disabled=true], :disabled)"))
    await usable.wait_for()
    await usable.press(key)


async def hold_by_mouse(page: Any, name: str) -> None:
    button = page.get_by_role("button", name=name)
    await button.scroll_into_view_if_needed()
    box = await button.bounding_box()
    await page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    await page.mouse.down()
    await page.wait_for_timeout(HOLD_MS)
    await page.mouse.up()


async def hold_by_finger(page: Any, name: str) -> None:
    button = page.get_by_role("button", name=name)
    await button.scroll_into_view_if_needed()
    box = await button.bounding_box()
    point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    link = await page.context.new_cdp_session(page)
    await link.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})
    await page.wait_for_timeout(HOLD_MS)
    await link.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


async def hold_by_key(page: Any, name: str) -> None:
    button = page.get_by_role("button", name=name)
    for _ in range(80):
        if await button.evaluate("one => one === document.activeElement"):
            break
        await page.keyboard.press("Tab")
    await page.keyboard.down("Enter")
    await page.wait_for_timeout(HOLD_MS)
    await page.keyboard.up("Enter")


async def hold_until(page: Any, hold: Any, name: str, taken: Callable[[], Awaitable[bool]]) -> None:
    """Hold a button as a person does: again when the page was old for a moment, and took no notice."""
    button = page.get_by_role("button", name=name).and_(page.locator(":not([aria-disabled=true])"))
    async with asyncio.timeout(LIMIT_S):
        while not await taken():
            if await button.count():
                await hold(page, name)
            await page.wait_for_timeout(500)


async def hold_requests(page: Any, pattern: str) -> asyncio.Event:
    """Requests of the page to such addresses wait until the event is set."""
    released = asyncio.Event()

    async def answer_late(route: Any) -> None:
        await released.wait()
        await route.continue_()

    await page.route(pattern, answer_late)
    return released


async def keep_holding(page: Any, button: str, until: Callable[[], bool], *, by_mouse: bool = False) -> None:
    """Hold a button until something is true, and on; again only where a request was not answered in time."""
    holds, late = 0, list[str]()
    page.on("requestfailed", lambda request: late.append(request.url))
    usable = page.locator(button).and_(page.locator(":not([aria-disabled])"))
    held = page.locator("[data-held]:not(.idle)")  # the page may find another button for `button` meanwhile
    async with asyncio.timeout(LIMIT_S):
        while not until():
            if await usable.count():
                await usable.evaluate("one => { one.dataset.held = 'yes' }")
                await (usable.hover() if by_mouse else usable.focus())
                await (page.mouse.down() if by_mouse else page.keyboard.down("Enter"))
                holds += 1
                await page.evaluate(TWO_FRAMES)
                while not until() and await held.count():
                    await page.wait_for_timeout(20)
                if not until():
                    await (page.mouse.up() if by_mouse else page.keyboard.up("Enter"))
            await page.wait_for_timeout(20)
    assert holds <= 1 or late, f"the page let go {holds - 1} times, though each request was answered"


async def press_shortly(one: Any) -> None:
    """Press a key for 0.3 s by the page's own timers, which fire in their order however busy the machine is."""
    await one.evaluate("""one => new Promise((done) => {
        const send = (kind) => one.dispatchEvent(new KeyboardEvent(kind, {key: 'Enter', bubbles: true}));
        send('keydown');
        setTimeout(() => done(send('keyup')), 300);
    })""")


async def let_go(page: Any, how: str) -> None:
    """Let go of the button that is held with the key, in one of the ways."""
    if how == "key":
        await page.keyboard.up("Enter")
    elif how == "Escape":
        await page.keyboard.press("Escape")
    elif how == "blur":
        await page.evaluate("document.activeElement.blur()")
    elif how == "window":
        await page.evaluate("window.dispatchEvent(new Event('blur'))")
    elif how == "hidden":
        await page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")
    else:
        await page.context.set_offline(True)
