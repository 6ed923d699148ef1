"""Pictures of the page for docs/page.md: `python -m tests.daemon.page.pictures URL`.

URL is that of `make cell`, calibrated and with a scan; it is verified, a touch test and a rig are stored, and it is
calibrated once more with the arm's errors. Writes docs/page/NAME.webp.

`python -m tests.daemon.page.pictures URL --all FOLDER` writes each screen whole, at each width, in each theme and
language, as FOLDER/WIDTH-THEME-LANGUAGE-NAME.png, and prints those that are wider than their window.
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
from playwright.sync_api import sync_playwright

from calibration.transforms import rotation_from_vector, transform
from tests.daemon.rig_files import a_rig
from tests.extensions.touch.touches import json_of

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "page"
CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PLACES = (
    "sign-in", "cell", "calibrate", "run", "result", "verify", "scans", "devices", "history", "audit", "settings",
    "help",
)  # fmt: skip
WIDTH, HEIGHT = 1366, 768
KEPT_WIDTH = 960
HEADER_PX = 68
"""Of the top of a window, that stays while it is scrolled."""
SETTLE_MS = 8000
WIDTHS, THEMES, LANGUAGES = (360, 768, 1280, 1920), ("light", "dark"), ("en", "de", "zh", "es", "pseudo")
FARTHER_DOWN = {"rig": ("devices", "#rig"), "touch": ("verify/touch", "#touch")}
"""Further pictures: of a screen's lower parts, by the first card in them."""

SHOWN = "div.arriving"
"""There while a screen waits for its first answers."""


def places(url: str) -> Iterator[tuple[str, str]]:
    """Name of the picture and fragment of the address."""
    runs = httpx.get(f"{url}/runs").json()["runs"]
    calibration = next(run["id"] for run in runs if run["kind"] == "calibration" and run["state"] == "finished")
    scans = httpx.get(f"{url}/scans").json()["scans"]
    for place in PLACES:
        yield place, f"run/{calibration}" if place == "run" else place
    if scans:
        yield "scan", f"scans/{scans[0]['id']}"


VERIFICATIONS, ARM_VIEWS, PLACING_MM, TOLERANCE_MM = 6, 12, 0.1, 0.8
TIP_MM = np.array([5.0, -10.0, 200.0])


def prepare(url: str) -> None:
    """Fill the screens that an ordinary run leaves empty."""
    with httpx.Client(base_url=url, timeout=600.0) as daemon:
        daemon.post("/calibrate", params={"wait": 300}, json={"arm": True, "count": ARM_VIEWS}).raise_for_status()
        for _ in range(VERIFICATIONS):
            daemon.post("/verify", params={"wait": 300}, json={}).raise_for_status()
        run = daemon.get("/runs", params={"kind": "verify", "limit": 1}).json()["runs"][0]
        tip = {"flange_tip_mm": TIP_MM.tolist(), "covariance": (PLACING_MM**2 / 4 * np.eye(3)).tolist(),
               "placing_sigma_mm": PLACING_MM}  # fmt: skip
        touched = {"tip": tip, "verification": run["id"], "tolerance_mm": TOLERANCE_MM}
        daemon.post("/touch", json=touched | {"touches": list(touches_of(run["result"]["verification"]))})
        daemon.post("/rigs", json=a_rig()).raise_for_status()


def touches_of(verification: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The points of the cross, touched as exactly as the tip is placed."""
    rng, rotation = np.random.default_rng(0), rotation_from_vector([np.pi, 0, 0.3])
    for point in verification["points"]:
        if point["id"] in verification["cross"]:
            at = np.mean(point["base_mm"], axis=0) + rng.normal(0, PLACING_MM, 3) - rotation @ TIP_MM
            yield {"id": point["id"], "base_T_flange": json_of(transform(rotation, at))}


def main(url: str) -> None:
    FOLDER.mkdir(exist_ok=True)
    prepare(url)
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light").new_page()
        for name, fragment in [*places(url), *((name, place) for name, (place, _) in FARTHER_DOWN.items())]:
            page.goto("about:blank")
            page.goto(f"{url}/page/?lang=en&theme=light#/{fragment}")
            page.wait_for_timeout(SETTLE_MS)
            if name in FARTHER_DOWN:
                page.locator(FARTHER_DOWN[name][1]).evaluate(
                    "(card, above) => { card.scrollIntoView(); scrollBy(0, -above); }", HEADER_PX
                )
            _write(page, FOLDER / f"{name}.webp")
        browser.close()


def write_all(url: str, folder: Path) -> int:
    """Number of pictures that are wider than their window."""
    folder.mkdir(parents=True, exist_ok=True)
    wide = []
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        for width, theme, language in product(WIDTHS, THEMES, LANGUAGES):
            page = browser.new_context(viewport={"width": width, "height": HEIGHT}).new_page()
            page.goto(f"{url}/page/?lang={language}&theme={theme}")
            for name, fragment in places(url):
                page.evaluate("fragment => { location.hash = '#/' + fragment }", fragment)
                page.locator("main .card").first.wait_for()
                page.locator(SHOWN).wait_for(state="detached")
                page.screenshot(path=folder / f"{width}-{theme}-{language}-{name}.png", full_page=True)
                if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
                    wide.append(f"{width} {theme} {language} {name}")
            page.context.close()
        browser.close()
    print("\n".join(wide) or "nothing is wider than its window")
    return len(wide)


def _write(page: Any, file: Path) -> None:
    shot = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert shot is not None
    small = cv2.resize(shot, (KEPT_WIDTH, KEPT_WIDTH * shot.shape[0] // shot.shape[1]), interpolation=cv2.INTER_AREA)
    _, encoded = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, 82])
    file.write_bytes(encoded.tobytes())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url")
    parser.add_argument("--all", type=Path, help="folder for every screen at every width, in every theme and language")
    options = parser.parse_args()
    sys.exit(write_all(options.url, options.all) if options.all else main(options.url))
