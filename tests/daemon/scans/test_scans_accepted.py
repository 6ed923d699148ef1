"""POST /verify for a scanner: spheres and ball bars in several positions."""

import numpy as np
import pytest

from calibration.documents.numbers import number
from tests.daemon.cell_under_test import Bench
from tests.daemon.clouds import PLY, POSES
from tests.daemon.fakes import ply_of
from tests.daemon.scans.scan_folders import a_scan
from tests.registration.ball_bars import RADIUS_MM, SPACING_MM, ball, bar

BAR = {"radius_mm": RADIUS_MM, "spacing_mm": SPACING_MM}


async def scan_of(bench: Bench, *clouds: np.ndarray) -> str:
    scan = await a_scan(bench)
    for points in clouds:
        answer = await bench.client.post(
            scan["links"]["views"], params={"pose": POSES[0]}, content=ply_of(points), headers=PLY
        )
        assert answer.status_code == 201, answer.text
    return str(scan["id"])


async def test_a_ball_bar_in_three_positions_gives_probing_and_spacing_errors(bench: Bench) -> None:
    scan_id = await scan_of(bench, bar(1), bar(2, longer_mm=0.15), bar(3, larger_mm=0.05))
    answer = await bench.client.post("/verify", json={"scan_id": scan_id, "artefact": BAR})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert found["based_on"] == "based on VDI/VDE 2634-3 and ISO 10360-13"
    assert found["probing_size_mm"] == pytest.approx(0.1, abs=0.005)
    assert found["sphere_spacing_mm"] == pytest.approx(0.15, abs=0.005)
    assert found["probing_form_mm"] < 0.005
    assert [len(position["balls"]) for position in found["positions"]] == [2, 2, 2]
    stored = (await bench.client.get(answer.headers["location"])).json()
    assert (stored["acceptance"], stored["created_by"]) == (found, "local")
    assert (await bench.client.get("/acceptances")).json() == {"acceptances": [stored], "next": None, "damaged": []}
    (charted,) = (await bench.client.get("/drift")).json()["scanner"]
    assert (charted["id"], charted["sphere_spacing_mm"]) == (stored["id"], found["sphere_spacing_mm"])
    assert "spacing +0.15" in (await bench.client.get("/drift", headers={"accept": "text/plain"})).text
    report = await bench.client.get(f"/acceptances/{stored['id']}/report")
    assert (report.status_code, stored["id"] in report.text) == (200, True)
    assert number(stored["acceptance"]["probing_form_mm"], 4) in report.text


@pytest.mark.slow
async def test_a_position_without_the_artefact_is_named(bench: Bench) -> None:
    scan_id = await scan_of(bench, bar(1), ball(np.array([0.0, 0, 500]), 1))
    answer = await bench.client.post("/verify", json={"scan_id": scan_id, "artefact": BAR})
    assert (answer.status_code, answer.json()["code"]) == (422, "not-the-sphere")
    assert "position 1" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"scan_id": "none", "artefact": BAR}, 404),
        ({"scan_id": "none"}, 422),
        ({"artefact": BAR}, 422),
        ({"scan_id": "none", "artefact": {"radius_mm": -1}}, 422),
        ({"scan_id": "none", "artefact": BAR, "poses": []}, 422),
    ],
)
async def test_what_cannot_be_verified_is_reported(bench: Bench, body: dict[str, object], status: int) -> None:
    answer = await bench.client.post("/verify", json=body)
    assert answer.status_code == status
    assert answer.json()["fix"]
