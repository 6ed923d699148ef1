"""Every fault of industrial cameras and 3D cameras: the part of docs/faults.md after the mock cell's."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class CameraRow:
    """A fault of an industrial camera: how the next picture fails. `code` None: the picture comes all the same."""

    fault: str
    happens: str
    code: str | None
    tells: str
    fix: str = ""
    address: str = "genicam:S1"


CAMERA_ROWS = (
    CameraRow("lost", "power or cable is away", "device-unreachable", "no camera answers discovery", "check power"),
    CameraRow("back", "it is away for a moment", None, "nothing: it is opened again"),
    CameraRow("taken", "another program controls it", "device-taken", "controlled by another program", "close the"),
    CameraRow("exchanged", "another camera has its place", "wrong-device", "no camera is S1", "correct the serial"),
    CameraRow(
        "format-refused",
        "it does not have the pixel format of the settings",
        "setting-refused",
        "refuses PixelFormat = Mono14",
        "write one of Mono8, Mono12",
        "genicam:S1?pixel_format=Mono14",
    ),
    CameraRow("format-unknown", "its pictures have a format without a name", "garbled-answer", "pixel format", "Mono8"),
    CameraRow("incomplete-once", "parts of two pictures are lost", None, "nothing: the picture is taken again"),
    CameraRow("incomplete", "parts of every picture are lost", "incomplete-picture", "parts of 3", "packet_bytes"),
    CameraRow("stalled", "it is connected and sends nothing", "stream-stalled", "has sent no picture", "check its"),
    CameraRow(
        "hot",
        "it is hotter than `max_temperature_c` of its address",
        "device-overheated",
        "is too hot at 88",
        "cool it",
        "genicam:S1?max_temperature_c=80",
    ),
    CameraRow("overheated", "it reports its over-temperature state", "device-overheated", "is too hot", "cool it"),
    CameraRow(
        "exposure-refused",
        "the exposure of the settings is beyond its range",
        "setting-refused",
        "refuses ExposureTime = 1",
        "a number from 10 to",
        "genicam:S1?exposure_us=1",
    ),
    CameraRow(
        "exposure-changed",
        "another program changes its exposure",
        "setting-refused",
        "exposes for 9000 us, 1000 us were set",
        "end the program",
    ),
)

SCANNER_ROWS = (
    CameraRow("lost", "power or cable is away", "device-unreachable", "no camera answers discovery", "check power"),
    CameraRow("back", "it is away for a moment", None, "nothing: it is opened again"),
    CameraRow("taken", "another program controls it", "device-taken", "controlled by another program", "close the"),
    CameraRow("exchanged", "another camera has its place", "wrong-device", "no camera is S1", "correct the serial"),
    CameraRow("incomplete-once", "parts of two clouds are lost", None, "nothing: the cloud is taken again"),
    CameraRow("incomplete", "parts of every cloud are lost", "incomplete-picture", "parts of 3", "packet_bytes"),
    CameraRow("torn", "a cloud ends early", "incomplete-picture", "bytes of a cloud came", "packet_bytes"),
    CameraRow("stalled", "it is connected and sends nothing", "stream-stalled", "has sent no picture", "check its"),
    CameraRow("overheated", "it reports its over-temperature state", "device-overheated", "is too hot", "cool it"),
    CameraRow(
        "no-coordinates",
        "it sends a picture without coordinates",
        "garbled-answer",
        "sends no coordinates",
        "component Range",
    ),
    CameraRow("nothing-in-range", "no pixel has a point", "nothing-measured", "has no points", "within the scanner's"),
    CameraRow(
        "profiles", "it is set to send profiles", "setting-refused", "CalibratedAC_Linescan", "CalibratedABC_Grid"
    ),
    CameraRow(
        "cylindrical",
        "its coordinates are cylindrical",
        "setting-refused",
        "the coordinates are Cylindrical",
        "Scan3dCoordinateSystem=Cartesian",
    ),
    CameraRow(
        "unit", "its unit of length is not known", "setting-refused", "in Furlong", "Scan3dDistanceUnit=Millimeter"
    ),
    CameraRow(
        "depth-without-lens",
        "it sends depth and no focal length",
        "setting-refused",
        "no focal length",
        "CalibratedABC_Grid",
    ),
    CameraRow("too-large", "the cloud is over the limit", "answer-too-large", "more than", "smaller region"),
)
"""Faults of a GenICam 3D camera as scanner: how the next cloud fails."""


@dataclass(frozen=True)
class VendorRow:
    """A fault that the simulated camera of a vendor's own library shows. `test`: in VENDOR_TESTS of its family."""

    family: Literal["basler", "genicam", "aravis", "realsense"]
    happens: str
    error: str
    test: str


VENDOR_TESTS: Mapping[str, str] = {
    "basler": "test_vendor_cameras.py",
    "genicam": "test_vendor_cameras.py",
    "aravis": "test_vendor_cameras.py",
    "realsense": "test_realsense_camera.py",
}

VENDOR_ROWS = (
    VendorRow("basler", "no camera has the serial number", "wrong-device", "test_pylon_refuses_what_is_not_there"),
    VendorRow(
        "basler", "a pixel format that it does not have", "setting-refused", "test_pylon_refuses_what_is_not_there"
    ),
    VendorRow(
        "basler", "parts of every picture are lost", "incomplete-picture",
        "test_pylon_with_pictures_of_which_parts_are_missing",
    ),
    VendorRow("genicam", "no producer", "device-unreachable", "test_no_gentl_producer"),
    VendorRow(
        "genicam", "no camera has the serial number", "wrong-device",
        "test_a_gentl_producer_in_colour_found_by_the_environment",
    ),
    VendorRow(
        "aravis", "another program controls it", "device-taken",
        "test_a_gige_vision_camera_that_another_program_controls",
    ),
    VendorRow(
        "aravis", "its trigger never comes", "stream-stalled", "test_a_gige_vision_camera_whose_trigger_never_comes"
    ),
    VendorRow(
        "aravis", "the network loses 400 of 1,000 packets", "incomplete-picture",
        "test_a_gige_vision_network_that_loses_packets",
    ),
    VendorRow(
        "aravis", "another serial number answers", "wrong-device",
        "test_a_gige_vision_camera_with_another_serial_number",
    ),
    VendorRow("realsense", "it is not there", "device-unreachable", "test_each_fault_has_its_error"),
    VendorRow("realsense", "another serial number", "wrong-device", "test_each_fault_has_its_error"),
    VendorRow("realsense", "it sends nothing", "stream-stalled", "test_each_fault_has_its_error"),
    VendorRow("realsense", "a stream that it does not have", "setting-refused", "test_each_fault_has_its_error"),
    VendorRow(
        "realsense", "another program streams from it", "device-taken",
        "test_a_camera_that_another_program_streams_from",
    ),
)  # fmt: skip

CAMERA_HEADING = """
## Industrial cameras

Faults of `genicam:`, `basler:`, `aravis:` and `realsense:` cameras, and how the next picture fails. No older picture is
given in its place. `pytest tests/drivers/cameras/test_camera_faults.py` tries every row at the driver, with a camera in
memory.

| fault | what happens | the picture | what the operator reads | what to do |
|---|---|---|---|---|
"""


SCANNER_HEADING = """
## 3D cameras as scanners

Faults of a GenICam 3D camera, and how the next cloud fails. No older cloud is given in its place.
`pytest tests/drivers/scanners/test_genicam_scanner.py` tries every row at the driver, with a camera in memory.

| fault | what happens | the cloud | what the operator reads | what to do |
|---|---|---|---|---|
"""


VENDOR_HEADING = """
## With the vendors' libraries

The same errors from the simulated cameras of the vendors' own libraries: pylon's emulation, EMVA's `viky.cti`,
aravis's camera on loopback, librealsense's software device. The tests are in `tests/drivers/cameras`, and skipped with
a sentence where the library is not installed.

| camera | what happens | error | test |
|---|---|---|---|
"""


def camera_page() -> str:
    """The part of docs/faults.md."""
    cameras = CAMERA_HEADING + "".join(map(_camera_line, CAMERA_ROWS))
    scanners = SCANNER_HEADING + "".join(map(_camera_line, SCANNER_ROWS))
    return cameras + scanners + VENDOR_HEADING + "".join(map(_vendor_line, VENDOR_ROWS))


def _vendor_line(row: VendorRow) -> str:
    return f"| `{row.family}:` | {row.happens} | `{row.error}` | `{VENDOR_TESTS[row.family]}::{row.test}` |\n"


def _camera_line(row: CameraRow) -> str:
    ends = f"fails: `{row.code}`" if row.code else "comes"
    return f"| `{row.fault}` | {row.happens} | {ends} | {row.tells} | {row.fix} |\n"
