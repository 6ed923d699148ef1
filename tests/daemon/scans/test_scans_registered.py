"""Scans that are registered: fitted in the background, reported, answered as the caller prefers."""

import asyncio
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from registration.io.formats.ply import parse_header
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import LAZ, OCTETS, PLY, POSES, cloud, in_base, laz_of
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of, points_of
from tests.daemon.scans.scan_folders import a_scan, names
from tests.support.waiting import LIMIT_S

FLANGES = [
    transform(rotation_from_vector([np.pi, 0.1 * k, 0.05 * k]), [800.0 + 20 * k, -10.0 * k, 700]) for k in range(3)
]
ERRORS_MM = ([0.0, 0, 0], [0.2, -0.1, 0.3], [-0.2, 0.2, -0.25])


def surface() -> Array:
    """A bumpy patch in base that fixes all six directions."""
    x, y = np.meshgrid(np.linspace(-120, 120, 70), np.linspace(-120, 120, 70))
    z = 14 * np.sin(x / 25) * np.cos(y / 30) + 0.0008 * x * y
    return np.column_stack([x.ravel() + 850, y.ravel(), z.ravel() + 250])


async def send_views(bench: Bench, link: str, views: int = 3) -> None:
    """The patch seen from each flange pose, the pose told with the robot's error."""
    for flange, error in list(zip(FLANGES, ERRORS_MM, strict=True))[:views]:
        content = ply_of(map_points(inverse(flange @ FLANGE_T_CAMERA), surface()))
        told = PoseDocument.of(transform(flange[:3, :3], flange[:3, 3] + error))
        pose = ",".join(map(str, (*told.translation_mm, *told.quaternion_wxyz)))
        answer = await bench.client.post(link, params={"pose": pose}, content=content, headers=PLY)
        assert answer.status_code == 201, answer.text


async def report_of(bench: Bench, scan: dict[str, Any], **query: Any) -> dict[str, Any]:
    answer = await bench.client.get(scan["links"]["report"], params=query)
    assert answer.status_code == 200, answer.text
    report: dict[str, Any] = answer.json()
    return report


async def test_a_scan_asked_to_refine_does_so_while_views_come_and_reports_how_far_it_is(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench, refine=True)
    assert scan["refine"]
    await send_views(bench, scan["links"]["views"])
    report = await report_of(bench, scan, refine=True)
    assert len(report["views"]) == 3
    assert report["rms_mm"]["after"] < 0.5 * report["rms_mm"]["before"]
    assert all(view["correction"] for view in report["views"])
    told = await asyncio.wait_for(registrations_told(bench, views=3), LIMIT_S)
    assert {event["scan_id"] for event in told} == {scan["id"]}
    whole = [event for event in told if event["views"] == 3]
    stages = [(event["state"], event.get("views_read")) for event in whole]
    assert list(dict.fromkeys(stages)) == [
        ("reading", 0), ("reading", 1), ("reading", 2), ("registering", 3), ("finished", None),
    ]  # fmt: skip
    shares = [event["progress"] for event in whole]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)


async def registrations_told(bench: Bench, views: int) -> list[dict[str, Any]]:
    """What was told of registrations, to the end of the one of so many views."""
    told: list[dict[str, Any]] = []
    async for event in bench.application.events.listen(0):
        if event is not None and event.kind == "registration":
            told.append(event.data)
            if event.data["views"] == views and event.data["state"] in ("finished", "failed"):
                break
    return told


async def test_the_refined_cloud_lies_closer_to_the_surface_than_the_plain_one(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await send_views(bench, scan["links"]["views"])
    scatter = []
    for refine in (False, True):
        answer = await bench.client.get(scan["links"]["cloud"], params={"refine": refine})
        assert answer.status_code == 200, answer.text
        views = points_of(answer.content).reshape(3, -1, 3)
        scatter.append(float(np.std(views, axis=0).mean()))
    assert scatter[1] < 0.6 * scatter[0]


async def test_a_report_outlives_the_daemon_and_a_new_view_replaces_it(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        await apply_calibration(bench)
        scan = await a_scan(bench)
        await send_views(bench, scan["links"]["views"], 2)
        first = await report_of(bench, scan)
    async with serving(settings_for(tmp_path)) as bench:
        assert await report_of(bench, scan) == first
        await send_views(bench, scan["links"]["views"], 1)
        assert len((await report_of(bench, scan))["views"]) == 3


async def test_a_stored_report_that_is_damaged_is_made_anew(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await send_views(bench, scan["links"]["views"], 2)
    first = await report_of(bench, scan)
    (tmp_path / "scans" / scan["id"] / "registered.json").write_text('{"refined": tr')
    assert (await report_of(bench, scan))["views"] == first["views"]


async def test_who_does_not_wait_learns_where_to_ask_again(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await send_views(bench, scan["links"]["views"])
    answer = await bench.client.get(scan["links"]["cloud"], params={"refine": True, "wait": 0})
    assert (answer.status_code, answer.json()["state"]) == (202, "in progress")
    assert 0.0 <= answer.json()["progress"] < 1.0
    later = await bench.client.get(answer.headers["location"])
    assert later.json()["rms_mm"]["after"] is not None


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("*/*", "application/x-ply"),
        ("application/*", "application/x-ply"),
        ("application/octet-stream", "application/octet-stream"),
        ("application/json;q=0.5, application/pcd", "application/x-pcd"),
        ("application/json, */*;q=0.1", "application/json"),
        ("model/ply", "application/x-ply"),
        ("application/vnd.laszip", "application/vnd.laszip"),
    ],
)
async def test_a_cloud_is_answered_as_the_caller_prefers(tmp_path: Path, accept: str, media_type: str) -> None:
    if "las" in accept:
        pytest.importorskip("laspy")
    async with serving(settings_for(tmp_path)) as bench:
        await apply_calibration(bench)
        scan = await a_scan(bench)
        points = cloud(50)
        await bench.client.post(scan["links"]["views"], params={"pose": POSES[0]}, content=ply_of(points), headers=PLY)
        answer = await bench.client.get(scan["links"]["cloud"], headers={"accept": accept})
        assert (answer.status_code, answer.headers["content-type"]) == (200, media_type)
        expected = in_base(points, POSES[0])
        np.testing.assert_allclose(read(answer.content, media_type, tmp_path), expected, atol=4e-3)
    # Only now is it sure that the answer's own end has come: the file behind it is removed after its last byte.
    assert sorted(names(tmp_path / "scans" / scan["id"])) == ["scan.json", "view_000.ply"]


def read(content: bytes, media_type: str, folder: Path) -> Array:
    match media_type:
        case "application/x-ply":
            return points_of(content)
        case "application/json":
            return np.array(json.loads(content)["points"])
        case "application/vnd.laszip":
            import laspy

            (folder / "answer.laz").write_bytes(content)
            return np.array(laspy.read(folder / "answer.laz").xyz)
        case _:
            return np.frombuffer(content[-50 * 12 :], "<f4").reshape(-1, 3).astype(float)


async def test_what_no_cloud_is_answered_as_is_406_with_what_there_is(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    answer = await bench.client.get(scan["links"]["cloud"], headers={"accept": "image/png"})
    assert (answer.status_code, answer.json()["code"]) == (406, "not-acceptable")
    assert "application/x-ply" in answer.json()["fix"]


@pytest.mark.parametrize(("points", "status"), [(10_000, 200), (10_001, 413)])
async def test_only_small_clouds_travel_as_json(bench: Bench, points: int, status: int) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    content = cloud(points).astype("<f4").tobytes()
    await bench.client.post(scan["links"]["views"], params={"pose": POSES[0]}, content=content, headers=OCTETS)
    answer = await bench.client.get(scan["links"]["cloud"], headers={"accept": "application/json"})
    assert answer.status_code == status
    if status == 413:
        assert "application/octet-stream" in answer.json()["fix"]


async def test_a_merged_ply_names_its_frame_and_calibration(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await bench.client.post(scan["links"]["views"], params={"pose": POSES[0]}, content=ply_of(cloud(9)), headers=PLY)
    content = (await bench.client.get(scan["links"]["cloud"])).content
    header = parse_header(content, "merged")
    assert header is not None
    assert b"comment handeyed: frame base, lengths mm, calibration cal-1\n" in content[: header.length]


async def test_a_cloud_is_averaged_cleaned_and_given_normals_as_asked(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await send_views(bench, scan["links"]["views"])
    link = scan["links"]["cloud"]
    whole, averaged, view = [
        parse_header((await bench.client.get(link, params=query)).content, "answer")
        for query in ({}, {"voxel_mm": 5, "normals": True, "outliers": "statistical"}, {"view": 1})
    ]
    assert whole is not None and averaged is not None and view is not None
    assert whole.count == 3 * len(surface()) == 3 * (view.count or 0)
    assert 0.2 * (whole.count or 0) < (averaged.count or 0) < 0.6 * (whole.count or 0)
    assert {"nx", "ny", "nz"} <= set(averaged.layout.dtype.names or ())
    few = parse_header((await bench.client.get(link, params={"voxel_mm": 5, "max_points": 40})).content, "answer")
    assert few is not None and 0 < (few.count or 0) <= 40
    for query, status in (
        ({"view": 3}, 404),
        ({"max_points": 40}, 422),
        ({"normals": True}, 422),
        ({"voxel_mm": 0}, 422),
    ):
        refused = await bench.client.get(link, params=query)
        assert refused.status_code == status, refused.text
        assert refused.json()["fix"]


async def test_a_laz_view_is_kept_and_merged_with_others(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    await send_views(bench, scan["links"]["views"], 1)
    flange = FLANGES[1]
    pose = ",".join(map(str, (*PoseDocument.of(flange).translation_mm, *PoseDocument.of(flange).quaternion_wxyz)))
    content = laz_of(map_points(inverse(flange @ FLANGE_T_CAMERA), surface()))
    answer = await bench.client.post(scan["links"]["views"], params={"pose": pose}, content=content, headers=LAZ)
    assert answer.status_code == 201, answer.text
    merged = await bench.client.get(scan["links"]["cloud"], headers={"accept": OCTETS["content-type"]})
    points = np.frombuffer(merged.content, "<f4").reshape(-1, 3)[len(surface()) :]
    np.testing.assert_allclose(points, surface(), rtol=0, atol=2e-3)
