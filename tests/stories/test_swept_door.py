"""A door swept over by a line profiler at 100 mm/s lies where it is."""

from pathlib import Path

import numpy as np
import pytest

from tests.stories.swept_door import swept_cell

BAR_MM = 0.3


@pytest.mark.slow
async def test_a_door_swept_at_100_mm_a_second_lies_within_0_3_mm_of_the_truth(tmp_path: Path) -> None:
    async with swept_cell(tmp_path) as cell:
        sweep = await cell.sweep(0.0, -300.0, -150.0)
        assert (sweep.state, sweep.failure, sweep.lost_profiles) == ("done", None, 0)
        distances = cell.distances_mm(sweep)
    rms_mm = float(np.sqrt(np.mean(distances**2)))
    print(f"{len(distances) * 10:,} points, {rms_mm:.3f} mm RMS")
    assert len(distances) > 1000
    assert rms_mm < BAR_MM
