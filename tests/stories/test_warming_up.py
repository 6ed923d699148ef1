"""A camera that has just been switched on: the first calibration says so, the one after it has warmed up does not."""

from dataclasses import replace
from pathlib import Path

import pytest

from mock_robot.truth.truth import CameraWarming
from tests.stories.plant import TEXT, plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

WARMING = CameraWarming(pictures=3.0, px_per_k=(0.2, -0.15))


async def test_the_first_calibration_after_switching_on(tmp_path: Path) -> None:
    truth = replace(small_pictures(7), warming=WARMING)
    async with plant(tmp_path, truth=truth, calibration={"policy": "operator"}) as story:
        ask = story.operator.client
        runs = [(await ask.post("/calibrate", params={"wait": LIMIT_S})).json() for _ in range(2)]
        cold, warm = [(await ask.get(run["links"]["calibration"])).json() for run in runs]
        views = (await ask.get(f"/runs/{runs[0]['id']}/views")).json()["views"]
        words = (await ask.get(runs[0]["links"]["calibration"], headers=TEXT)).text

        (finding,) = [one for one in cold["verdict"]["findings"] if one["code"] == "still-warming"]
        assert finding["severity"] == "warning"
        assert "wait 30 minutes" in words
        assert not [one for one in warm["verdict"]["findings"] if one["code"] == "still-warming"]

        temperatures = [view["camera_temperature_c"] for view in views]
        assert temperatures == sorted(temperatures)
        assert temperatures[-1] - temperatures[0] > 10.0
        assert [view["camera_temperature_c"] for view in cold["views"]] == temperatures

        verified = (await ask.post(f"{runs[1]['links']['calibration']}/apply", json={"applied_by": "Ann"})).status_code
        assert verified == 200
        await ask.post("/verify", params={"wait": LIMIT_S})
        (point,) = (await ask.get("/drift")).json()["points"]
        assert point["camera_temperature_c"] == pytest.approx(WARMING.warm_c, abs=1.0)
