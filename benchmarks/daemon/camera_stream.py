"""GET /health beside a 12-bit camera of 5 million pixels: `python -m benchmarks.daemon.camera_stream`.

The daemon's process takes pictures as fast as asked for through the driver of industrial cameras, with a library in
memory in place of the vendor's: unpacking, scaling to 8 bits and encoding are the real ones. A request is sent every
10 ms, so that they meet every moment of some hundred pictures; the same without the camera tells what the machine's
other work costs. The longest turn of the event loop is counted in processor time, which other work does not take.
"""

import argparse
import asyncio
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from benchmarks.daemon.half_open import health_ms, row
from benchmarks.daemon.http import process
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import RawPicture
from drivers.cameras.genicam.opened_device import GenICamCamera
from tests.drivers.cameras.genicam_fake import FakeDevice, FakeLibrary, FakeOpenCamera

BAR_MS = 20.0
WIDTH, HEIGHT = 2448, 2048
PACE_S = 0.01
FORMATS = {"Mono8": (0x01080001, np.uint8), "Mono12": (0x01100005, "<u2")}


def daemon_with_camera(folder: str, pixel_format: str, pictures_per_s: float, ready: Any) -> None:
    """The daemon, and a camera whose pictures nobody waits for; none after the first at 0 pictures a second."""
    import uvloop

    uvloop.run(_serve(Path(folder), pixel_format, pictures_per_s, ready))


async def _serve(folder: Path, pixel_format: str, pictures_per_s: float, ready: Any) -> None:
    from tests.daemon.cell_under_test import serving, settings_for

    async with serving(settings_for(folder)) as bench:
        bench.server.prepare()  # as the daemon does before its first request
        camera = GenICamCamera(lambda _: _Large(pixel_format), parse_camera_address("genicam:S1"))
        camera.start()
        await camera.grab(0.0)
        ready.put(urlsplit(bench.url).port)
        if pictures_per_s == 0:
            await asyncio.Event().wait()
        loop, monitor = asyncio.get_running_loop(), bench.application.loop_monitor
        monitor.reset()
        taken, began_s = 0, loop.time()
        while True:
            await camera.grab(0.0)
            taken += 1
            if taken % 50 == 0:
                kept, rate = monitor.longest(), taken / (loop.time() - began_s)
                longest = f"longest turn of the loop {1e3 * kept.processor_s:.1f} ms of processor time"
                print(f"{rate:.1f} {pixel_format} pictures a second, {longest}", flush=True)
            await asyncio.sleep(max(0.0, began_s + taken / pictures_per_s - loop.time()))


class _Large(FakeLibrary):
    def __init__(self, pixel_format: str) -> None:
        super().__init__(FakeDevice())
        code, dtype = FORMATS[pixel_format]
        white = 255 if pixel_format == "Mono8" else 4095
        noise = np.random.default_rng(1).integers(0, white, (HEIGHT, WIDTH)).astype(dtype)
        self._picture = RawPicture(noise.view(np.uint8).reshape(-1), code, WIDTH, HEIGHT)

    def open(self, camera: Any) -> FakeOpenCamera:
        opened = super().open(camera)
        vars(opened)["next_picture"] = lambda limit_s: self._picture
        return opened


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=2000, help="of each row, one every 10 ms")
    parser.add_argument("--pictures", type=float, default=30.0, help="a second")
    options = parser.parse_args()
    for pixel_format, pictures in (("Mono8", 0.0), ("Mono8", options.pictures), ("Mono12", options.pictures)):
        folder = Path(tempfile.mkdtemp(prefix="handeyed-camera-"))
        try:
            with process(daemon_with_camera, str(folder), pixel_format, pictures) as (port, _):
                took_ms = [_paced_ms(port) for _ in range(options.requests)]
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        beside = f"beside {pixel_format} of {WIDTH} x {HEIGHT}" if pictures else "without pictures"
        load, *_ = os.getloadavg()
        print(row(f"GET /health {beside}", took_ms), f"(bar: < {BAR_MS:g}; {load:.1f} programs at work)", flush=True)
    return 0


def _paced_ms(port: int) -> float:
    took_ms = health_ms(port)
    time.sleep(max(0.0, PACE_S - took_ms / 1000))
    return took_ms


if __name__ == "__main__":
    sys.exit(main())
