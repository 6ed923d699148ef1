"""An axis loses its zero between two verifications: the chart names it, and not the camera."""

from pathlib import Path

import numpy as np
import pytest

from tests.stories.plant import TEXT, plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow


async def test_the_axis_that_lost_its_zero_is_named_with_its_chance(tmp_path: Path) -> None:
    async with plant(tmp_path, truth=small_pictures(7)) as story:
        ask = story.operator.client
        for path in ("/calibrate", "/verify", "/verify", "/verify"):
            run = (await ask.post(path, params={"wait": LIMIT_S})).json()
            assert run["state"] == "finished", run["cause"]
        (likeliest, *_) = (await ask.get("/drift")).json()["changes"]
        assert (likeliest["cause"], likeliest["axis"]) == ("nothing", None)

        story.cell.controller.arm.lost_rad[2] = np.radians(0.1)
        assert (await ask.post("/verify", params={"wait": LIMIT_S})).json()["state"] == "finished"
        (likeliest, *others) = (await ask.get("/drift")).json()["changes"]
        assert (likeliest["cause"], likeliest["axis"]) == ("axis-zero", 3), [likeliest, *others]
        assert likeliest["chance"] > 0.9
        assert likeliest["turned_deg"] == pytest.approx(0.1, rel=0.3)
        assert sum(one["chance"] for one in (likeliest, *others)) == pytest.approx(1.0, abs=1e-4)
        assert "axis 3 of the arm: its zero moved by " in (await ask.get("/drift", headers=TEXT)).text
        report = await ask.get("/drift/report", headers={"accept": "text/html"})
        assert "axis 3 of the arm" in report.text
