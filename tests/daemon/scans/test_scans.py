"""Parts larger than one view."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.errors import DeviceTimeout
from registration.io.formats.ply import parse_header
from registration.scan_folder import read_scan
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, Parts, pose_json, serving, settings_for
from tests.daemon.clouds import OCTETS, PLY, POSES, cloud, in_base
from tests.daemon.fakes import Gate, ply_of, points_of, poses_around_the_target
from tests.daemon.scans.scan_folders import a_scan, names


async def test_views_sent_from_several_poses_become_one_cloud(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    first, second = cloud(3000), cloud(500)
    second[7] = np.nan
    for pose, content, headers, unit in (
        (POSES[0], ply_of(first), PLY, "mm"),
        (POSES[1], (second / 1000).astype("<f4").tobytes(), OCTETS, "m"),
    ):
        answer = await bench.client.post(
            scan["links"]["views"], params={"pose": pose, "unit": unit}, content=content, headers=headers
        )
        assert answer.status_code == 201, answer.text
    merged = await bench.client.get(scan["links"]["cloud"])
    assert merged.headers["handeyed-calibration"] == "cal-1"
    header = parse_header(merged.content, "merged")
    assert header is not None
    assert header.count == 3499
    expected = np.concatenate([in_base(first, POSES[0]), in_base(np.delete(second, 7, axis=0), POSES[1])])
    np.testing.assert_allclose(points_of(merged.content), expected, atol=2e-3)
    seen = (await bench.client.get(scan["links"]["self"])).json()
    assert [(view["file"], view["unit"]) for view in seen["views"]] == [
        ("view_000.ply", "mm"),
        ("view_001.f32", "m"),
    ]
    stored = [(tmp_path / "scans" / scan["id"] / view["file"]).stat().st_size for view in seen["views"]]
    kept = [(view["points"], view["bytes"], view["created_by"]) for view in seen["views"]]
    assert kept == [(3000, stored[0], "local"), (500, stored[1], "local")]
    assert (await bench.client.get("/scans")).json()["scans"][0]["views"] == seen["views"]
    assert len(read_scan(tmp_path / "scans" / scan["id"])) == 2
    assert sorted(names(tmp_path / "scans" / scan["id"])) == ["scan.json", "view_000.ply", "view_001.f32"]


async def test_a_new_scan_and_each_of_its_views_are_told_to_those_who_listen(bench: Bench) -> None:
    scan = await a_scan(bench)
    sent = {"params": {"pose": POSES[0]}, "content": ply_of(cloud(100)), "headers": PLY}
    assert (await bench.client.post(scan["links"]["views"], **sent)).status_code == 201
    told = []
    async for event in bench.application.events.listen(0, 0.0):
        if event is None:
            break
        if event.kind == "scan":
            told.append((event.data["scan_id"], event.data.get("view")))
    assert told == [(scan["id"], None), (scan["id"], 0)]


async def test_a_damaged_view_is_refused_and_leaves_nothing(bench: Bench, tmp_path: Path) -> None:
    scan = await a_scan(bench)
    answer = await bench.client.post(
        scan["links"]["views"], params={"pose": POSES[0]}, content=ply_of(cloud(100))[:-3], headers=PLY
    )
    assert (answer.status_code, answer.json()["code"]) == (422, "cloud-truncated")
    assert (await bench.client.get(scan["links"]["self"])).json()["views"] == []
    assert names(tmp_path / "scans" / scan["id"]) == []


async def test_a_view_may_be_an_npz(bench: Bench) -> None:
    await apply_calibration(bench)
    scan, points, body = await a_scan(bench), cloud(100), io.BytesIO()
    np.savez(body, points=points.astype("<f4").reshape(10, 10, 3), intensity=np.ones((10, 10)))
    sent = {"params": {"pose": POSES[0]}, "headers": {"Content-Type": "application/x-npz"}}
    view = await bench.client.post(scan["links"]["views"], content=body.getvalue(), **sent)
    assert (view.status_code, view.json()["points"]) == (201, 100), view.text
    merged = await bench.client.get(scan["links"]["cloud"])
    assert (merged.status_code, merged.headers["content-type"]) == (200, "application/x-ply")
    damaged = await bench.client.post(scan["links"]["views"], content=body.getvalue()[:-30], **sent)
    assert (damaged.status_code, damaged.json()["code"]) == (422, "cloud-malformed")


async def test_without_views_or_calibration_there_is_no_cloud(bench: Bench) -> None:
    scan = await a_scan(bench)
    assert (await bench.client.get(scan["links"]["cloud"])).json()["code"] == "no-calibration"
    await apply_calibration(bench)
    answer = await bench.client.get(scan["links"]["cloud"])
    assert (answer.status_code, answer.json()["code"]) == (409, "scan-empty")
    assert (await bench.client.get("/scans/none/cloud")).status_code == 404


async def test_the_daemons_scanner_fills_a_scan_where_the_arm_stands(bench: Bench) -> None:
    scan = await a_scan(bench)
    view = (await bench.client.post(scan["links"]["views"])).json()
    np.testing.assert_allclose(view["base_T_flange"]["translation_mm"], bench.robot.base_T_flange[:3, 3])
    assert not bench.robot.goals


async def test_a_capture_run_drives_the_arm_and_fills_the_scan(tmp_path: Path) -> None:
    poses = [pose_json(pose) for pose in poses_around_the_target(4)]
    async with serving(settings_for(tmp_path)) as bench:
        answer = await bench.client.post("/scans", json={"name": "door", "poses": poses})
        assert answer.status_code == 202
        run = await bench.run_over(answer.json()["run"]["links"]["self"])
        assert (run["state"], run["result"]["views"]) == ("finished", 4)
        scan = (await bench.client.get(run["links"]["scan"])).json()
        assert len(scan["views"]) == 4
        assert not bench.robot.armed


async def test_a_scanner_that_fails_fails_the_run(tmp_path: Path) -> None:
    parts = Parts()
    settings = settings_for(tmp_path, scanner={"poses": [pose_json(pose) for pose in poses_around_the_target(3)]})
    async with serving(settings, parts) as bench:

        async def late(newer_than_s: float) -> Any:
            raise DeviceTimeout("PhoXi 10.0.0.5", "no cloud within 60 s", "look at the projector")

        bench.scanner.scan = late  # type: ignore[method-assign]
        answer = await bench.client.post("/scans", params={"wait": 200}, json={"capture": True})
        run = answer.json()["run"]
        assert run["state"] == "failed"
        assert "no cloud within 60 s" in run["cause"]["what"]
        assert "controller" not in run["cause"]["what"]


async def test_while_a_run_is_in_progress_nobody_else_scans(tmp_path: Path) -> None:
    parts = Parts()
    parts.robot.before_move = gate = Gate(1)
    async with serving(settings_for(tmp_path), parts) as bench:
        scan = await a_scan(bench)
        run = (await bench.client.post("/calibrate")).json()
        await gate.reached.wait()
        answer = await bench.client.post(scan["links"]["views"])
        assert (answer.status_code, answer.json()["code"]) == (409, "cell-busy")
        assert run["id"] in answer.json()["holder"]
        gate.open.set()


@pytest.mark.parametrize("scanner", [None])
async def test_without_a_scanner_clouds_must_be_sent(tmp_path: Path, scanner: None) -> None:
    async with serving(settings_for(tmp_path, scanner=scanner)) as bench:
        scan = await a_scan(bench)
        for answer in (
            await bench.client.post(scan["links"]["views"]),
            await bench.client.post("/scans", json={"capture": True}),
        ):
            assert "no scanner" in answer.json()["detail"]
