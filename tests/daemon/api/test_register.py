"""POST /register: clouds in and out over real sockets, larger than every buffer between."""

import asyncio
import contextlib
import io
import socket
import struct
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from calibration.transforms import map_points
from daemon.api.streaming.spool import MEMORY_BYTES
from daemon.http.connection_limiter import ConnectionLimiter, HttpLimits
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import LAZ, OCTETS, PLY, POSE, cloud, in_base, laz_of
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of, points_of
from tests.support.waiting import LIMIT_S, eventually


async def test_a_cloud_comes_back_in_the_base_frame(bench: Bench) -> None:
    await apply_calibration(bench)
    points = cloud(1000)
    answer = await bench.client.post("/register", params={"pose": POSE}, content=ply_of(points), headers=PLY)
    assert answer.status_code == 200, answer.text
    assert answer.headers["handeyed-calibration"] == "cal-1"
    np.testing.assert_allclose(points_of(answer.content), in_base(points), atol=1e-3)


async def test_metres_become_millimetres(bench: Bench) -> None:
    await apply_calibration(bench)
    points = cloud(10)
    answer = await bench.client.post(
        "/register",
        params={"pose": POSE, "unit": "m"},
        content=(points / 1000).astype("<f4").tobytes(),
        headers=OCTETS,
    )
    moved = np.frombuffer(answer.content, "<f4").reshape(-1, 3)
    np.testing.assert_allclose(moved, in_base(points), atol=1e-3)


async def test_pose_now_is_where_the_arm_stands(bench: Bench) -> None:
    await apply_calibration(bench)
    points = cloud(10)
    answer = await bench.client.post("/register", params={"pose": "now"}, content=ply_of(points), headers=PLY)
    expected = map_points(bench.robot.base_T_flange @ FLANGE_T_CAMERA, points)
    np.testing.assert_allclose(points_of(answer.content), expected, atol=1e-3)


@pytest.mark.parametrize("count", [10, 100_000], ids=["small", "larger than a body that is read before the answer"])
@pytest.mark.parametrize("kind", ["octets", "LAZ"])
async def test_a_unit_that_cannot_be_is_refused_without_force(bench: Bench, count: int, kind: str) -> None:
    await apply_calibration(bench)
    points = np.abs(cloud(count)) + 50.0
    content, headers = (laz_of(points), LAZ) if kind == "LAZ" else (points.astype("<f4").tobytes(), OCTETS)
    asked = {"pose": POSE, "unit": "m"}
    refused = await bench.client.post("/register", params=asked, content=content, headers=headers)
    assert refused.status_code == 422
    assert "every point is farther than 20 m" in refused.json()["detail"]
    taken = await bench.client.post("/register", params={**asked, "force": "true"}, content=content, headers=headers)
    assert taken.status_code == 200


@pytest.mark.parametrize(
    ("known", "says"),
    [
        ({"scanner": {"range_mm": [5_000.0, 9_000.0]}}, "every point is nearer than 2500 mm"),
        ({"robot": {"model": "IRB 1200-5/0.9"}}, "every point is farther than 1.8"),
    ],
    ids=["the scanner's range", "the arm's reach"],
)
async def test_a_unit_is_held_against_what_scanner_and_arm_reach(
    tmp_path: Path, known: dict[str, dict[str, Any]], says: str
) -> None:
    points = np.abs(cloud(10)) + (2_000.0 if "robot" in known else 50.0)
    async with serving(settings_for(tmp_path, **known)) as bench:
        await apply_calibration(bench)
        content, asked = points.astype("<f4").tobytes(), {"pose": POSE}
        refused = await bench.client.post("/register", params=asked, content=content, headers=OCTETS)
        assert (refused.status_code, says in refused.json()["detail"]) == (422, True), refused.text
        asked["force"] = "true"
        taken = await bench.client.post("/register", params=asked, content=content, headers=OCTETS)
        assert taken.status_code == 200


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.full((5, 3), np.nan)], ids=["none", "not finite"])
async def test_a_cloud_without_points_is_said(bench: Bench, points: np.ndarray) -> None:
    await apply_calibration(bench)
    content = points.astype("<f4").tobytes()
    answer = await bench.client.post("/register", params={"pose": POSE}, content=content, headers=OCTETS)
    assert (answer.status_code, answer.headers.get("handeyed-warning")) == (200, "no-points")


async def test_an_npz_comes_back_as_a_ply(bench: Bench) -> None:
    await apply_calibration(bench)
    points, body = cloud(10), io.BytesIO()
    np.savez(body, points=points.astype("<f4"))
    headers = {"Content-Type": "application/x-npz"}
    answer = await bench.client.post("/register", params={"pose": POSE}, content=body.getvalue(), headers=headers)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/x-ply"), answer.text
    np.testing.assert_allclose(points_of(answer.content), in_base(points), atol=1e-3)


@pytest.mark.slow
async def test_a_client_that_sends_everything_before_it_reads_gets_50_mb_back(bench: Bench) -> None:
    """httpx, requests and most others: without a spool both ends would wait for each other for ever."""
    await apply_calibration(bench)
    points = cloud(4_200_000)
    content = points.astype("<f4").tobytes()
    assert len(content) > 50_000_000 > 10 * MEMORY_BYTES
    answer = await bench.client.post("/register", params={"pose": POSE}, content=content, headers=OCTETS)
    assert answer.status_code == 200
    assert len(answer.content) == len(content)
    moved = np.frombuffer(answer.content, "<f4").reshape(-1, 3)
    np.testing.assert_allclose(moved, in_base(points), atol=2e-3)


async def test_a_client_that_reads_while_it_sends_gets_the_first_points_before_it_sent_the_last(bench: Bench) -> None:
    await apply_calibration(bench)
    content = cloud(2_000_000).astype("<f4").tobytes()
    reader, writer = await asyncio.open_connection(urlsplit(bench.url).hostname, urlsplit(bench.url).port)
    head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
    writer.write(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content[:1_200_000])
    answer = await reader.readuntil(b"\r\n\r\n")
    first = await reader.readexactly(12)
    writer.write(content[1_200_000:])
    rest = await reader.readexactly(len(content) - 12)
    writer.close()
    assert b"200" in answer.split(b"\r\n")[0]
    moved = np.frombuffer(first + rest, "<f4").reshape(-1, 3)
    np.testing.assert_allclose(moved, in_base(cloud(2_000_000)), atol=2e-3)


async def test_two_clouds_and_a_question_sent_at_once_are_answered_in_turn(bench: Bench) -> None:
    """The first cloud's body passes by the parser, which reads the second request from its first byte on."""
    await apply_calibration(bench)
    clouds = [cloud(100_000, seed=seed) for seed in (1, 2)]
    requests = b""
    for points in clouds:
        head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
        content = points.astype("<f4").tobytes()
        requests += f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content
    reader, writer = await asyncio.open_connection(urlsplit(bench.url).hostname, urlsplit(bench.url).port)
    writer.write(requests + b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
    for points in clouds:
        assert b"200" in (await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)).split(b"\r\n")[0]
        moved = np.frombuffer(await reader.readexactly(12 * len(points)), "<f4").reshape(-1, 3)
        np.testing.assert_allclose(moved, in_base(points), atol=2e-3)
    assert b"200" in (await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)).split(b"\r\n")[0]
    writer.close()


@pytest.mark.slow
async def test_a_client_that_never_reads_its_answer_is_cut_off_and_leaves_nothing(tmp_path: Path) -> None:
    """All of it is taken; what memory does not hold waits in a file; then nothing moves, and the connection ends."""
    impatient = ConnectionLimiter(HttpLimits(idle_s=5.0))
    async with serving(settings_for(tmp_path), door=impatient) as bench:
        await apply_calibration(bench)
        body = struct.pack("<3f", 0, 0, 500) * 2_000_000
        head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
        url = urlsplit(bench.url)
        with socket.create_connection((url.hostname, url.port)) as client:
            client.setblocking(False)
            loop = asyncio.get_running_loop()
            await loop.sock_sendall(client, f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body)
            await eventually(lambda: not bench.server.server_state.connections)
            received = 0
            with contextlib.suppress(ConnectionResetError):
                async with asyncio.timeout(LIMIT_S):
                    while piece := await loop.sock_recv(client, 1 << 20):
                        received += len(piece)
        assert received < len(body), "what the sockets held, and no more"
        assert (await bench.client.get("/health")).status_code == 200
        assert not [file for file in bench.application.store.folder.rglob("*") if file.stat().st_size >= len(body) // 2]


@pytest.mark.parametrize(
    ("content", "headers", "status", "code"),
    [
        (ply_of(cloud(100))[:-7], PLY, 422, "cloud-truncated"),
        (ply_of(cloud(100)) + b"x", PLY, 422, "cloud-too-long"),
        (ply_of(cloud(200_000))[:-7], PLY, 422, "cloud-truncated"),
        (cloud(200_000).astype("<f4").tobytes()[:-1], OCTETS, 422, "cloud-truncated"),
        (b"no cloud at all\n" * 10, PLY, 422, "cloud-malformed"),
        (b"", PLY, 422, "cloud-truncated"),
        (b"{}", {"content-type": "application/json"}, 415, "unknown-media-type"),
        (b"x", {}, 415, "unknown-media-type"),
    ],
)
async def test_what_is_no_whole_cloud_is_reported(
    bench: Bench, content: bytes, headers: dict[str, str], status: int, code: str
) -> None:
    await apply_calibration(bench)
    answer = await bench.client.post("/register", params={"pose": POSE}, content=content, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert answer.json()["fix"]


@pytest.mark.parametrize(
    "pose", ["1,2,3", "a,b,c,d,e,f,g", "nan,0,0,1,0,0,0", "inf,0,0,1,0,0,0", "0,0,0,0.9,0,0,0", ""]
)
async def test_a_pose_that_is_none_is_refused(bench: Bench, pose: str) -> None:
    await apply_calibration(bench)
    answer = await bench.client.post("/register", params={"pose": pose}, content=ply_of(cloud(1)), headers=PLY)
    assert answer.status_code == 422
    assert answer.json()["problems"][0]["place"].startswith("query.pose") or "query.pose" in answer.json()["detail"]


async def test_without_a_calibration_nothing_is_registered(bench: Bench) -> None:
    answer = await bench.client.post("/register", params={"pose": POSE}, content=ply_of(cloud(1)), headers=PLY)
    assert (answer.status_code, answer.json()["code"]) == (409, "no-calibration")


async def test_a_cloud_damaged_in_its_middle_has_an_answer_without_an_end(tmp_path: Path) -> None:
    """Sent in chunks, no length can be compared beforehand: the client must still not take it for whole."""

    async def torn() -> object:
        yield ply_of(cloud(500_000))[:-7]

    async with serving(settings_for(tmp_path)) as bench:
        await apply_calibration(bench)
        with pytest.raises(Exception, match=r"(?i)peer closed|incomplete|disconnected"):
            await bench.client.post("/register", params={"pose": POSE}, content=torn(), headers=PLY)
        assert (await bench.client.get("/health")).status_code == 200


async def test_a_moved_ply_names_its_frame_after_comments_that_no_longer_hold(bench: Bench) -> None:
    await apply_calibration(bench)
    content = ply_of(cloud(20)).replace(b"element", b"comment scanner frame, mm\nelement", 1)
    answer = await bench.client.post("/register", params={"pose": POSE}, content=content, headers=PLY)
    lines = answer.content[: answer.content.index(b"end_header")].splitlines()
    assert lines.index(b"comment scanner frame, mm") < lines.index(
        b"comment handeyed: frame base, lengths mm, calibration cal-1"
    )
    np.testing.assert_allclose(points_of(answer.content), in_base(cloud(20)), atol=1e-3)


async def test_laz_comes_back_as_laz(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench)
    points = cloud(20_000)
    answer = await bench.client.post("/register", params={"pose": POSE}, content=laz_of(points), headers=LAZ)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == LAZ["content-type"]
    import laspy

    theirs = laspy.read(io.BytesIO(answer.content))
    np.testing.assert_allclose(theirs.xyz, in_base(points), rtol=0, atol=2e-3)
    assert np.array_equal(np.asarray(theirs.intensity), np.arange(20_000) % 60_000)
    assert bench.application.metrics.registered_points == 20_000
    assert not list((tmp_path / "store" / "scans").rglob("*.laz"))


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
async def test_laz_cut_short_is_refused_and_leaves_nothing(bench: Bench, share: float) -> None:
    await apply_calibration(bench)
    content = laz_of(cloud(20_000))
    part = content[: int(share * len(content))]
    answer = await bench.client.post("/register", params={"pose": POSE}, content=part, headers=LAZ)
    assert answer.status_code == 422, answer.text
    assert answer.json()["code"] == "cloud-truncated", answer.text
    assert "again" in answer.json()["fix"]
    assert not list(bench.application.store.folder.rglob("*upload*"))


@pytest.mark.parametrize("pose", ["1e308,0,0,1,0,0,0", "0,-1000001,0,1,0,0,0", "0,0,1e999,1,0,0,0"])
async def test_a_pose_farther_than_a_kilometre_is_refused(bench: Bench, pose: str) -> None:
    await apply_calibration(bench)
    scan = (await bench.client.post("/scans")).headers["location"]
    for path in ("/register", f"{scan}/views"):
        refused = await bench.client.post(f"{path}?unit=mm&pose={pose}", content=ply_of(cloud(10)), headers=PLY)
        assert (refused.status_code, refused.json()["code"]) == (422, "request-refused")


@pytest.mark.parametrize(
    ("magic", "name"), [(b"ASTM-E57", "E57"), (b"LASF", "LAS"), (b"ply\n", "PLY"), (b"PK\x03\x04", "NPZ")]
)
@pytest.mark.parametrize("split", [0, 3, 4800])
async def test_octets_that_begin_as_another_format_are_refused(
    bench: Bench, magic: bytes, name: str, split: int
) -> None:
    await apply_calibration(bench)
    content = magic.ljust(4800, b"\1")

    async def pieces() -> AsyncIterator[bytes]:
        for piece in (content[:split], content[split:]):
            if piece:
                yield piece

    answer = await bench.client.post("/register", params={"pose": POSE}, content=pieces(), headers=OCTETS)
    assert (answer.status_code, answer.json()["code"]) == (422, "cloud-malformed"), answer.text
    assert name in answer.text


async def test_las_is_taken_under_its_registered_type(bench: Bench) -> None:
    await apply_calibration(bench)
    headers = {"content-type": "application/vnd.las"}
    answer = await bench.client.post(
        "/register", params={"pose": POSE}, content=laz_of(cloud(50), compress=False), headers=headers
    )
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == LAZ["content-type"]
