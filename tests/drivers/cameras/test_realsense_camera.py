"""RealSense cameras by pyrealsense2, against librealsense's own software device."""

import contextlib
import threading
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.opened_device import GenICamCamera
from drivers.cameras.realsense_camera import RealSenseLibrary
from drivers.errors import DeviceTaken, DeviceUnreachable, SettingRefused, StreamStalled, WrongDevice
from drivers.scanners.genicam_scanner import GenICamScanner
from drivers.timing import Timing
from registration.io.organised import read_organised
from tests.support.waiting import LIMIT_S

rs = pytest.importorskip("pyrealsense2", reason="pyrealsense2 is not installed: pip install pyrealsense2")

WIDTH, HEIGHT, FOCAL_PX, CENTRE_PX = 64, 48, 100.0, (31.5, 20.0)
SERIAL = "918512070001"
STREAMS = {  # librealsense's stream, index, format, numpy's type, channels
    "depth": (rs.stream.depth, 0, rs.format.z16, np.uint16, 1),
    "infrared": (rs.stream.infrared, 1, rs.format.y8, np.uint8, 1),
    "color": (rs.stream.color, 0, rs.format.rgb8, np.uint8, 3),
}


@dataclass
class SoftwareCamera:
    """A depth camera of librealsense: what it shows while streaming, and its faults."""

    shown: dict[str, int] = field(default_factory=lambda: {"depth": 1000, "infrared": 77, "color": 90})
    serial: str = SERIAL
    present: bool = True
    stalled: bool = False

    def __post_init__(self):
        self.device = rs.software_device()
        self.device.create_matcher(rs.matchers.default)
        self.device.register_info(rs.camera_info.serial_number, self.serial)
        self.device.register_info(rs.camera_info.name, "Intel RealSense D405")
        sensors = {name: self.device.add_sensor(name) for name in ("Stereo Module", "RGB Camera")}
        sensors["Stereo Module"].add_read_only_option(rs.option.depth_units, 0.0005)
        self.streams = {}
        for uid, (name, (stream, index, form, dtype, channels)) in enumerate(STREAMS.items()):
            sensor = sensors["RGB Camera" if name == "color" else "Stereo Module"]
            video = rs.video_stream()
            video.type, video.index, video.uid, video.fmt = stream, index, uid, form
            video.width, video.height, video.fps = WIDTH, HEIGHT, 30
            video.bpp = np.dtype(dtype).itemsize * channels
            video.intrinsics = self._intrinsics()
            self.streams[name] = (sensor, sensor.add_video_stream(video), dtype, channels)

    @staticmethod
    def _intrinsics():
        lens = rs.intrinsics()
        lens.width, lens.height, lens.fx, lens.fy = WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX
        lens.ppx, lens.ppy = CENTRE_PX
        lens.model, lens.coeffs = rs.distortion.none, [0.0] * 5
        return lens

    def send(self, number):
        if self.stalled:
            return
        for name, (sensor, profile, dtype, channels) in self.streams.items():
            shape = (HEIGHT, WIDTH, channels) if channels > 1 else (HEIGHT, WIDTH)
            pixels = np.full(shape, self.shown[name], dtype)
            if name == "depth":
                pixels[0, 0] = 0
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp = pixels, pixels.itemsize * channels
            frame.stride, frame.frame_number = WIDTH * frame.bpp, number
            frame.timestamp, frame.domain = number * 33.3, rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            with contextlib.suppress(RuntimeError):  # this sensor does not stream now
                sensor.on_video_frame(frame)


@contextlib.contextmanager
def sending(camera):
    """The camera sends pictures until the end."""
    ending = threading.Event()

    def send_for_ever():
        number = 0
        while not ending.wait(0.02):
            number += 1
            camera.send(number)

    thread = threading.Thread(target=send_for_ever)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


@contextlib.asynccontextmanager
async def opened(make, stream, camera, address=f"realsense:{SERIAL}", limit_s=LIMIT_S):
    def library(_):
        return RealSenseLibrary(stream, lambda: [camera.device] if camera.present else [])

    device = make(library, parse_camera_address(address), Timing(), limit_s=limit_s)
    with sending(camera):
        device.start()
        try:
            yield device
        finally:
            await device.close()


@pytest.mark.parametrize(("query", "shape", "shade"), [
    ("", (HEIGHT, WIDTH, 3), 90),
    ("?Stream=Infrared", (HEIGHT, WIDTH), 77),
])  # fmt: skip
async def test_a_picture_of_the_stream_that_the_address_names(query, shape, shade):
    camera = SoftwareCamera()
    async with opened(GenICamCamera, "Color", camera, f"realsense:{SERIAL}{query}") as device:
        frame = await device.grab(0.0)
        identity = await device.identify()
    assert frame.image.shape == shape and (frame.image == shade).all()
    assert (identity.vendor, identity.model, identity.serial) == ("RealSense", "D405", SERIAL)
    assert any("focal length 100.0 px, principal point (31.5, 20.0)" in ability for ability in identity.abilities)


async def test_depth_becomes_an_organised_cloud_with_the_infrared_picture(tmp_path):
    """Depth of 1000 units of 0.5 mm: a plane 500 mm away, whose pixels the lens spreads."""
    async with opened(GenICamScanner, "Depth", SoftwareCamera()) as device:
        cloud = await device.scan(0.0)
    (tmp_path / "cloud.pcd").write_bytes(cloud.content)
    seen = read_organised(tmp_path / "cloud.pcd", "mm")
    assert (seen.intensity == 77).all()
    assert np.isnan(seen.points_mm[0, 0]).all()
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    x, y = (500.0 * (columns - CENTRE_PX[0]) / FOCAL_PX, 500.0 * (rows - CENTRE_PX[1]) / FOCAL_PX)
    expected = np.dstack([x, y, np.full(x.shape, 500.0)])
    assert seen.points_mm.reshape(-1, 3)[1:] == pytest.approx(expected.reshape(-1, 3)[1:], abs=1e-3)


async def test_a_picture_from_before_is_never_handed_out():
    camera = SoftwareCamera()
    async with opened(GenICamCamera, "Color", camera) as device:
        assert (await device.grab(0.0)).image[0, 0, 0] == 90
        camera.shown = camera.shown | {"color": 200}
        for _ in range(2):  # the software device may hold one frame in the making
            await device.grab(0.0)
        assert (await device.grab(0.0)).image[0, 0, 0] == 200


@pytest.mark.parametrize(("spoil", "address", "error"), [
    ({"present": False}, f"realsense:{SERIAL}", DeviceUnreachable),
    ({"serial": "1"}, f"realsense:{SERIAL}", WrongDevice),
    ({"stalled": True}, f"realsense:{SERIAL}", StreamStalled),
    ({}, f"realsense:{SERIAL}?Stream=Thermal", SettingRefused),
    ({}, f"realsense:{SERIAL}?Width=4000", SettingRefused),
])  # fmt: skip
async def test_each_fault_has_its_error(spoil, address, error):
    async with opened(GenICamCamera, "Color", SoftwareCamera(**spoil), address, limit_s=1.0) as device:
        with pytest.raises(error):
            await device.grab(0.0)


async def test_a_camera_that_another_program_streams_from():
    camera = SoftwareCamera()
    sensor, profile, _, _ = camera.streams["color"]
    sensor.open(profile)
    try:
        async with opened(GenICamCamera, "Color", camera) as device:
            with pytest.raises(DeviceTaken):
                await device.grab(0.0)
        assert not device.link.connected
    finally:
        sensor.close()
