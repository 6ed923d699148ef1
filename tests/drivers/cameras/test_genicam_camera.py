"""What every GenICam camera does, with a library in memory: settings, fresh pictures, and each fault its error."""

import asyncio
import contextlib
import threading
import time

import cv2
import numpy as np
import pytest

from daemon.sessions.session_writer import png_of
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera
from drivers.cameras.genicam.opened_device import GenICamCamera
from drivers.errors import (
    AddressNotUnderstood,
    DeviceTaken,
    DeviceTimeout,
    DeviceUnreachable,
    IncompletePicture,
    LinkLost,
    SettingRefused,
    StreamStalled,
    WrongDevice,
)
from drivers.interfaces import AdjustableCamera, Exposure, IdentifiedDevice
from tests.drivers.cameras.genicam_fake import FakeDevice, FakeLibrary
from tests.support.waiting import LIMIT_S, eventually, patiently, quick_timing


@contextlib.asynccontextmanager
async def camera_of(*devices, address="genicam:S1", limit_s=LIMIT_S, **options):
    camera = GenICamCamera(
        lambda _: FakeLibrary(*devices), parse_camera_address(address), quick_timing(10.0), limit_s=limit_s, **options
    )
    camera.start()
    try:
        yield camera
    finally:
        await camera.close()


async def test_the_settings_of_the_address_are_written_before_the_first_picture():
    device = FakeDevice()
    address = "genicam:S1?pixel_format=Mono12&exposure_us=2500&gain_db=6&packet_bytes=8192&Width=32"
    async with camera_of(device, address=address) as camera:
        frame = await camera.grab(0.0)
    assert {key: device.features[key] for key in ("ExposureAuto", "TriggerMode", "TriggerSource", "Width")} == {
        "ExposureAuto": "Off",
        "TriggerMode": "On",
        "TriggerSource": "Software",
        "Width": "32",
    }
    assert device.features["GevSCPSPacketSize"] == "8192"
    capture = frame.capture
    assert (capture.bits, capture.exposure_us, capture.gain_db) == (12, 2500.0, 6.0)
    assert (capture.temperature_c, capture.device_time_ns) == (41.5, 7)


async def test_twelve_bits_are_whole_in_the_file_and_scaled_in_the_picture():
    device = FakeDevice(shade=255)
    async with camera_of(device, address="genicam:S1?pixel_format=Mono12") as camera:
        frame = await camera.grab(0.0)
    stored = cv2.imdecode(np.frombuffer(png_of(frame), np.uint8), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == np.uint16 and stored[0, 0] == 255 * 16
    assert frame.image[0, 0] == round(255 * 16 * 255 / 4095)


@pytest.mark.parametrize("trigger", ["software", "off", "Line1"])
async def test_no_picture_is_older_than_the_request(trigger):
    device = FakeDevice()
    async with camera_of(device, address=f"genicam:S1?trigger={trigger}") as camera:
        if trigger == "Line1":
            device.features["TriggerMode"] = "Off"  # the input fires whenever the stream begins
            await eventually(lambda: camera.link.connected)
            device.features["TriggerMode"] = "Off"
        await camera.grab(0.0)
        device.shade = 200
        frame = await camera.grab(time.monotonic() * 10)
        assert frame.image[0, 0] == 200
        assert frame.taken_at_s > 0


async def test_a_picture_that_comes_too_late_is_not_the_next_answer():
    device = FakeDevice()
    async with camera_of(device, limit_s=0.5) as camera:
        await patiently(lambda: camera.grab(0.0))
        device.stalled = True
        with pytest.raises(StreamStalled, match="has sent no picture"):
            await camera.grab(0.0)
        device.queue.append(11)
        device.stalled, device.shade = False, 200
        assert (await patiently(lambda: camera.grab(0.0))).image[0, 0] == 200


async def test_an_incomplete_picture_is_asked_for_again():
    device = FakeDevice(incomplete=2)
    async with camera_of(device) as camera:
        assert (await camera.grab(0.0)).image.shape == (48, 64)


async def test_a_network_that_loses_parts_of_every_picture():
    device = FakeDevice(incomplete=1000)
    async with camera_of(device) as camera:
        with pytest.raises(IncompletePicture, match="parts of 3 pictures") as raised:
            await camera.grab(0.0)
        assert "packet_bytes" in raised.value.fix


@pytest.mark.parametrize(
    ("devices", "address", "error", "message"),
    [
        ([], "genicam:S1", DeviceUnreachable, "no camera answers discovery"),
        ([FakeDevice()], "genicam:S2", WrongDevice, "no camera is S2, but there are: Acme M1, serial number S1"),
        ([FakeDevice()], "genicam:10.0.0.1?serial=S2", WrongDevice, "has serial number S1, not S2"),
        ([FakeDevice(), FakeDevice()], "genicam:", WrongDevice, "2 cameras answer"),
        ([FakeDevice(taken=True)], "genicam:S1", DeviceTaken, "controlled by another program"),
        (
            [FakeDevice(FoundCamera("Acme", "M1", "S1", "a", "k", free=False))],
            "genicam:S1",
            DeviceTaken,
            "another program",
        ),
        ([FakeDevice()], "genicam:S1?pixel_format=Mono13", SettingRefused, "write one of Mono8, Mono12"),
        ([FakeDevice()], "genicam:S1?exposure_us=1", SettingRefused, "a number from 10 to 1e[+]06"),
        ([FakeDevice()], "genicam:S1?Gamma=1", SettingRefused, "has no Gamma"),
    ],
    ids=["none", "other serial", "other at the address", "several", "taken", "held", "format", "exposure", "feature"],
)
async def test_a_camera_that_cannot_be_opened_is_reported(devices, address, error, message):
    async with camera_of(*devices, address=address, limit_s=2.0) as camera:
        with pytest.raises(error, match=message):
            await patiently(lambda: camera.grab(0.0))
        assert not camera.link.connected


async def test_a_camera_that_is_unplugged_and_comes_back():
    device = FakeDevice()
    async with camera_of(device, limit_s=1.0) as camera:
        await patiently(lambda: camera.grab(0.0))
        device.present = False
        with pytest.raises((LinkLost, DeviceUnreachable)):
            await camera.grab(0.0)
        assert not camera.link.connected
        device.present, device.shade = True, 33
        await eventually(lambda: camera.link.connected)
        assert (await patiently(lambda: camera.grab(0.0))).image[0, 0] == 33
    assert device.opened == 2


async def test_a_loss_is_noticed_without_a_request():
    device = FakeDevice()
    async with camera_of(device) as camera:
        await eventually(lambda: camera.link.connected)
        device.present = False
        await eventually(lambda: not camera.link.connected)
        assert "it is opened again" in camera.link.detail or "discovery" in camera.link.detail


async def test_a_library_that_hangs_holds_neither_the_loop_nor_close():
    device = FakeDevice()
    async with camera_of(device, limit_s=0.5) as camera:
        await patiently(lambda: camera.grab(0.0))
        device.hung = threading.Event()
        grabbing = asyncio.create_task(camera.grab(0.0))
        for _ in range(10):
            await asyncio.sleep(0)  # the loop goes on
        with pytest.raises(DeviceTimeout):
            await grabbing
    device.hung.set()
    assert camera.link.detail == "closed"


async def test_exposure_and_gain_can_be_read_and_set_within_the_cameras_range():
    device = FakeDevice()
    async with camera_of(device) as camera:
        assert isinstance(camera, AdjustableCamera) and isinstance(camera, IdentifiedDevice)
        now, limits = await camera.read_exposure()
        assert (now.exposure_us, limits.exposure_us, limits.gain_db) == (1000.0, (10.0, 1e6), (0.0, 24.0))
        assert await camera.set_exposure(Exposure(5e6, 99.0)) == Exposure(1e6, 24.0)
        assert (await camera.grab(0.0)).capture.exposure_us == 1e6


async def test_a_camera_without_exposure_time_has_none():
    device = FakeDevice()
    del device.features["ExposureTime"]
    async with camera_of(device) as camera:
        assert await camera.read_exposure() is None
        with pytest.raises(SettingRefused, match="no exposure time"):
            await camera.set_exposure(Exposure(1000.0))


async def test_who_it_is_and_what_it_can():
    async with camera_of(FakeDevice()) as camera:
        who = await camera.identify()
    assert (who.vendor, who.model, who.serial, who.address) == ("Acme", "M1", "S1", "10.0.0.1")
    assert {"exposure", "gain in dB", "software trigger", "temperature", "Mono12"} <= set(who.abilities)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("genicam:S1?exposure=5", "unknown option 'exposure'"),
        ("genicam:S1?exposure_us=fast", "'fast', not a number"),
        ("genicam:S1?exposure_us=nan", "not a number"),
        ("genicam:S1?exposure_us=0", "not above 0"),
        ("genicam:S1?gain_db=1&gain_db=2", "repeated"),
        ("genicam:S1?trigger=", "empty"),
        ("genicam:S1?packet_bytes=12", "576 to 16384"),
        ("genicam:S1?packet_bytes=1500.5", "whole number"),
    ],
)
def test_an_address_that_cannot_be_read(address, message):
    with pytest.raises(AddressNotUnderstood, match=message):
        parse_camera_address(address)


def test_an_address_as_url_and_with_features_in_their_order():
    address = parse_camera_address("basler://24%201?Height=480&Width=640&gain_db=3")
    assert (address.name, address.gain_db, address.features) == ("24 1", 3.0, (("Height", "480"), ("Width", "640")))
