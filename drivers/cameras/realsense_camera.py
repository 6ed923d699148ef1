"""RealSense cameras over pyrealsense2 (the extra `realsense`), by the feature names of GenICam's SFNC.

Streams: Color and Infrared give pictures; Depth gives depth with the left infrared picture, which has the same pixels.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from drivers.cameras.genicam.device import FoundCamera, RawPicture, VendorError, import_library, raises_vendor_errors
from drivers.errors import DeviceTaken

STREAMS = {"Color": ("color", 0), "Infrared": ("infrared", 1), "Depth": ("depth", 0)}
"""librealsense's name and index of each stream; infrared 1 is the left picture, in whose frame depth is."""
FORMATS = {"y8": 0x01080001, "rgb8": 0x02180014, "bgr8": 0x02180015, "z16": 0x011000B8}
"""PFNC codes of librealsense's formats: Mono8, RGB8, BGR8, Coord3D_C16. Its y16 is not rectified, and left out."""
COLOUR_EXPOSURE_US = 100.0
"""Unit of a colour sensor's exposure, as of UVC 1.5, CT_EXPOSURE_TIME_ABSOLUTE_CONTROL; the others' is 1 us."""
BUSY = ("busy", "errno=16", "already opened")
"""What librealsense says of a device that another program streams from."""


def _errors() -> tuple[type[Exception], ...]:
    return RuntimeError, ValueError  # all that librealsense raises


@raises_vendor_errors(_errors)
class RealSenseLibrary:
    """drivers.cameras.genicam.device.Library. `stream`: of STREAMS, unless the address names another one.

    `find_devices`: the devices that are there, by default those of librealsense's context.
    """

    def __init__(self, stream: str = "Color", find_devices: Callable[[], Sequence[Any]] | None = None) -> None:
        self._stream, self._find_devices = stream, find_devices
        self._devices: dict[str, Any] = {}

    def discover(self) -> list[FoundCamera]:
        """Cameras on USB. Raises LibraryMissing, VendorError."""
        rs = import_library("pyrealsense2", "realsense")
        devices = list(rs.context().query_devices()) if self._find_devices is None else self._find_devices()
        self._devices = {device.get_info(rs.camera_info.serial_number): device for device in devices}
        return [_found(rs, serial, device) for serial, device in self._devices.items()]

    def open(self, camera: FoundCamera) -> "OpenRealSense":
        """Open one stream. Raises DeviceTaken, LibraryMissing, VendorError."""
        rs = import_library("pyrealsense2", "realsense")
        opened = OpenRealSense(rs, self._devices[camera.key], self._stream)
        try:
            opened.start_stream()
            opened.stop_stream()
        except VendorError as error:
            if any(word in str(error).lower() for word in BUSY):
                what = f"{camera} is controlled by another program"
                raise DeviceTaken(f"camera realsense:{camera.serial}", what) from error
            raise
        return opened


@raises_vendor_errors(_errors)
class OpenRealSense:
    """drivers.cameras.genicam.device.OpenCamera. `Width`, `Height` and `Stream` choose among the camera's profiles."""

    def __init__(self, rs: Any, device: Any, stream: str) -> None:
        self._rs, self._device = rs, device
        self._chosen = {"Stream": stream}
        self._streaming: Any = None
        self._syncer: Any = None

    def has(self, feature: str) -> bool:
        if feature in SOFTWARE:
            return not feature.startswith("Scan3d") or self._chosen["Stream"] == "Depth" or feature in LENS
        return self._option(feature) is not None

    def read(self, feature: str) -> str:
        if feature in SOFTWARE:
            return SOFTWARE[feature](self)
        sensor, option, unit = self._require_option(feature)
        value = sensor.get_option(option)
        return ("Continuous" if value else "Off") if feature == "ExposureAuto" else f"{value * unit:.9g}"

    def write(self, feature: str, value: str) -> None:
        if feature in ("Stream", "Width", "Height"):
            before = dict(self._chosen)
            self._chosen[feature] = value
            try:
                self._profiles()
            except (VendorError, ValueError, KeyError):
                self._chosen = before
                raise VendorError(f"the camera has no such stream: {feature}={value}") from None
            return
        if feature in SOFTWARE:
            if feature == "Scan3dCoordinateSelector" or value == self.read(feature):
                return
            raise VendorError("it cannot be set")
        sensor, option, unit = self._require_option(feature)
        number = float(value != "Off") if feature == "ExposureAuto" else float(value) / unit
        sensor.set_option(option, number)

    def bounds(self, feature: str) -> tuple[float, float]:
        sensor, option, unit = self._require_option(feature)
        limits = sensor.get_option_range(option)
        return limits.min * unit, limits.max * unit

    def choices(self, feature: str) -> tuple[str, ...]:
        if feature == "Stream":
            return tuple(STREAMS)
        if feature == "ExposureAuto":
            return ("Off", "Continuous")
        if feature == "PixelFormat":
            return (self.read(feature),)
        raise VendorError(f"{feature} is no enumeration")

    def execute(self, feature: str) -> None:
        raise VendorError(f"the camera has no {feature}")

    def is_lost(self) -> bool:
        return not self._device.is_connected()

    def start_stream(self) -> None:
        sensor, profiles = self._profiles()
        syncer = self._rs.syncer()
        sensor.open(profiles)
        try:
            sensor.start(syncer)
        except RuntimeError:
            sensor.close()
            raise
        self._streaming, self._syncer = sensor, syncer

    def stop_stream(self) -> None:
        sensor, self._streaming, self._syncer = self._streaming, None, None
        if sensor is not None:
            try:
                sensor.stop()
            finally:
                sensor.close()

    def next_picture(self, limit_s: float) -> RawPicture | None:
        """The next picture; of Depth with the infrared picture of the same moment as a part."""
        _, profiles = self._profiles()
        ends_s, partial = time.monotonic() + limit_s, False
        while (left_s := ends_s - time.monotonic()) > 0:
            came, frames = self._syncer.try_wait_for_frames(max(1, round(left_s * 1e3)))
            found = [frames.first_or_default(profile.stream_type()) for profile in profiles] if came else []
            if came and all(found):
                first, *others = map(_copy, found)
                return replace(first, parts=tuple(others))
            partial = partial or came  # the sensor's streams begin one after the other
        return RawPicture(np.empty(0, np.uint8), 0, 0, 0, complete=False) if partial else None

    def close(self) -> None:
        self.stop_stream()

    def intrinsics(self) -> Any:
        """librealsense's intrinsics of the stream."""
        return self._profiles()[1][0].as_video_stream_profile().get_intrinsics()

    def serial(self) -> str:
        return str(self._device.get_info(self._rs.camera_info.serial_number))

    def stream(self) -> str:
        return self._chosen["Stream"]

    def pixel_format(self) -> str:
        return {"z16": "Coord3D_C16", "y8": "Mono8", "rgb8": "RGB8", "bgr8": "BGR8"}[
            self._profiles()[1][0].format().name
        ]

    def depth_unit_mm(self) -> float:
        sensor, _ = self._profiles()
        return 1000.0 * float(sensor.get_option(self._rs.option.depth_units))

    def _profiles(self) -> tuple[Any, list[Any]]:
        """The sensor, and its profiles of the stream chosen: the largest and fastest of the wanted size."""
        name, index = STREAMS[self._chosen["Stream"]]
        wanted = [(name, index)] if name != "depth" else [(name, index), STREAMS["Infrared"]]
        for sensor in self._device.query_sensors():
            chosen = [self._profile(sensor, *one) for one in wanted]
            if chosen[0] is not None:
                first = chosen[0].as_video_stream_profile()
                size = (first.width(), first.height())
                beside = [self._profile(sensor, *one, size, first.fps()) for one in wanted[1:]]
                return sensor, [chosen[0], *(one for one in beside if one is not None)]
        raise VendorError(f"the camera has no stream {self._chosen}")

    def _profile(
        self, sensor: Any, name: str, index: int, size: tuple[int, int] | None = None, fps: int | None = None
    ) -> Any:
        """The largest and fastest profile of a stream, or None."""
        width, height = size or (int(self._chosen.get("Width", 0)), int(self._chosen.get("Height", 0)))
        found = []
        for profile in sensor.get_stream_profiles():
            if profile.stream_type() != getattr(self._rs.stream, name) or profile.format().name not in FORMATS:
                continue
            if profile.stream_index() != index:
                continue
            video = profile.as_video_stream_profile()
            if width in (0, video.width()) and height in (0, video.height()) and fps in (None, video.fps()):
                found.append((video.width() * video.height(), video.fps(), profile))
        return max(found, key=lambda one: one[:2], default=(0, 0, None))[2]

    def _require_option(self, feature: str) -> tuple[Any, Any, float]:
        found = self._option(feature)
        if found is None:
            raise VendorError(f"the camera has no {feature}")
        return found

    def _option(self, feature: str) -> tuple[Any, Any, float] | None:
        """The sensor, its option and the option's unit; None where the sensor does not have it."""
        sensor, _ = self._profiles()
        for name in OPTIONS.get(feature, ()):
            option = getattr(self._rs.option, name)
            if sensor.supports(option):
                in_100_us = feature == "ExposureTime" and self._chosen["Stream"] == "Color"
                return sensor, option, COLOUR_EXPOSURE_US if in_100_us else 1.0
        return None


OPTIONS = {
    "ExposureTime": ("exposure",),
    "ExposureAuto": ("enable_auto_exposure",),
    "DeviceTemperature": ("asic_temperature", "projector_temperature"),
}
"""librealsense's options by SFNC's names. Its gain has no unit in dB, and is left as it is."""

LENS: dict[str, Callable[[OpenRealSense], str]] = {
    "Scan3dFocalLength": lambda camera: f"{camera.intrinsics().fx:.9g}",
    "Scan3dAspectRatio": lambda camera: f"{camera.intrinsics().fy / camera.intrinsics().fx:.9g}",
    "Scan3dPrincipalPointU": lambda camera: f"{camera.intrinsics().ppx:.9g}",
    "Scan3dPrincipalPointV": lambda camera: f"{camera.intrinsics().ppy:.9g}",
}
SOFTWARE: dict[str, Callable[[OpenRealSense], str]] = {
    "DeviceSerialNumber": OpenRealSense.serial,
    "Stream": OpenRealSense.stream,
    "Width": lambda camera: str(camera.intrinsics().width),
    "Height": lambda camera: str(camera.intrinsics().height),
    "PixelFormat": OpenRealSense.pixel_format,
    "Scan3dOutputMode": lambda camera: "ProjectedC",
    "Scan3dCoordinateScale": lambda camera: f"{camera.depth_unit_mm():.9g}",
    "Scan3dInvalidDataFlag": lambda camera: "1",
    "Scan3dInvalidDataValue": lambda camera: "0",
    **LENS,
}
"""Features that no option of librealsense is: how each is read."""


def _copy(frame: Any) -> RawPicture:
    video = frame.as_video_frame()
    data = np.frombuffer(np.ascontiguousarray(np.asanyarray(frame.get_data())).tobytes(), np.uint8)
    code = FORMATS[frame.get_profile().format().name]
    return RawPicture(
        data, code, video.get_width(), video.get_height(), device_time_ns=round(frame.get_timestamp() * 1e6)
    )


def _found(rs: Any, serial: str, device: Any) -> FoundCamera:
    name, address = "RealSense", "USB"
    with suppress(RuntimeError):
        name = device.get_info(rs.camera_info.name)
    with suppress(RuntimeError):
        address = device.get_info(rs.camera_info.physical_port)
    return FoundCamera("RealSense", name.removeprefix("Intel RealSense "), serial, address, key=serial)
