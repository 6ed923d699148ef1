"""What every camera driver does: HTTP snapshot, OpenCV capture, folder."""

import asyncio
import contextlib
import socket
import ssl
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
import trustme

from drivers.cameras.image_files import FolderCamera, HttpCamera
from drivers.cameras.video_camera import VideoCamera
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer
from drivers.interfaces import Camera, CaptureSettings
from tests.drivers.http_devices import Answer, http_device
from tests.support.waiting import LIMIT_S, eventually, patiently

SIZE = (64, 48)


def picture(shade=90):
    rows, columns = np.mgrid[0:48, 0:64]
    return np.dstack([rows * 2, columns * 2, np.full((48, 64), shade)]).astype(np.uint8)


def png(shade=90):
    return cv2.imencode(".png", picture(shade))[1].tobytes()


@dataclass
class Scene:
    """A camera driver, and how to make its device show a picture of a shade, or nothing new."""

    camera: Camera
    shows: object
    goes_away: object


@contextlib.contextmanager
def http_scene(tmp_path, **options):
    with http_device(Answer(png())) as device:
        camera = HttpCamera(device.url, **options)

        def shows(shade):
            device.answer = Answer(png(shade))

        def stands_still():
            device.answer = Answer(device.answer.content, headers={"X-Taken-At-Age-S": "3600"})

        yield Scene(camera, shows, stands_still)


@contextlib.contextmanager
def folder_scene(tmp_path, **options):
    ending, shade = threading.Event(), [90]

    def write_for_ever():
        number = 0
        while not ending.wait(0.05):
            number += 1
            temporary = tmp_path / f"{number:04}.png.tmp"
            temporary.write_bytes(png(shade[0]))
            temporary.rename(tmp_path / f"{number:04}.png")

    writer = threading.Thread(target=write_for_ever)
    writer.start()
    camera = FolderCamera(tmp_path, **options)

    def shows(new):
        shade[0] = new

    def stands_still():
        ending.set()
        writer.join()

    try:
        yield Scene(camera, shows, stands_still)
    finally:
        stands_still()


@contextlib.contextmanager
def video_scene(tmp_path, **options):
    path = tmp_path / "shades.avi"
    write_video(path)
    camera = VideoCamera(str(path), **options)

    def stands_still():
        path.unlink()

    yield Scene(camera, lambda shade: None, stands_still)


def write_video(path: Path, frames=12):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25.0, SIZE)
    assert writer.isOpened()
    for _ in range(frames):
        writer.write(picture())
    writer.release()


SCENES = {"http": http_scene, "folder": folder_scene, "video": video_scene}
each_camera = pytest.mark.parametrize("kind", SCENES)


@contextlib.asynccontextmanager
async def scene_of(kind, tmp_path, limit_s=LIMIT_S, **options):
    with SCENES[kind](tmp_path, limit_s=limit_s, **options) as scene:
        scene.camera.start()
        try:
            yield scene
        finally:
            await scene.camera.close()


@each_camera
async def test_a_fresh_picture_with_its_time(kind, tmp_path):
    async with scene_of(kind, tmp_path) as scene:
        camera: Camera = scene.camera
        asked_at_s = time.monotonic()
        frame = await camera.grab(asked_at_s)
        assert asked_at_s < frame.taken_at_s <= time.monotonic()
        assert frame.image.dtype == np.uint8
        np.testing.assert_allclose(frame.image.astype(int), picture().astype(int), atol=0 if frame.encoded else 12)
        assert camera.link.connected


@each_camera
async def test_each_picture_is_fresher_than_the_one_before(kind, tmp_path):
    async with scene_of(kind, tmp_path) as scene:
        times_s = [time.monotonic()]
        for _ in range(3):
            times_s.append((await scene.camera.grab(times_s[-1])).taken_at_s)
        assert times_s == sorted(set(times_s))


@pytest.mark.parametrize("kind", ["http", "folder"])
async def test_what_it_shows_now_and_not_what_it_showed_before(kind, tmp_path):
    async with scene_of(kind, tmp_path) as scene:
        await scene.camera.grab(0.0)
        scene.shows(200)
        frame = await scene.camera.grab(time.monotonic())
        assert frame.image[0, 0, 2] == 200
        assert frame.encoded == png(200)


@each_camera
async def test_a_stale_picture_is_never_handed_out(kind, tmp_path):
    async with scene_of(kind, tmp_path, limit_s=0.3) as scene:
        await patiently(lambda: scene.camera.grab(0.0))
        scene.goes_away()
        later_s = time.monotonic() + 0.7
        with pytest.raises((DeviceTimeout, DeviceUnreachable)):
            await scene.camera.grab(later_s)


@each_camera
async def test_another_size_than_the_intrinsics_is_refused(kind, tmp_path):
    async with scene_of(kind, tmp_path, image_size=(640, 480), limit_s=0.8) as scene:
        with pytest.raises(GarbledAnswer, match="64×48, expected 640×480"):
            await patiently(lambda: scene.camera.grab(0.0))


@each_camera
async def test_the_link_is_down_before_and_after(kind, tmp_path):
    async with scene_of(kind, tmp_path) as scene:
        await scene.camera.grab(0.0)
    assert scene.camera.link.detail == "closed"
    assert not scene.camera.link.connected


ABSENT = {
    "http": lambda path: HttpCamera("http://127.0.0.1:9/now", limit_s=0.2),
    "folder": lambda path: FolderCamera(path / "none", limit_s=0.2),
    "video file": lambda path: VideoCamera(str(path / "none.avi"), limit_s=0.2),
    "video device": lambda path: VideoCamera(77, limit_s=0.2),
}


@pytest.mark.parametrize("make", ABSENT.values(), ids=ABSENT.keys())
async def test_a_camera_that_is_not_there(make, tmp_path, capfd):
    camera = make(tmp_path)
    camera.start()
    with pytest.raises(DeviceUnreachable) as unreachable:
        await camera.grab(0.0)
    assert len(unreachable.value.fix) > 10
    assert not camera.link.connected
    await camera.close()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("stated", "capture"),
    [("41.5", CaptureSettings(8, temperature_c=41.5)), ("warm", None), ("nan", None)],
)
async def test_a_temperature_that_comes_with_the_picture(stated, capture):
    with http_device(Answer(png(), headers={"X-Camera-Temperature-C": stated})) as device:
        camera = HttpCamera(device.url, limit_s=LIMIT_S)
        assert (await camera.grab(0.0)).capture == capture
        await camera.close()


async def test_a_camera_that_comes_back_is_found(tmp_path):
    with http_device(Answer(png())) as device:
        port = device.port
    camera = HttpCamera(f"http://127.0.0.1:{port}/now", limit_s=LIMIT_S)
    camera.start()
    with http_device(Answer(png()), port):
        assert (await camera.grab(0.0)).image.shape == (48, 64, 3)
    await camera.close()


async def test_a_video_that_ends_is_opened_again(tmp_path):
    write_video(tmp_path / "short.avi", frames=3)
    camera = VideoCamera(str(tmp_path / "short.avi"), limit_s=LIMIT_S)
    camera.start()
    first = await camera.grab(0.0)
    await eventually(lambda: not camera.link.connected)
    assert "no more frames" in camera.link.detail
    again = await camera.grab(first.taken_at_s + 0.3)
    assert again.taken_at_s > first.taken_at_s + 0.3
    await camera.close()


async def test_a_file_that_is_no_video(tmp_path, capfd):
    (tmp_path / "notes.avi").write_bytes(b"these are notes" * 100)
    camera = VideoCamera(str(tmp_path / "notes.avi"), limit_s=0.3)
    camera.start()
    with pytest.raises(DeviceError, match="cannot be opened"):
        await camera.grab(0.0)
    await camera.close()


def test_a_stream_whose_server_says_nothing_is_given_up_within_the_limit() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        camera = VideoCamera(f"rtsp://127.0.0.1:{silent.getsockname()[1]}/live", limit_s=0.2)
        with pytest.raises(DeviceError, match="the stream's server answers") as refused:
            camera._open()
    assert "group video" not in str(refused.value)


@pytest.mark.parametrize(
    ("answer", "error", "says"),
    [
        (b"RTSP/1.0 503 Service Unavailable\r\nCSeq: 1\r\n\r\n", DeviceUnreachable, "503 Service Unavailable"),
        (b"RTSP/1.0 404 Not Found\r\nCSeq: 1\r\n\r\n", GarbledAnswer, "404 Not Found: check path"),
    ],
)
@pytest.mark.parametrize("scheme", ["rtsp", "rtsps", "https"])
async def test_what_a_streams_server_refuses_is_told_at_once(
    scheme: str, answer: bytes, error: type[Exception], says: str
) -> None:
    asked: list[bytes] = []
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    trustme.CA().issue_cert("camera.example").configure_cert(tls)  # whoever it is: the player decides

    async def refuse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append(await reader.readuntil(b"\r\n\r\n"))
        writer.write(answer if "rtsp" in scheme else answer.replace(b"RTSP", b"HTTP"))
        await writer.drain()
        writer.close()

    secured = tls if scheme.endswith("s") else None
    async with await asyncio.start_server(refuse, "127.0.0.1", 0, ssl=secured) as server:
        port = server.sockets[0].getsockname()[1]
        camera = VideoCamera(f"{scheme}://user:secret@127.0.0.1:{port}/live", limit_s=3600.0)
        camera.start()
        with pytest.raises(error, match=says):
            await asyncio.wait_for(camera.grab(0.0), LIMIT_S)
        await camera.close()
    wanted = f"DESCRIBE {scheme}://127.0.0.1:{port}/live RTSP/1.0" if "rtsp" in scheme else "GET /live HTTP/1.0"
    assert asked[0].startswith(wanted.encode()) and b"secret" not in asked[0]


async def test_a_stream_without_tls_at_an_address_with_it_is_told_at_once() -> None:
    with http_device(Answer(b"no", status=404)) as device:
        camera = VideoCamera(device.url.replace("http://", "rtsps://"), limit_s=3600.0)
        camera.start()
        with pytest.raises(GarbledAnswer, match=r"no TLS with .*: check scheme and port"):
            await asyncio.wait_for(camera.grab(0.0), LIMIT_S)
        await camera.close()


async def test_a_stream_over_http_that_is_not_there_is_told_at_once() -> None:
    with http_device(Answer(b"no", status=404)) as device:
        camera = VideoCamera(device.url, limit_s=3600.0)
        camera.start()
        with pytest.raises(GarbledAnswer, match="404 Not Found"):
            await asyncio.wait_for(camera.grab(0.0), LIMIT_S)
        await camera.close()
