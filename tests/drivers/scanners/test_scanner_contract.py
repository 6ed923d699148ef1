"""What every scanner driver does: HTTP and folder, PLY and PCD."""

import contextlib
import struct
import threading
import time
from dataclasses import dataclass

import pytest

from drivers.errors import AnswerTooLarge, DeviceTimeout, DeviceUnreachable, GarbledAnswer, NothingMeasured
from drivers.interfaces import Scanner
from drivers.scanners.cloud_files import FolderScanner, HttpScanner, whole_cloud
from tests.drivers.http_devices import Answer, http_device
from tests.support.waiting import LIMIT_S, eventually, patiently

POINTS = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.5), (-1.0, 0.0, 0.25)]
BODY = b"".join(struct.pack("<3f", *point) for point in POINTS)
LINES = b"".join(b"%g %g %g\n" % point for point in POINTS)
XYZ = b"property float x\nproperty float y\nproperty float z\n"
PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n" + XYZ + b"end_header\n" + BODY
PLY_ASCII = b"ply\nformat ascii 1.0\ncomment a scanner's\nelement vertex 3\n" + XYZ + b"end_header\n" + LINES
PCD_HEAD = b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\n"
EMPTY_PCD_HEAD = PCD_HEAD.replace(b"WIDTH 3", b"WIDTH 0").replace(b"POINTS 3", b"POINTS 0")
PCD = PCD_HEAD + b"DATA binary\n" + BODY
PCD_ASCII = PCD_HEAD + b"DATA ascii\n" + LINES
PCD_COMPRESSED = PCD_HEAD + b"DATA binary_compressed\n" + struct.pack("<II", 20, 36) + b"\x01" * 20
WHOLE = {
    "ply": (PLY, "application/x-ply"),
    "ascii ply": (PLY_ASCII, "application/x-ply"),
    "pcd": (PCD, "application/x-pcd"),
    "ascii pcd": (PCD_ASCII, "application/x-pcd"),
    "compressed pcd": (PCD_COMPRESSED, "application/x-pcd"),
}


@pytest.mark.parametrize(("content", "media_type"), WHOLE.values(), ids=WHOLE.keys())
def test_a_whole_cloud_is_known_and_a_torn_one_reported(content, media_type):
    assert whole_cloud("s", content) == media_type
    with pytest.raises(GarbledAnswer, match="are announced"):
        whole_cloud("s", content[:-7])
    for length in range(len(content) - 8):
        with pytest.raises(GarbledAnswer):
            whole_cloud("s", content[:length])


def test_the_last_line_may_have_no_end():
    assert whole_cloud("s", PLY_ASCII[:-1]) == "application/x-ply"


@pytest.mark.parametrize(
    "content",
    [
        b"<html></html>",
        b"ply\nformat binary_little_endian 1.0\nelement vertex many\nend_header\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty quad x\nend_header\n",
        b"ply\nelement\nend_header\n",
        b"ply\nend_header\n",
        b"VERSION 0.7\nDATA binary\n",
        b"VERSION 0.7\nPOINTS 1\nSIZE x\nDATA binary\n",
        b"VERSION 0.7\nPOINTS 1\nSIZE 4\nCOUNT 1 1\nDATA binary\n",
    ],
)
def test_what_is_no_cloud_is_reported(content):
    with pytest.raises(GarbledAnswer):
        whole_cloud("s", content)


@pytest.mark.parametrize(
    "content",
    [
        b"ply\nformat ascii 1.0\nelement vertex 0\n" + XYZ + b"end_header\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 0\n" + XYZ + b"end_header\n",
        EMPTY_PCD_HEAD + b"DATA ascii\n",
        EMPTY_PCD_HEAD + b"DATA binary\n",
        EMPTY_PCD_HEAD + b"DATA binary_compressed\n" + bytes(8),
    ],
)
def test_a_cloud_without_a_point_is_a_scanner_that_saw_nothing(content):
    with pytest.raises(NothingMeasured, match="within the scanner's range"):
        whole_cloud("s", content)


@dataclass
class Scene:
    """A scanner driver, and its device."""

    scanner: Scanner
    shows: object
    stands_still: object


@contextlib.contextmanager
def http_scene(tmp_path, content=PLY, **options):
    with http_device(Answer(content, "application/octet-stream")) as device:

        def shows(new):
            device.answer = Answer(new, "application/x-ply")

        def stands_still():
            device.answer = Answer(device.answer.content, headers={"Age": "3600"})

        yield Scene(HttpScanner(device.url, **options), shows, stands_still)


@contextlib.contextmanager
def folder_scene(tmp_path, content=PLY, **options):
    ending, current = threading.Event(), [content]

    def write_for_ever():
        number = 0
        while not ending.wait(0.05):
            number += 1
            (tmp_path / f".{number:04}.ply").write_bytes(current[0])
            (tmp_path / f".{number:04}.ply").rename(tmp_path / f"{number:04}.ply")

    writer = threading.Thread(target=write_for_ever)
    writer.start()

    def stands_still():
        ending.set()
        writer.join()

    try:
        yield Scene(FolderScanner(tmp_path, **options), lambda new: current.__setitem__(0, new), stands_still)
    finally:
        stands_still()


SCENES = {"http": http_scene, "folder": folder_scene}
each_scanner = pytest.mark.parametrize("kind", SCENES)


@contextlib.asynccontextmanager
async def scene_of(kind, tmp_path, limit_s=LIMIT_S, **options):
    with SCENES[kind](tmp_path, limit_s=limit_s, **options) as scene:
        scene.scanner.start()
        try:
            yield scene
        finally:
            await scene.scanner.close()


@each_scanner
@pytest.mark.parametrize("which", ["ply", "pcd"])
async def test_a_fresh_cloud_as_the_file_it_came_as(kind, which, tmp_path):
    content, media_type = WHOLE[which]
    async with scene_of(kind, tmp_path, content=content) as scene:
        scanner: Scanner = scene.scanner
        asked_at_s = time.monotonic()
        cloud = await scanner.scan(asked_at_s)
        assert (cloud.content, cloud.media_type) == (content, media_type)
        assert asked_at_s < cloud.taken_at_s <= time.monotonic()
        assert scanner.link.connected


@each_scanner
async def test_a_stale_cloud_is_never_handed_out(kind, tmp_path):
    async with scene_of(kind, tmp_path, limit_s=0.3) as scene:
        await patiently(lambda: scene.scanner.scan(0.0))
        scene.stands_still()
        with pytest.raises(DeviceTimeout):
            await scene.scanner.scan(time.monotonic() + 0.5)


@each_scanner
async def test_a_cloud_over_the_limit_is_refused(kind, tmp_path):
    async with scene_of(kind, tmp_path, max_bytes=len(PLY) - 1) as scene:
        with pytest.raises(AnswerTooLarge, match=f"more than {len(PLY) - 1}"):
            await scene.scanner.scan(0.0)


@each_scanner
async def test_a_torn_cloud_is_refused_and_the_next_one_taken(kind, tmp_path):
    async with scene_of(kind, tmp_path, content=PLY[:-3], limit_s=1.0) as scene:
        with pytest.raises(GarbledAnswer, match="not a whole cloud file"):
            await patiently(lambda: scene.scanner.scan(0.0))
        scene.shows(PLY)
        newer_than_s = time.monotonic()
        assert (await patiently(lambda: scene.scanner.scan(newer_than_s))).content == PLY


@pytest.mark.parametrize(
    "make",
    [
        lambda path: HttpScanner("http://127.0.0.1:9/scan", limit_s=0.2),
        lambda path: FolderScanner(path / "no", limit_s=0.2),
    ],
    ids=["http", "folder"],
)
async def test_a_scanner_that_is_not_there(make, tmp_path):
    scanner = make(tmp_path)
    scanner.start()
    with pytest.raises(DeviceUnreachable):
        await scanner.scan(0.0)
    await eventually(lambda: scanner.link.detail != "not connected yet")
    assert not scanner.link.connected
    await scanner.close()


async def test_a_page_is_no_cloud():
    with http_device(Answer(b"<html>login</html>", "text/html; charset=utf-8")) as device:
        scanner = HttpScanner(device.url)
        with pytest.raises(GarbledAnswer, match="answered with text/html"):
            await scanner.scan(0.0)
        await scanner.close()


async def test_a_folder_that_comes_later_is_found(tmp_path):
    scanner = FolderScanner(tmp_path / "later", limit_s=LIMIT_S)
    scanner.start()
    await eventually(lambda: "cannot be read" in scanner.link.detail)
    (tmp_path / "later").mkdir()
    await eventually(lambda: scanner.link.connected)
    (tmp_path / "later" / "one.ply").write_bytes(PLY)
    assert (await scanner.scan(0.0)).content == PLY
    await scanner.close()
