"""A frame of the arm in three dimensions: `python -m benchmarks.daemon.page_frames`.

A mock cell is calibrated; the run's screen is opened in Debian's Chromium without a graphics card, at 1366 x 768 and
one pixel a point, and the scene is turned by its keys: arm, box, target and numbered pictures. A frame is timed from
the begin of its drawing until its first pixel can be read, so that the rasteriser has ended. Beside it stands the
processor time of all of the browser's processes for a frame, of which other work on the machine takes nothing. With a
graphics card it is measured where there is one: `--gl ''` leaves the choice to the browser.
"""

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import httpx
from playwright.sync_api import sync_playwright

from benchmarks.daemon.page import CHROMIUM, RENDERER, processor_s
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text

SEED = 7
BAR_MS = {"a graphics card": 50.0, "software": 125.0}
"""Of a frame (cockpit.md, B22)."""
FRAMES, WARM_UP = 60, 10

TURN = """count => new Promise((done) => {
    const canvas = document.querySelector('main canvas');
    const gl = canvas.getContext('webgl2');
    const pixel = new Uint8Array(4);
    const took = [];
    const next = () => {
        let began = 0;
        requestAnimationFrame(() => { began = performance.now(); });
        canvas.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true, cancelable: true }));
        requestAnimationFrame(() => {
            gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
            took.push(performance.now() - began);
            if (took.length < count) next(); else done(took);
        });
    };
    next();
})"""
"""Turns the scene by a key so often, a frame each; returns the ms from the begin of each to its first pixel."""
RENDERED_BY = """() => {
    const gl = document.querySelector('main canvas').getContext('webgl2');
    const named = gl.getExtension('WEBGL_debug_renderer_info');
    return gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
}"""


def descendants(pid: int) -> Iterator[int]:
    """The processes that it began, and those that they began."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue
    found = [pid]
    for each in found:
        found += [child for child, parent in parents.items() if parent == each]
    return iter(found[1:])


def turn(url: str, run: str, chosen: list[str]) -> tuple[list[float], float, str]:
    """The ms of each frame, the processor's ms a frame, and by what it is drawn."""
    with sync_playwright() as started:
        before = set(descendants(os.getpid()))
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[*chosen, "--no-sandbox"])
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.goto(f"{url}/page/?lang=en#/run/{run}")
        page.locator("main canvas").wait_for()
        page.wait_for_timeout(5000)
        page.evaluate(TURN, WARM_UP)
        of_browser = sorted(set(descendants(os.getpid())) - before)
        worked_s = sum(map(processor_s, of_browser))
        took = page.evaluate(TURN, FRAMES)
        worked_s = sum(map(processor_s, of_browser)) - worked_s
        drawn_by = page.evaluate(RENDERED_BY)
        browser.close()
    return took, 1000 * worked_s / FRAMES, drawn_by


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gl", default=" ".join(RENDERER), help="the browser's options that choose how it draws")
    chosen = parser.parse_args().gl.split()
    with tempfile.TemporaryDirectory(prefix="handeyed-page-") as name:
        folder = Path(name)
        mock = ["mock_robot", "run", "--with-parent", "--seed", str(SEED), "--time-scale", "100"]
        with start_child("mock-cell", mock, folder) as cell:
            (folder / "handeyed.toml").write_text(settings_text(cell.announcement, 0))
            with start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon:
                url = daemon.announcement["url"]
                run = httpx.post(f"{url}/calibrate", params={"wait": 300}, json={"count": 8}, timeout=330).json()
                if run["state"] != "finished":
                    raise SystemExit(f"the run did not finish: {run['cause'] or run['state']}")
                took, worked_ms, drawn_by = turn(url, run["id"], chosen)
    kind = "software" if "swiftshader" in drawn_by.lower() or "llvmpipe" in drawn_by.lower() else "a graphics card"
    middle, best = statistics.median(took), sorted(took)[len(took) // 10]
    print(f"drawn by {drawn_by}")
    print(
        f"a frame by {kind}, of {FRAMES}: median {middle:.0f} ms (bar {BAR_MS[kind]:.0f}), a tenth below {best:.0f} ms"
    )
    print(f"{worked_ms:.0f} ms of the processor a frame, load {os.getloadavg()[0]:.0f} on {os.cpu_count()} cores")
    return int(middle > BAR_MS[kind])


if __name__ == "__main__":
    sys.exit(main())
