"""`python -m benchmarks.daemon.held_move [--holds N]`: how soon the arm stands when a held button is let go, or silent.

A daemon and the mock's arm in real time; a pose 400 mm away is gone to at 50 mm/s while words come every 0.1 s. After
70 mm the button is let go, or the words cease. Reported: time from that moment until the arm stands,
and how far it went meanwhile, the slowest of N each (bars: 200 ms and 400 ms, 20 mm).
"""

import argparse
import asyncio
import tempfile
import time
from pathlib import Path

import numpy as np

from daemon.cell.held_button import LEASE_S
from mock_robot.truth.truth import NO_NOISE, CellTruth
from tests.daemon.cell_under_test import pose_json
from tests.stories.plant import Plant, plant

HOLD, SAY_S, BEFORE_MM, FAR_MM = "held-by-a-benchmark", 0.1, 70.0, 400.0


async def stops(story: Plant, released: bool) -> tuple[float, float]:
    """Time until the arm stands, ms, and how far it went, mm, after the last word was sent or the release was."""
    client, cell = story.operator.client, story.cell.cell
    here = cell.flange_at(cell.clock())
    there = here.copy()
    there[2, 3] += FAR_MM if here[2, 3] < 700.0 else -FAR_MM
    run = (await client.post("/robot/jog", json={"to": pose_json(there), "hold": HOLD})).json()
    began_s = last_s = time.monotonic()
    while np.linalg.norm(cell.flange_at(cell.clock())[:3, 3] - here[:3, 3]) < BEFORE_MM:
        last_s = time.monotonic()
        await client.post(f"/runs/{run['id']}/hold", json={"hold": HOLD, "at_s": last_s - began_s})
        await asyncio.sleep(SAY_S)
    if released:
        last_s = time.monotonic()
        body = {"hold": HOLD, "at_s": last_s - began_s, "released": True}
        await client.post(f"/runs/{run['id']}/hold", json=body)
    first_mm = at_mm = cell.flange_at(cell.clock())[:3, 3]
    stood_s = last_s
    while story.cell.controller.armed:  # between two steps it stands, too
        await asyncio.sleep(0.002)
        if np.linalg.norm((now_mm := cell.flange_at(cell.clock())[:3, 3]) - at_mm) > 0.001:
            at_mm, stood_s = now_mm, time.monotonic()
    took_ms, went_mm = 1000 * (stood_s - last_s), float(np.linalg.norm(at_mm - first_mm))
    await story.operator.waits_for_the_end_of(run)
    return took_ms, went_mm


async def measure(holds: int) -> None:
    with tempfile.TemporaryDirectory(prefix="handeyed-held-") as folder:
        async with plant(Path(folder), time_scale=1.0, truth=CellTruth.from_seed(7, noise=NO_NOISE)) as story:
            for how, released in (("let go", True), (f"silent (lease {LEASE_S:g} s)", False)):
                measured = [await stops(story, released) for _ in range(holds)]
                took_ms, went_mm = np.array(measured).T
                print(f"{how}: stands after {np.median(took_ms):.0f} ms (median), {took_ms.max():.0f} ms"
                      f" at most; {went_mm.max():.1f} mm farther at most")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--holds", type=int, default=10)
    asyncio.run(measure(parser.parse_args().holds))
