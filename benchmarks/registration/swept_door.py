"""A whole door swept by the mock's line profiler at 100 mm/s, through its socket and the daemon: deviation from truth.

`python -m benchmarks.registration.swept_door`

Robot poses over the CB link 40 ms apart, profiles over the sensor's protocol with a clock of its own, the true X. Lanes
that the arm cannot reach without turning over are named.
"""

import asyncio
import tempfile
from pathlib import Path

import numpy as np

from tests.stories.swept_door import swept_cell

LANES_MM = (-300.0, -150.0, 0.0, 150.0, 300.0)
HALVES_MM = ((-550.0, 0.0), (0.0, 550.0))


async def sweep_door(folder: Path) -> None:
    """Sweep each half of each lane; print each, then all."""
    squares, points = [], 0
    async with swept_cell(folder) as cell:
        for y in LANES_MM:
            for begin, end in HALVES_MM:
                name = f"y {y:5.0f}, x {begin:5.0f} to {end:4.0f} mm"
                try:
                    sweep = await cell.sweep(y, begin, end)
                except AssertionError:
                    print(f"{name}: out of reach", flush=True)
                    continue
                squares.append(cell.distances_mm(sweep) ** 2)
                points += sweep.points
                found = f"{sweep.points:9,} points, {np.sqrt(squares[-1].mean()):.3f} mm RMS"
                print(f"{name}: {sweep.state}, {found}", flush=True)
    print(f"all: {points:,} points, {np.sqrt(np.concatenate(squares).mean()):.3f} mm RMS (bar 0.3)")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="handeyed-sweeps-") as folder:
        asyncio.run(sweep_door(Path(folder)))
