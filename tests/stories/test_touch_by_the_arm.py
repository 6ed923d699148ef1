"""A touch test by the arm: to a stand-off before each point, then by steps, each asked for; the rest is measured.

`pytest -s tests/stories/test_touch_by_the_arm.py` prints the figures of docs/checks.md.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import Array, map_points
from tests.stories.plant import Plant, plant, small_pictures
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

TIP_MM = np.array([4.0, -7.0, 190.0])
TIP_SIGMA_MM, TIP_OFF_MM = 0.05, np.array([0.03, -0.04, 0.05])
"""Of the tip's calibration: the stated standard deviation per axis, and its error."""
GAUGE_MM = 0.02
"""To which a gauge shows what is left between the tip and the point."""
TIP = {
    "flange_tip_mm": (TIP_MM + TIP_OFF_MM).tolist(),
    "covariance": (TIP_SIGMA_MM**2 * np.eye(3)).tolist(),
    "placing_sigma_mm": 0.1,
}
IDS = (0, 10, 70)
DOWN = [0.0, 0.0, -1.0]


def true_tip_mm(story: Plant) -> Array:
    """Where the tip really is in the base, (3,)."""
    return map_points(story.cell.cell.flange_at(story.cell.cell.clock()), TIP_MM[None])[0]


async def approaches(story: Plant, **body: Any) -> dict[str, Any]:
    asked = {"tip": TIP, "along": DOWN, **body}
    answer = await story.operator.client.post("/touch/approach", params={"wait": LIMIT_S}, json=asked)
    found: dict[str, Any] = answer.json()
    return found


async def test_three_points_are_touched_with_each_move_asked_for(tmp_path: Path) -> None:
    truth = small_pictures(7)
    async with plant(tmp_path, truth=truth) as story:
        ask = story.operator.client
        assert (await ask.post("/calibrate", params={"wait": LIMIT_S})).json()["state"] == "finished"
        verified = (await ask.post("/verify", params={"wait": LIMIT_S})).json()
        assert verified["state"] == "finished", verified["cause"]
        seen = {
            point["id"]: np.mean(point["base_mm"], axis=0) for point in verified["result"]["verification"]["points"]
        }
        point_mm = map_points(truth.base_T_target, truth.target.points_mm)

        test: dict[str, Any] = {}
        for identity in IDS:
            point = {"verification": verified["id"], "touch": {"id": identity}}
            before = story.cell.commanded_moves
            stood = await approaches(story, **point)
            assert stood["state"] == "finished", stood
            assert stood["result"]["touch"]["left_mm"] == pytest.approx(20.0, abs=0.3)
            assert 1 <= story.cell.commanded_moves - before <= 2
            moves = story.cell.commanded_moves
            for _ in range(3):
                stepped = await approaches(story, step_mm=5.0, **point)
                assert stepped["state"] == "finished", stepped
                moves += 1
                assert story.cell.commanded_moves == moves, "one move for each request"
            stepped = await approaches(story, step_mm=4.0, **point)
            left_mm = point_mm[identity] - true_tip_mm(story)
            assert stepped["result"]["touch"]["left_mm"] > 0.3
            assert left_mm[2] < 0.0, "the tip is before the point"
            measured = np.round(left_mm / GAUGE_MM) * GAUGE_MM
            body = {"touches": [{"id": identity, "miss_mm": measured.tolist()}], "tolerance_mm": 1.0}
            body |= {"adds_to": test["id"]} if test else {"tip": TIP, "verification": verified["id"]}
            judged = await ask.post("/touch", json=body)
            assert judged.status_code == 201, judged.text
            test = judged.json()
        assert not story.cell.controller.armed

        found = test["result"]
        for identity, point in zip(IDS, found["points"], strict=True):
            off_mm = np.linalg.norm(np.array(point["miss_mm"]) - (point_mm[identity] - seen[identity]))
            print(f"story: point {identity}: a miss of {point['length_mm']:.3f} mm, found to {off_mm:.3f} mm,",
                  f"U {point['expanded_mm']:.3f} mm")  # fmt: skip
            assert off_mm < point["expanded_mm"]
        assert found["agree"]

        last = await approaches(story, step_mm=5.0, verification=verified["id"], touch={"id": IDS[-1]})
        assert last["result"]["touch"]["left_mm"] == pytest.approx(0.0, abs=0.3), "as long as what was left"

        higher = await approaches(story, verification=verified["id"], touch={"id": IDS[0]})
        assert "beyond the point along the approach" in higher["detail"], "the board is tilted"
        back = await approaches(story, verification=verified["id"], touch={"id": IDS[-1]})
        assert back["state"] == "finished", back

        story.cell.inject_fault("robot-override-zero")  # the move begins, and the arm stands until somebody acts
        stood_mm = true_tip_mm(story)
        body = {"tip": TIP, "along": DOWN, "verification": verified["id"], "touch": {"id": IDS[0]}}
        run = (await ask.post("/touch/approach", json=body)).json()
        aborted = await ask.post(run["links"]["abort"])
        assert (aborted.status_code, aborted.json()["state"]) == (200, "aborted"), aborted.text
        moves = story.cell.commanded_moves
        story.cell.clear_faults()
        assert (await ask.get("/robot")).status_code == 200
        assert (story.cell.controller.armed, story.cell.moving, story.cell.commanded_moves) == (False, False, moves)
        np.testing.assert_allclose(true_tip_mm(story), stood_mm, atol=1e-9)
