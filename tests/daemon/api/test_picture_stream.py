"""GET /camera/stream: one reader for all, each picture with its own corners; a run's pictures and none beside them."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from daemon.api.live import picture_stream
from daemon.api.live.live_feed import MAX_LISTENERS
from daemon.api.live.picture_stream import BOUNDARY, PictureStream
from daemon.sessions.look import look_at
from drivers.errors import DeviceUnreachable
from drivers.interfaces import CameraFrame
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import BOARD, Gate, poses_around_the_target
from tests.support.waiting import LIMIT_S, eventually


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_stream, "FAST_S", 0.005)
    monkeypatch.setattr(picture_stream, "REST_S", 0.01)
    monkeypatch.setattr(picture_stream, "AFFORDABLE_S", LIMIT_S)


MAX_BYTES = 20_000
"""Of a picture 480 px wide: ten a second are 1.6 Mbit/s."""


@dataclass
class Heard:
    """A part: its headers, names in lower case, and its content."""

    headers: dict[str, str]
    content: bytes

    @property
    def number(self) -> int:
        return int(self.headers["handeyed-picture"])

    @property
    def look(self) -> dict[str, Any]:
        look: dict[str, Any] = json.loads(self.headers["handeyed-look"])
        return look


@dataclass
class Listening:
    """The parts of one listener, one after the other."""

    chunks: AsyncIterator[bytes]
    rest: bytes = field(default=b"")

    async def next(self) -> Heard:
        """The next part. Raises EOFError after the last one."""
        async with asyncio.timeout(LIMIT_S):
            while (end := self.rest.find(b"\r\n\r\n")) < 0 or len(self.rest) < self._until(end):
                self.rest += await anext(self.chunks, b"") or self._over()
        heard = Heard(headers_of(self.rest[:end]), self.rest[end + 4 : self._until(end)])
        self.rest = self.rest[self._until(end) :]
        return heard

    def _until(self, end: int) -> int:
        return end + 4 + int(headers_of(self.rest[:end])["content-length"])

    def _over(self) -> bytes:
        raise EOFError


def headers_of(head: bytes) -> dict[str, str]:
    pairs = (line.split(": ", 1) for line in head.decode().split("\r\n") if ": " in line)
    return {name.lower(): value for name, value in pairs}


@asynccontextmanager
async def listening(bench: Bench, **query: Any) -> AsyncIterator[Listening]:
    async with bench.client.stream("GET", "/camera/stream", params=query) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"] == f"multipart/x-mixed-replace; boundary={BOUNDARY.decode()}"
        yield Listening(answer.aiter_bytes())


def stream_of(bench: Bench) -> PictureStream:
    stream: PictureStream = bench.server._routes.state.picture_streams["camera"]
    return stream


def grey(content: bytes) -> Any:
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image


async def test_each_picture_has_its_number_its_age_and_the_corners_found_in_it(bench: Bench) -> None:
    poses, numbers = poses_around_the_target(3), []
    async with listening(bench, width=960) as heard:
        for pose in poses:
            bench.robot.base_T_flange = pose
            taken = bench.camera.pictures
            while (part := await heard.next()).number <= taken + 1:
                pass  # exposed before the arm had moved
            numbers.append(part.number)
            seen = look_at(CameraFrame(grey(part.content), 0.0), BOARD, "").detection
            assert seen is not None
            again = dict(zip(seen.ids.tolist(), seen.corners_px, strict=True))
            both = [(again[point], (u, v)) for point, u, v in part.look["corners"] if point in again]
            assert len(both) > 0.9 * part.look["of"] == 0.9 * len(BOARD.points_mm)
            assert max(np.linalg.norm(np.subtract(*pair)) for pair in both) < 0.5
            assert part.look["size"] == [640, 480]
            assert float(part.headers["handeyed-age-s"]) >= 0
    assert numbers == sorted(set(numbers))


async def test_where_a_search_takes_long_other_pictures_come_without(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(picture_stream, "AFFORDABLE_S", 0.0)
    async with listening(bench) as heard:
        for searched in (True, False, True):
            while ("handeyed-look" in (await heard.next()).headers) is not searched:
                pass


async def test_a_picture_is_as_wide_as_asked(bench: Bench) -> None:
    async with listening(bench) as usual, listening(bench, width=240) as narrow:
        part = await usual.next()
        assert (grey(part.content).shape, len(part.content) <= MAX_BYTES) == ((360, 480), True)
        assert grey((await narrow.next()).content).shape == (180, 240)
    assert (await bench.client.get("/camera/stream", params={"width": 481})).status_code == 422
    assert (await bench.client.get("/camera/stream", params={"camera": "nose"})).status_code == 404


async def test_all_listeners_share_the_pictures_and_nothing_is_taken_when_they_have_left(bench: Bench) -> None:
    async with listening(bench) as one, listening(bench) as other:
        numbers = {(await each.next()).number for each in (one, other) for _ in range(4)}
        assert max(numbers) <= bench.camera.pictures <= max(numbers) + 1
    stream = stream_of(bench)
    await eventually(lambda: not stream.listeners)
    await stream._next.read()  # one that was asked for before they left
    taken = bench.camera.pictures
    await stream._next.read()
    assert bench.camera.pictures == taken


async def test_a_slow_listener_gets_the_newest_picture(bench: Bench) -> None:
    slow = stream_of(bench).parts(480)
    async with listening(bench) as quick:
        await anext(slow)
        await anext(slow)
        while (newest := (await quick.next()).number) < 6:
            pass
        number = int(headers_of((await anext(slow)).split(b"\r\n\r\n")[0])["handeyed-picture"])
        assert number >= newest
    await slow.aclose()  # type: ignore[attr-defined]


async def test_during_a_run_its_pictures_come_and_none_is_taken_for_the_stream(bench: Bench) -> None:
    bench.robot.before_move = first = Gate(at_move=1)
    async with listening(bench) as heard:
        await heard.next()
        location = (await bench.client.post("/calibrate")).headers["location"]
        await first.reached.wait()
        before = bench.camera.pictures
        bench.robot.before_move = third = Gate(at_move=3)
        first.open.set()
        await third.reached.wait()
        while (part := await heard.next()).number < before + 2:
            assert part.number <= before or "handeyed-look" not in part.headers
        assert bench.camera.pictures == before + 2
        third.open.set()
        run = await bench.run_over(location)
        assert run["state"] == "finished"
        while "handeyed-look" not in (part := await heard.next()).headers:
            pass
        assert part.number > before + len(poses_around_the_target())


async def test_a_fault_is_said_once_and_pictures_come_again(bench: Bench) -> None:
    async with listening(bench) as heard:
        await heard.next()
        bench.camera.failing = DeviceUnreachable("camera", "it does not answer", "switch it on")
        while (part := await heard.next()).headers["content-type"] == "image/jpeg":
            pass
        assert part.headers["content-type"] == "application/problem+json"
        assert json.loads(part.content) | {"detail": "camera: it does not answer", "fix": "switch it on"} == json.loads(
            part.content
        )
        stream = stream_of(bench)
        for _ in range(3):
            await stream._next.read()
        taken, bench.camera.failing = bench.camera.pictures, None
        assert (await heard.next()).number > taken


async def test_the_end_of_the_daemon_ends_it(bench: Bench) -> None:
    async with listening(bench) as heard:
        await heard.next()
        bench.application.begin_stop("a test")
        with pytest.raises(EOFError):
            while True:
                await heard.next()


async def test_one_address_may_listen_so_often(bench: Bench) -> None:
    async with httpx.AsyncClient(base_url=bench.url, limits=httpx.Limits()) as client, AsyncExitStack() as stack:
        asked = [client.stream("GET", "/camera/stream") for _ in range(MAX_LISTENERS // 2)]
        for each in asked:
            answer = await stack.enter_async_context(each)
            assert answer.status_code == 200
        refused = await bench.client.get("/camera/stream")
        assert (refused.status_code, refused.json()["code"]) == (503, "too-many-listeners")
    await eventually(lambda: not stream_of(bench).listeners)
    async with listening(bench) as heard:
        await heard.next()
