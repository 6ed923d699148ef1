"""The vendors' libraries against their own simulated cameras: pylon, GenTL by harvesters, GigE Vision by aravis."""

import asyncio
import contextlib
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest

from drivers.cameras.aravis_camera import AravisLibrary
from drivers.cameras.basler_camera import PylonLibrary
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.session import CameraSession
from drivers.errors import (
    DeviceTaken,
    DeviceUnreachable,
    IncompletePicture,
    SettingRefused,
    StreamStalled,
    WrongDevice,
)
from drivers.interfaces import Exposure
from drivers.registry import open_camera
from tests.support import vendor_cameras
from tests.support.cases import with_library
from tests.support.vendor_cameras import SERIAL, gigabit_camera, require_pylon, start_gigabit_camera, viky
from tests.support.waiting import LIMIT_S, eventually, patiently

SIZE = "Width=64&Height=48"


@contextlib.asynccontextmanager
async def camera_at(address, limit_s=LIMIT_S):
    camera = open_camera(address, limit_s=limit_s)
    try:
        yield camera
    finally:
        await camera.close()


@pytest.fixture
def pylon(monkeypatch):
    require_pylon(monkeypatch)


@pytest.fixture
def producer():
    return viky()


def playing(file, shade, depth=np.uint8):
    """An address of the emulated camera that shows a file of one shade."""
    picture = np.full((48, 64), shade, depth)
    assert cv2.imwrite(str(file.with_suffix(".new.png")), picture)
    file.with_suffix(".new.png").rename(file)
    return f"basler:0815-0000?{SIZE}&TestImageSelector=Off&ImageFilename={file}&ImageFileMode=On"


async def test_pylon_shows_what_is_in_front_of_the_camera_now(pylon, tmp_path):
    async with camera_at(playing(tmp_path / "scene.png", 90)) as camera:
        asked_at_s = time.monotonic()
        frame = await camera.grab(asked_at_s)
        assert asked_at_s < frame.taken_at_s <= time.monotonic()
        assert frame.image.shape == (48, 64) and (frame.image == 90).all()
        playing(tmp_path / "scene.png", 200)
        shade = 90
        async with asyncio.timeout(LIMIT_S):  # the emulation may have read the file before it was replaced
            while shade == 90:
                shade = (await camera.grab(time.monotonic())).image[0, 0]
        assert shade == 200


@pytest.mark.parametrize(
    ("pixel_format", "bits", "shape"),
    with_library(
        "pypylon",
        [
            ("Mono8", 8, (48, 64)),
            ("Mono10", 10, (48, 64)),
            ("Mono12", 12, (48, 64)),
            ("Mono16", 16, (48, 64)),
            ("BayerRG8", 8, (48, 64, 3)),
            ("BayerGB12", 12, (48, 64, 3)),
            ("RGB8Packed", 8, (48, 64, 3)),
            ("RGB16Packed", 16, (48, 64, 3)),
            ("BGRA8Packed", 8, (48, 64, 3)),
        ],
    ),
)
async def test_pylon_in_every_kind_of_pixel_format(pylon, tmp_path, pixel_format, bits, shape):
    address = playing(tmp_path / "scene.png", 90)
    async with camera_at(f"{address}&pixel_format={pixel_format}&exposure_us=3000&gain_db=2") as camera:
        frame = await camera.grab(0.0)
        assert frame.image.shape == shape
        assert abs(float(np.median(frame.image)) - 90) < 2
        assert frame.capture.bits == bits and frame.capture.exposure_us == 3000
        assert frame.capture.gain_db == pytest.approx(2, abs=0.01)
        assert (frame.levels is None) == (bits == 8)
        set_to = await camera.set_exposure(Exposure(700.0, 100.0))
        assert (set_to.exposure_us, set_to.gain_db) == (700.0, pytest.approx(48, abs=0.01))
        who = await camera.identify()
        assert (who.vendor, who.serial) == ("Basler", "0815-0000")


async def test_pylon_refuses_what_is_not_there(pylon, tmp_path):
    async with camera_at("basler:4711") as camera:
        with pytest.raises(WrongDevice, match="no camera is 4711, but there are: Basler Emulation"):
            await camera.grab(0.0)
    async with camera_at("basler:?pixel_format=Mono13") as camera:
        with pytest.raises(SettingRefused, match="write one of Mono8, Mono10"):
            await camera.grab(0.0)


@pytest.mark.parametrize(("failures", "enough"), with_library("pypylon", [(2, True), (50, False)]))
def test_pylon_with_pictures_of_which_parts_are_missing(pylon, tmp_path, failures, enough):
    library = PylonLibrary()
    (found,) = library.discover()
    opened = library.open(found)
    session = CameraSession("c", found, opened, parse_camera_address("basler:"), time.monotonic)
    try:
        opened.write("ForceFailedBufferCount", str(failures))
        opened.execute("ForceFailedBuffer")
        if enough:
            assert session.take(10.0).image.size
        else:
            with pytest.raises(IncompletePicture):
                session.take(10.0)
    finally:
        session.close()


async def test_a_gentl_producer(producer):
    async with camera_at(f"genicam:1?producer={producer}&pixel_format=Mono8&Width=320&Height=200") as camera:
        asked_at_s = time.monotonic()
        frames = [await camera.grab(asked_at_s), await camera.grab(time.monotonic())]
        assert [frame.image.shape for frame in frames] == [(200, 320)] * 2
        assert asked_at_s < frames[0].taken_at_s < frames[1].taken_at_s
        who = await camera.identify()
        assert (who.model, who.serial) == ("Viky", "1")
        assert await camera.read_exposure() is None


async def test_a_gentl_producer_in_colour_found_by_the_environment(producer, monkeypatch):
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(producer.parent))
    async with camera_at("genicam:0?pixel_format=RGBa8") as camera:
        assert (await camera.grab(0.0)).image.shape == (400, 400, 3)
    async with camera_at("genicam:9") as camera:
        with pytest.raises(WrongDevice, match="no camera is 9"):
            await camera.grab(0.0)


async def test_no_gentl_producer(producer, monkeypatch, tmp_path):
    monkeypatch.delenv("GENICAM_GENTL64_PATH", raising=False)
    async with camera_at("genicam:0", limit_s=0.5) as camera:
        with pytest.raises(DeviceUnreachable, match="no GenTL producer"):
            await camera.grab(0.0)
    async with camera_at(f"genicam:0?producer={tmp_path}/none.cti", limit_s=0.5) as camera:
        with pytest.raises(DeviceUnreachable, match=r"no producer .*none\.cti"):
            await camera.grab(0.0)


@pytest.mark.parametrize("options", ["", "?trigger=off&pixel_format=Mono16", "?serial=HE1&pixel_format=BayerRG8"])
async def test_a_gige_vision_camera_over_the_network(options):
    with gigabit_camera():
        name = SERIAL if "serial" not in options else "127.0.0.1"
        async with camera_at(f"aravis:{name}{options}") as camera:
            asked_at_s = time.monotonic()
            frames = [await camera.grab(asked_at_s), await camera.grab(time.monotonic())]
            assert {frame.image.shape[:2] for frame in frames} == {(512, 512)}
            assert asked_at_s < frames[0].taken_at_s < frames[1].taken_at_s
            assert frames[0].capture.device_time_ns < frames[1].capture.device_time_ns
            assert (await camera.set_exposure(Exposure(2000.0))).exposure_us == 2000.0
            assert (await camera.identify()).serial == SERIAL


@pytest.mark.slow
async def test_a_gige_vision_camera_that_is_unplugged_and_comes_back():
    with gigabit_camera() as device:
        async with camera_at(f"aravis:{SERIAL}", limit_s=8.0) as camera:
            await patiently(lambda: camera.grab(0.0))
            vendor_cameras.stop(device)
            await eventually(lambda: not camera.link.connected)
            again = start_gigabit_camera()
            try:
                await eventually(lambda: camera.link.connected)
                asked_at_s = time.monotonic()
                assert (await patiently(lambda: camera.grab(asked_at_s))).taken_at_s > asked_at_s
            finally:
                vendor_cameras.stop(again)


class OneDatagramIsLost:
    """libaravis, of which the first search finds no camera."""

    searches = 0

    def update_device_list(self) -> None:
        self.searches += 1

    def get_n_devices(self) -> int:
        return int(self.searches > 1)

    def device_text(self, place: int, what: str) -> str:
        return {"protocol": "GigEVision", "serial_nbr": "HE1"}.get(what, what)


@pytest.mark.parametrize(
    ("name", "searches", "found"), [("HE1", 2, ["HE1"]), ("", 1, []), ("192.168.5.7", 1, ["unknown"])]
)
def test_a_camera_by_its_name_is_searched_twice(
    monkeypatch: pytest.MonkeyPatch, name: str, searches: int, found: list[str]
) -> None:
    library = OneDatagramIsLost()
    monkeypatch.setattr("drivers.cameras.aravis_camera.Aravis", lambda: library)
    assert [camera.serial for camera in AravisLibrary(name).discover()] == found
    assert library.searches == searches


@pytest.mark.slow
async def test_a_gige_vision_camera_that_another_program_controls():
    with gigabit_camera():
        library = AravisLibrary(SERIAL)
        (found,) = [camera for camera in library.discover() if camera.serial == SERIAL]
        holder = library.open(found)
        try:
            async with camera_at(f"aravis:{SERIAL}") as camera:
                with pytest.raises(DeviceTaken, match="controlled by another program"):
                    await camera.grab(0.0)
        finally:
            holder.close()


async def test_a_gige_vision_camera_whose_trigger_never_comes():
    with gigabit_camera():
        async with camera_at(f"aravis:{SERIAL}?trigger=Line0", limit_s=2.0) as camera:
            await eventually(lambda: camera.link.connected)
            with pytest.raises(StreamStalled, match="check its trigger"):
                await camera.grab(0.0)
            assert camera.link.connected


@pytest.mark.slow
async def test_a_gige_vision_network_that_loses_packets():
    with gigabit_camera(lost_per_thousand=400):
        async with camera_at(f"aravis:{SERIAL}", limit_s=20.0) as camera:
            with pytest.raises(IncompletePicture, match="parts of 3 pictures"):
                await patiently(lambda: camera.grab(0.0))


async def test_a_gige_vision_camera_with_another_serial_number():
    with gigabit_camera():
        async with camera_at("aravis:127.0.0.1?serial=HE2") as camera:
            with pytest.raises(WrongDevice, match="serial number HE1, not HE2"):
                await camera.grab(0.0)
        async with camera_at("aravis:HE2") as camera:
            with pytest.raises(WrongDevice, match="no camera is HE2, but there are: Aravis Fake"):
                await camera.grab(0.0)


@pytest.mark.slow
def test_pylon_is_loaded_where_warnings_are_errors():
    """In a process of its own: the types of its wrapper, made under -W error, end the process (pypylon 26.9)."""
    pytest.importorskip("pypylon", reason="pypylon is not installed: pip install pypylon")
    program = "from drivers.cameras.basler_camera import PylonLibrary; print(len(PylonLibrary().discover()))"
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["basler", "genicam", "aravis"])
def test_a_library_that_is_not_installed_is_named(scheme):
    """In a process of its own, which cannot import pypylon, harvesters or load aravis."""
    program = f"""
import asyncio, ctypes, sys
sys.modules.update(pypylon=None, harvesters=None)
def refuse(name, *rest): raise OSError(name)
ctypes.CDLL = refuse
from drivers.registry import open_camera
async def main():
    camera = open_camera("{scheme}:1", limit_s=60.0)
    try:
        await camera.grab(0.0)
    except Exception as error:
        print(type(error).__name__, error)
    await camera.close()
asyncio.run(main())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("LibraryMissing")
    assert "install" in done.stdout
