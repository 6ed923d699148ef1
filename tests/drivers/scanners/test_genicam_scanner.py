"""A GenICam 3D camera as scanner, with a library in memory: organised clouds, and each fault its error."""

import asyncio
import contextlib
import re
from dataclasses import dataclass

import numpy as np
import pytest

from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera, RawPicture
from drivers.errors import DeviceError
from drivers.scanners.cloud_files import whole_cloud
from drivers.scanners.genicam_scanner import GenICamScanner
from registration.io.organised import read_organised
from tests.drivers.cameras.genicam_fake import MONO8, FakeDevice, FakeLibrary, FakeOpenCamera
from tests.stories.camera_fault_rows import SCANNER_ROWS
from tests.support.waiting import LIMIT_S, eventually, quick_timing

ABC32F = 0x026000C0
OF_AXES = {"Scan3dCoordinateScale": ("1", "1", "0.5"), "Scan3dCoordinateOffset": ("0", "0", "10")}


@dataclass
class Fake3dDevice(FakeDevice):
    """A camera that sends coordinates (3, 4, 3), and the shade as intensity where it has the component."""

    numbers: np.ndarray | None = None
    has_intensity: bool = True
    torn: bool = False


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
        if seen is None or not seen.complete or device.numbers is None:
            return seen
        height, width = device.numbers.shape[:2]
        intensity = RawPicture(np.full(height * width, device.shade, np.uint8), MONO8, width, height)
        data = device.numbers.astype("<f4").reshape(-1).view(np.uint8)
        data = data[:20] if device.torn else data
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
    "lost": lambda device: spoil(device, present=False),
    "back": lambda device: spoil(device, present=False),
    "taken": lambda device: spoil(device, present=False, taken=True),
    "exchanged": lambda device: spoil(device, present=False, found=FoundCamera("Acme", "M1", "S2", "10.0.0.1", "acme")),
    "incomplete-once": lambda device: spoil(device, incomplete=2),
    "incomplete": lambda device: spoil(device, incomplete=1000),
    "torn": lambda device: spoil(device, torn=True),
    "stalled": lambda device: spoil(device, stalled=True),
    "overheated": lambda device: device.features.update(TemperatureState="Error"),
    "no-coordinates": lambda device: spoil(device, numbers=None),
    "nothing-in-range": lambda device: spoil(device, numbers=np.zeros((3, 4, 3))),
    "profiles": lambda device: device.features.update(Scan3dOutputMode="CalibratedAC_Linescan"),
    "cylindrical": lambda device: device.features.update(Scan3dCoordinateSystem="Cylindrical"),
    "unit": lambda device: device.features.update(Scan3dDistanceUnit="Furlong"),
    "depth-without-lens": lambda device: device.features.update(Scan3dOutputMode="ProjectedC"),
    "too-large": lambda device: spoil(device, numbers=np.ones((3, 400, 3))),
}
"""What happens to a scanner that has given a cloud."""
OPENED_AGAIN = ("taken", "exchanged", "back")
"""It is away until that is noticed, and then there again."""
MAX_BYTES = 2_000
FAIL_S = 1.0


def spoil(device, **changes):
    for name, value in changes.items():
        setattr(device, name, value)


@pytest.mark.parametrize("row", SCANNER_ROWS, ids=lambda row: row.fault)
async def test_what_a_fault_does(row):
    device = device_3d()
    limit_s = FAIL_S if row.fault in ("lost", "stalled") else LIMIT_S
    async with (
        scanner_of(device, row.address, limit_s=limit_s, max_bytes=MAX_BYTES) as scanner,
        asyncio.timeout(LIMIT_S),
    ):
        await eventually(lambda: scanner.link.connected)
        first = await scanner.scan(0.0)
        device.numbers = numbers() + np.array([0.0, 0.0, 40.0])
        FAULTS[row.fault](device)
        if row.fault in OPENED_AGAIN:
            await eventually(lambda: not scanner.link.connected)
            device.present = True
        if row.fault == "lost":
            await eventually(lambda: "discovery" in scanner.link.detail)
        if row.code is None:
            assert (await scanner.scan(0.0)).content != first.content
            return
        with pytest.raises(DeviceError, match=re.escape(row.tells)) as raised:
            await scanner.scan(0.0)
    assert raised.value.code == row.code
    assert row.fix in raised.value.fix


def test_every_fault_has_its_row():
    assert set(FAULTS) == {row.fault for row in SCANNER_ROWS}
