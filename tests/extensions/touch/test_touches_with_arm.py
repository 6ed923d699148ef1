"""Touches where the errors of an arm are active."""

import pytest

from tests.daemon.calibrations import apply_with_arm
from tests.daemon.cell_under_test import Bench
from tests.extensions.touch.touches import TIP, json_of, touching


async def test_tip_and_camera_are_compared_on_the_same_arm(bench: Bench) -> None:
    """An arm whose axis 2 is 5 mm further out: both find a point about so much further out."""
    await apply_with_arm(bench, link_1_tx=5.0)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]
    assert run["result"]["verification"]["arm"] == "as-built"
    body = {"tip": TIP, "verification": run["id"], "touches": [{"id": 0, "base_T_flange": json_of(touching(0))}]}
    answer = await bench.client.post("/touch", json=body)
    assert answer.status_code == 201, answer.text
    assert answer.json()["result"]["largest_mm"] < 2.0


@pytest.mark.parametrize(("sigma_rad", "least_mm", "most_mm"), [(0.0, 0.0, 2.0), (0.1, 5.0, 500.0)])
async def test_a_touch_is_judged_with_what_is_not_known_of_the_arm(
    bench: Bench, sigma_rad: float, least_mm: float, most_mm: float
) -> None:
    """Verified from poses in which axis 2 lies otherwise than where the tip touches."""
    await apply_with_arm(bench, zero_2_sigma_rad=sigma_rad)
    await bench.verify()
    run = (await bench.client.get("/runs")).json()["runs"][0]
    body = {"tip": TIP, "verification": run["id"], "touches": [{"id": 0, "base_T_flange": json_of(touching(0))}]}
    (point,) = (await bench.client.post("/touch", json=body)).json()["result"]["points"]
    assert least_mm < point["claimed_mm"] < most_mm
