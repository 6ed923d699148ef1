"""A GenICam 3D camera as scanner, with a library in memory: organised clouds, and each fault its error."""

import contextlib
from dataclasses import dataclass

import numpy as np
import pytest

from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera, RawPicture
from drivers.errors import (
    AnswerTooLarge,
    DeviceTaken,
    GarbledAnswer,
    NothingMeasured,
    SettingRefused,
    StreamStalled,
    WrongDevice,
)
from drivers.scanners.cloud_files import whole_cloud
from drivers.scanners.genicam_scanner import GenICamScanner
from registration.io.organised import read_organised
from tests.drivers.cameras.genicam_fake import MONO8, FakeDevice, FakeLibrary, FakeOpenCamera
from tests.support.waiting import LIMIT_S, quick_timing

ABC32F = 0x026000C0
OF_AXES = {"Scan3dCoordinateScale": ("1", "1", "0.5"), "Scan3dCoordinateOffset": ("0", "0", "10")}


@dataclass
class Fake3dDevice(FakeDevice):
    """A camera that sends coordinates (3, 4, 3), and the shade as intensity where it has the component."""

    numbers: np.ndarray | None = None
    has_intensity: bool = True


class Open3dCamera(FakeOpenCamera):
    """It answers features of an axis for the one that is selected."""

    def read(self, feature):
        axis = "ABC".index(self._device.features["Scan3dCoordinateSelector"][-1])
        return OF_AXES[feature][axis] if feature in OF_AXES else super().read(feature)

    def has(self, feature):
        return feature in OF_AXES or super().has(feature)

    def choices(self, feature):
        if feature == "Scan3dCoordinateSelector":
            return ("CoordinateA", "CoordinateB", "CoordinateC")
        return super().choices(feature)

    def next_picture(self, limit_s):
        seen = super().next_picture(limit_s)
        device = self._device
        if seen is None or device.numbers is None:
            return seen
        height, width = device.numbers.shape[:2]
        intensity = RawPicture(np.full(height * width, device.shade, np.uint8), MONO8, width, height)
        data = device.numbers.astype("<f4").reshape(-1).view(np.uint8)
        parts = (intensity,) if device.has_intensity else ()
        return RawPicture(data, ABC32F, width, height, parts=parts)


class Library3d(FakeLibrary):
    def open(self, camera):
        super().open(camera)
        return Open3dCamera(next(device for device in self.devices if device.found is camera))


def numbers():
    rows, columns = np.mgrid[0:3, 0:4]
    cloud = np.dstack([columns, rows, 1000.0 + columns])
    cloud[0, 0] = 0.0
    return cloud


def device_3d(**changes):
    device = Fake3dDevice(numbers=numbers(), **changes)
    device.features |= {
        "Scan3dOutputMode": "CalibratedABC_Grid", "Scan3dCoordinateSystem": "Cartesian",
        "Scan3dDistanceUnit": "Millimeter", "Scan3dCoordinateSelector": "CoordinateA",
        "Scan3dInvalidDataFlag": "1", "Scan3dInvalidDataValue": "0",
    }  # fmt: skip
    return device


@contextlib.asynccontextmanager
async def scanner_of(device, address="genicam:S1", limit_s=LIMIT_S, **options):
    make = lambda _: Library3d(device)  # noqa: E731
    scanner = GenICamScanner(make, parse_camera_address(address), quick_timing(10.0), limit_s=limit_s, **options)
    scanner.start()
    try:
        yield scanner
    finally:
        await scanner.close()


async def test_an_organised_cloud_in_mm_with_the_intensity_of_its_pixels(tmp_path):
    async with scanner_of(device_3d(shade=77)) as scanner:
        cloud = await scanner.scan(0.0)
    assert whole_cloud("s", cloud.content) == cloud.media_type == "application/x-pcd"
    (tmp_path / "cloud.pcd").write_bytes(cloud.content)
    seen = read_organised(tmp_path / "cloud.pcd", "mm")
    expected = numbers() * [1.0, 1.0, 0.5] + [0.0, 0.0, 10.0]
    assert np.isnan(seen.points_mm[0, 0]).all()
    assert seen.points_mm.reshape(-1, 3)[1:] == pytest.approx(expected.reshape(-1, 3)[1:])
    assert (seen.intensity == 77).all() and seen.intensity.shape == (3, 4)


async def test_without_intensity_there_are_points_alone():
    async with scanner_of(device_3d(has_intensity=False)) as scanner:
        assert b"FIELDS x y z\n" in (await scanner.scan(0.0)).content


async def test_a_cloud_is_of_what_is_there_now():
    device = device_3d()
    async with scanner_of(device) as scanner:
        first = await scanner.scan(0.0)
        device.numbers = numbers() + np.array([0.0, 0.0, 40.0])
        assert (await scanner.scan(0.0)).content != first.content


FAULTS = {
    "another serial number": (lambda d: setattr(d, "found", FoundCamera("A", "M", "S2", "10.0.0.2", "b")), WrongDevice),
    "taken": (lambda d: setattr(d, "taken", True), DeviceTaken),
    "stalled": (lambda d: setattr(d, "stalled", True), StreamStalled),
    "no coordinates": (lambda d: setattr(d, "numbers", None), GarbledAnswer),
    "nothing in range": (lambda d: setattr(d, "numbers", np.zeros((3, 4, 3))), NothingMeasured),
    "profiles": (lambda d: d.features.update(Scan3dOutputMode="CalibratedAC_Linescan"), SettingRefused),
}


@pytest.mark.parametrize(("spoil", "error"), FAULTS.values(), ids=FAULTS)
async def test_each_fault_has_its_error(spoil, error):
    device = device_3d()
    spoil(device)
    async with scanner_of(device, limit_s=0.3) as scanner:
        with pytest.raises(error):
            await scanner.scan(0.0)


async def test_a_cloud_over_the_limit_is_refused():
    async with scanner_of(device_3d(), max_bytes=100) as scanner:
        with pytest.raises(AnswerTooLarge):
            await scanner.scan(0.0)
