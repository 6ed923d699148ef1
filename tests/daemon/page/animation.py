"""An animation of a run for the README: `python -m tests.daemon.page.animation URL [--out FILE]`.

URL is that of `make cell`, best with `handeyed demo --keep --time-scale 4`, so that the arm is seen to move. Starts a
calibration and follows it on the page: about 20 s, as animated WebP. Run it again when the page has changed; --during
and --after are the page's addresses then.
"""

import argparse
import io
import itertools
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from handeyed import Client
from tests.daemon.page.pictures import ARGUMENTS, CHROMIUM, FOLDER

SECONDS, SHOWN_AT_THE_END_S, FRAMES_A_SECOND = 20.0, 4.0, 4
WINDOW, KEPT_WIDTH, QUALITY = {"width": 1366, "height": 768}, 854, 55


def frame_of(page: Page) -> Image.Image:
    """The window as it is, in the width that is kept."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return picture.resize((KEPT_WIDTH, round(picture.height * KEPT_WIDTH / picture.width)), Image.Resampling.LANCZOS)


def take(url: str, during: str, after: str) -> list[tuple[Image.Image, float]]:
    """Pictures of one run, and when each was taken, s."""
    with Client(url) as cell, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_context(viewport=WINDOW, color_scheme="light").new_page()  # type: ignore[arg-type]
        run = cell.start("/calibrate")
        page.goto(f"{url}/page/?lang=en#/{during.format(run=run['id'])}")
        taken, over = [], False
        while True:
            taken.append((frame_of(page), time.monotonic()))
            if not over and cell.run(run["id"])["over"]:
                over, until_s = True, time.monotonic() + SHOWN_AT_THE_END_S
                page.goto(f"{url}/page/?lang=en#/{after.format(run=run['id'])}")
            if over and time.monotonic() > until_s:
                break
            page.wait_for_timeout(1000 / FRAMES_A_SECOND)
        browser.close()
    return taken


def write(taken: list[tuple[Image.Image, float]], file: Path) -> None:
    """The pictures as an animation of at most SECONDS, faster than it was where that is longer."""
    began_s, ended_s = taken[0][1], taken[-1][1]
    faster = max(1.0, (ended_s - began_s) / SECONDS)
    shown_ms = [round((then - now) * 1000 / faster) for (_, now), (_, then) in itertools.pairwise(taken)]
    first, *others = (picture for picture, _ in taken)
    first.save(file, save_all=True, append_images=others, duration=[*shown_ms, 2000], loop=0, quality=QUALITY, method=6)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url")
    parser.add_argument("--during", default="calibrate/{run}")
    parser.add_argument("--after", default="calibrate/{run}")
    parser.add_argument("--out", type=Path, default=FOLDER / "a-run.webp")
    given = parser.parse_args()
    write(take(given.url.rstrip("/"), given.during, given.after), given.out)
