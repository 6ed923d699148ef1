"""Each fault of an industrial camera: what its next picture fails with, and that an older one never takes its place."""

import ast
import asyncio
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers import errors
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera
from drivers.cameras.genicam.opened_device import GenICamCamera
from drivers.errors import DeviceError
from tests.drivers.cameras.genicam_fake import FakeDevice, FakeLibrary
from tests.stories.camera_fault_rows import CAMERA_ROWS, VENDOR_ROWS, VENDOR_TESTS, CameraRow, VendorRow
from tests.support.waiting import LIMIT_S, eventually, quick_timing

OLD, NEW = 90, 200
UNKNOWN_FORMAT = 0x0BADF00D
FAIL_S = 1.0

FAULTS: dict[str, Callable[[FakeDevice], None]] = {
    "lost": lambda device: _set(device, present=False),
    "taken": lambda device: _set(device, present=False, taken=True),
    "exchanged": lambda device: _set(device, present=False, found=FoundCamera("Acme", "M1", "S2", "10.0.0.1", "acme")),
    "format-unknown": lambda device: _set(device, format_code=UNKNOWN_FORMAT),
    "incomplete-once": lambda device: _set(device, incomplete=2),
    "incomplete": lambda device: _set(device, incomplete=1000),
    "stalled": lambda device: _set(device, stalled=True),
    "hot": lambda device: device.features.update(DeviceTemperature="88.4"),
    "overheated": lambda device: device.features.update(TemperatureState="Error"),
    "exposure-changed": lambda device: device.features.update(ExposureTime="9000"),
}
"""What happens to a camera that has given a picture; the others concern its opening."""
OPENED_AGAIN = ("taken", "exchanged", "back")
"""It is away until that is noticed, and then there again."""
WAITED_FOR = ("lost", "stalled")
"""Reported when the limit for a picture has passed."""


def _set(device: FakeDevice, **changes: object) -> None:
    for name, value in changes.items():
        setattr(device, name, value)


@pytest.mark.parametrize("row", CAMERA_ROWS, ids=lambda row: row.fault)
async def test_what_a_fault_does(row: CameraRow) -> None:
    device = FakeDevice(shade=OLD)
    limit_s = FAIL_S if row.fault in WAITED_FOR else LIMIT_S
    camera = GenICamCamera(
        lambda _: FakeLibrary(device), parse_camera_address(row.address), quick_timing(10.0), limit_s=limit_s
    )
    camera.start()
    try:
        async with asyncio.timeout(LIMIT_S):
            if row.fault in FAULTS or row.fault == "back":
                await eventually(lambda: camera.link.connected)
                await camera.grab(0.0)
                device.shade = NEW
                FAULTS.get(row.fault, FAULTS["lost"])(device)
            if row.fault in OPENED_AGAIN:
                await eventually(lambda: not camera.link.connected)
                device.present = True
            if row.fault == "lost":
                await eventually(lambda: "discovery" in camera.link.detail)
            if row.code is None:
                assert (await camera.grab(0.0)).image[0, 0] == NEW
                return
            with pytest.raises(DeviceError, match=re.escape(row.tells)) as raised:
                await camera.grab(0.0)
        assert raised.value.code == row.code
        assert row.fix in raised.value.fix
    finally:
        await camera.close()


def test_every_fault_has_its_row() -> None:
    assert set(FAULTS) <= {row.fault for row in CAMERA_ROWS}


@pytest.mark.parametrize("row", VENDOR_ROWS, ids=lambda row: f"{row.family}: {row.happens}")
def test_a_row_of_the_vendors_libraries_names_a_test_that_expects_its_error(row: VendorRow) -> None:
    module = ast.parse((Path(__file__).parent / VENDOR_TESTS[row.family]).read_text())
    tests = {node.name: node for node in module.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}
    names = {node.id for node in ast.walk(tests[row.test]) if isinstance(node, ast.Name)}
    assert names & {kind.__name__ for kind in vars(errors).values() if getattr(kind, "code", None) == row.error}
