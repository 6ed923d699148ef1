"""An open GenICam camera: its settings by the standard's feature names (SFNC 2.7), and one picture at a time.

Blocking; every call is made in the camera's thread. Names of SFNC 1.x follow the present ones in each table.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import numpy as np

from drivers.cameras.genicam.address import CameraAddress
from drivers.cameras.genicam.device import FoundCamera, OpenCamera, RawPicture, VendorError
from drivers.cameras.genicam.pixel_formats import FORMATS, find_format, read_pixels
from drivers.cameras.genicam.scan3d import (
    COORDINATES,
    SCAN3D_LENS,
    SCAN3D_WORDS,
    Coordinate,
    RangeImage,
    Scan3d,
    points_of,
    read_scan3d,
)
from drivers.cameras.pixel_depth import to_8_bit
from drivers.errors import (
    DeviceError,
    DeviceOverheated,
    GarbledAnswer,
    IncompletePicture,
    LinkLost,
    SettingRefused,
    StreamStalled,
    WrongDevice,
)
from drivers.interfaces import CameraFrame, CaptureSettings, DeviceIdentity, Exposure, ExposureRange

EXPOSURE_US = ("ExposureTime", "ExposureTimeAbs")
GAIN_DB = ("Gain",)
TEMPERATURE_C = ("DeviceTemperature", "DeviceTemperatureAbs", "TemperatureAbs")
TEMPERATURE_STATE = ("TemperatureState", "BslTemperatureStatus")
TOO_HOT = "Error"
"""Value of a Basler's temperature state at which it stops working."""
PACKET_BYTES = ("GevSCPSPacketSize",)
SERIAL = ("DeviceSerialNumber", "DeviceID")
AUTOMATIC = ("ExposureAuto", "GainAuto", "GainRawAuto")
MAX_TRIES = 3
"""Pictures asked for again when one is incomplete."""
MIN_TRIGGER_WAIT_S = 0.3
"""Wait beside twice the exposure before a trigger is repeated."""
NETWORK_FIX = "check cable and switch; it is opened again by itself"
MAX_EXPOSURE_CHANGE = 0.05
"""Relative; cameras round an exposure time to the lines of their sensors."""


TRUE = ("1", "true", "True")
"""A Boolean feature that is set, as the libraries write it."""

Answer = TypeVar("Answer")


class CameraSession:
    """One open camera. A DeviceError leaves no stream running, so that no old picture is received later."""

    def __init__(
        self, device: str, found: FoundCamera, camera: OpenCamera, address: CameraAddress, clock: Callable[[], float]
    ) -> None:
        self._device, self._found, self._camera, self._clock = device, found, camera, clock
        self._streaming = False
        self._by_software = False
        self._max_temperature_c = address.max_temperature_c
        self._exposure_us: float | None = None
        self._configure(address)

    @property
    def name(self) -> str:
        """Vendor, model and serial number."""
        return str(self._found)

    def take(self, limit_s: float) -> CameraFrame:
        """A frame exposed after this call.

        Raises StreamStalled, IncompletePicture, GarbledAnswer, DeviceOverheated, SettingRefused for an exposure that
        another program has changed, and LinkLost.
        """
        return self._take(limit_s, self._frame)

    def take_cloud(self, limit_s: float) -> RangeImage:
        """A cloud exposed after this call: coordinates, and the intensity where the camera sends it.

        Raises as `take`, GarbledAnswer for a picture without coordinates, and SettingRefused for another output mode.
        """
        return self._take(limit_s, self._range_image)

    def check(self) -> None:
        """Raises LinkLost when the camera does not answer any more."""
        try:
            lost = self._camera.is_lost()
        except VendorError as error:
            raise self._lost(error) from error
        if lost:
            raise self._lost(None)

    def identity(self) -> DeviceIdentity:
        """Who it is, and what of the driver's settings it has."""
        has = {
            "exposure": self._feature(EXPOSURE_US),
            "gain in dB": self._feature(GAIN_DB),
            "software trigger": "x" if self._by_software else None,
            "packet size": self._feature(PACKET_BYTES),
            "temperature": self._feature(TEMPERATURE_C),
        }
        abilities = tuple(name for name, feature in has.items() if feature)
        formats = self._camera.choices("PixelFormat") if self._camera.has("PixelFormat") else ()
        found = self._found
        lens = self._lens_words()
        return DeviceIdentity(found.vendor, found.model, found.serial, found.address, (*abilities, *formats, *lens))

    def read_exposure(self) -> tuple[Exposure, ExposureRange] | None:
        """What is set and what can be; None without the feature. Raises LinkLost."""
        try:
            exposure, gain = self._feature(EXPOSURE_US), self._feature(GAIN_DB)
            if exposure is None:
                return None
            now = Exposure(self._number(exposure), self._number(gain) if gain else 0.0)
            gains = self._camera.bounds(gain) if gain else (0.0, 0.0)
            return now, ExposureRange(self._camera.bounds(exposure), gains)
        except VendorError as error:
            raise self._lost(error) from error

    def set_exposure(self, wanted: Exposure) -> Exposure:
        """Set both within the camera's range. Raises SettingRefused, LinkLost."""
        state = self.read_exposure()
        if state is None:
            raise SettingRefused(self._device, "the camera has no exposure time", "set the light instead")
        _, limits = state
        self._write_first(EXPOSURE_US, f"{min(max(wanted.exposure_us, limits.exposure_us[0]), limits.exposure_us[1])}")
        if self._feature(GAIN_DB):
            self._write_first(GAIN_DB, f"{min(max(wanted.gain_db, limits.gain_db[0]), limits.gain_db[1])}")
        self._note_exposure()
        state = self.read_exposure()
        return wanted if state is None else state[0]

    def close(self) -> None:
        """Stop and close; nothing is raised."""
        self._drop_stream()
        with suppress(VendorError):
            self._camera.close()

    def _configure(self, address: CameraAddress) -> None:
        serial = next((self._camera.read(name) for name in SERIAL if self._camera.has(name)), self._found.serial)
        if address.serial is not None and address.serial not in (serial, self._found.serial):
            what = (
                f"the camera at {address.name or self._found.address} has serial number {self._found.serial or serial}"
            )
            raise WrongDevice(self._device, f"{what}, not {address.serial}", "correct the address, or the cabling")
        for feature, value in address.features:
            self._write(feature, value)
        if address.pixel_format is not None:
            self._write("PixelFormat", address.pixel_format)
        if address.packet_bytes is not None:
            self._write_first(PACKET_BYTES, str(address.packet_bytes))
        for feature in AUTOMATIC:
            if self._camera.has(feature) and "Off" in self._camera.choices(feature):
                self._write(feature, "Off")
        if address.exposure_us is not None:
            self._write_first(EXPOSURE_US, str(address.exposure_us))
        if address.gain_db is not None:
            self._write_first(GAIN_DB, str(address.gain_db))
        self._configure_trigger(address.trigger)
        self._note_exposure()

    def _configure_trigger(self, trigger: str | None) -> None:
        has_software = self._camera.has("TriggerSoftware") and "Software" in self._choices("TriggerSource")
        if trigger is None:
            trigger = "software" if has_software else "off"
        self._by_software = trigger == "software"
        if trigger == "off":
            if self._camera.has("TriggerMode"):
                self._write("TriggerMode", "Off")
            return
        if "FrameStart" in self._choices("TriggerSelector"):
            self._write("TriggerSelector", "FrameStart")
        self._write("TriggerSource", "Software" if self._by_software else trigger)
        self._write("TriggerMode", "On")

    def _take(self, limit_s: float, read: Callable[[RawPicture, float], Answer]) -> Answer:
        """What `read` makes of a whole picture and the time it was asked for. Leaves no stream running on an error."""
        try:
            return self._take_whole(limit_s, read)
        except VendorError as error:
            self._drop_stream()
            raise self._lost(error) from error
        except DeviceError:
            self._drop_stream()
            raise

    def _take_whole(self, limit_s: float, read: Callable[[RawPicture, float], Answer]) -> Answer:
        deadline_s = self._clock() + limit_s
        for _ in range(MAX_TRIES):
            if not self._by_software:
                self._drop_stream()
            asked_at_s = self._clock()
            if not self._streaming:
                self._camera.start_stream()
                self._streaming = True
            picture = self._triggered(deadline_s) if self._by_software else self._next(deadline_s)
            if picture is None:
                self.check()
                raise StreamStalled(
                    self._device,
                    f"the camera is connected and has sent no picture in {limit_s:g} s",
                    "check its trigger, the network's packet size and the firewall; the stream is started again",
                )
            if picture.complete:
                answer = read(picture, asked_at_s)
                if not self._by_software:
                    self._drop_stream()
                return answer
            self._drop_stream()
        raise IncompletePicture(self._device, f"parts of {MAX_TRIES} pictures in succession are missing")

    def _next(self, deadline_s: float) -> RawPicture | None:
        return self._camera.next_picture(max(0.0, deadline_s - self._clock()))

    def _triggered(self, deadline_s: float) -> RawPicture | None:
        """The picture of a trigger by software, repeated while none comes: cameras ignore one that comes too early.

        After a repetition a second picture may be on its way, so the stream ends with the first.
        """
        exposure = self._feature(EXPOSURE_US)
        patience_s = MIN_TRIGGER_WAIT_S + (2e-6 * self._number(exposure) if exposure else 0.0)
        repeated = False
        while True:
            self._camera.execute("TriggerSoftware")
            picture = self._next(min(deadline_s, self._clock() + patience_s))
            if picture is not None or self._clock() >= deadline_s:
                if repeated:
                    self._drop_stream()
                return picture
            repeated = True

    def _frame(self, picture: RawPicture, taken_at_s: float) -> CameraFrame:
        pixels = find_format(self._device, picture.format_code)
        image = read_pixels(self._device, pixels, picture.data, picture.width, picture.height, picture.padding)
        capture = CaptureSettings(
            bits=pixels.bits,
            pixel_format=pixels.name,
            exposure_us=self._first_number(EXPOSURE_US),
            gain_db=self._first_number(GAIN_DB),
            temperature_c=self._first_number(TEMPERATURE_C),
            device_time_ns=picture.device_time_ns,
        )
        self._require_cool(capture.temperature_c)
        self._require_exposure(capture.exposure_us)
        levels = None if image.dtype == np.uint8 else image
        return CameraFrame(to_8_bit(image, pixels.white), taken_at_s, capture=capture, levels=levels)

    def _range_image(self, picture: RawPicture, taken_at_s: float) -> RangeImage:
        self._require_cool(self._first_number(TEMPERATURE_C))
        self._require_exposure(self._first_number(EXPOSURE_US))
        components = (picture, *picture.parts)
        coordinates = next((part for part in components if part.format_code in COORDINATES), None)
        if coordinates is None:
            what = f"{self.name} sends no coordinates, but pixels of the format 0x{picture.format_code:08x}"
            raise GarbledAnswer(
                self._device, what, "enable its component Range: ?ComponentSelector=Range&ComponentEnable=1"
            )
        size = (coordinates.width, coordinates.height)
        intensity = next((p for p in components if p.format_code in FORMATS and (p.width, p.height) == size), None)
        points_mm = points_of(self._device, self._read_scan3d(), coordinates)
        if intensity is None:
            return RangeImage(points_mm, taken_at_s)
        pixels = FORMATS[intensity.format_code]
        image = read_pixels(self._device, pixels, intensity.data, *size, intensity.padding)
        return RangeImage(points_mm, taken_at_s, image)

    def _lens_words(self) -> tuple[str, ...]:
        """The intrinsics that the camera itself reports."""
        if not all(map(self._camera.has, SCAN3D_LENS)):
            return ()
        focal_px, aspect, u_px, v_px = map(self._number, SCAN3D_LENS)
        y_px = "" if abs(aspect - 1) < 1e-6 else f" (across), {focal_px * aspect:.1f} px (down)"
        return (f"focal length {focal_px:.1f} px{y_px}, principal point ({u_px:.1f}, {v_px:.1f})",)

    def _read_scan3d(self) -> Scan3d:
        """The features that turn the camera's numbers into mm."""
        axes = []
        for axis in ("CoordinateA", "CoordinateB", "CoordinateC"):
            if axis in self._choices("Scan3dCoordinateSelector"):
                self._write("Scan3dCoordinateSelector", axis)
            low, high = self._optional_number("Scan3dAxisMin"), self._optional_number("Scan3dAxisMax")
            flagged = self._camera.has("Scan3dInvalidDataFlag") and self._camera.read("Scan3dInvalidDataFlag") in TRUE
            axes.append(
                Coordinate(
                    self._optional_number("Scan3dCoordinateScale", 1.0),
                    self._optional_number("Scan3dCoordinateOffset"),
                    self._optional_number("Scan3dInvalidDataValue") if flagged else None,
                    (low, high) if low < high else None,
                )
            )
        words = {name: self._camera.read(name) for name in SCAN3D_WORDS if self._camera.has(name)}
        lens = [self._optional_number(name, default) for name, default in SCAN3D_LENS.items()]
        return read_scan3d(self._device, words, (axes[0], axes[1], axes[2]), lens)

    def _optional_number(self, feature: str, default: float = 0.0) -> float:
        return self._number(feature) if self._camera.has(feature) else default

    def _feature(self, names: tuple[str, ...]) -> str | None:
        return next((name for name in names if self._camera.has(name)), None)

    def _number(self, feature: str) -> float:
        return float(self._camera.read(feature))

    def _first_number(self, names: tuple[str, ...]) -> float | None:
        feature = self._feature(names)
        return self._number(feature) if feature else None

    def _note_exposure(self) -> None:
        """Remember the exposure time as the camera has taken it."""
        self._exposure_us = self._first_number(EXPOSURE_US)

    def _require_cool(self, temperature_c: float | None) -> None:
        state = self._feature(TEMPERATURE_STATE)
        too_hot = state is not None and self._camera.read(state) == TOO_HOT
        if self._max_temperature_c is not None and temperature_c is not None:
            too_hot = too_hot or temperature_c > self._max_temperature_c
        if too_hot:
            at = "" if temperature_c is None else f" at {temperature_c:.0f} °C"
            raise DeviceOverheated(self._device, f"{self.name} is too hot{at}", "cool it, and mount it on metal")

    def _require_exposure(self, exposure_us: float | None) -> None:
        """The exposure is the one that was set: another one changes noise and the places of edges."""
        expected_us = self._exposure_us
        if expected_us is None or exposure_us is None or expected_us <= 0:
            return
        if abs(exposure_us / expected_us - 1) > MAX_EXPOSURE_CHANGE:
            what = f"{self.name} exposes for {exposure_us:g} us, {expected_us:g} us were set"
            raise SettingRefused(self._device, what, "end the program that changes it, or restart the device")

    def _choices(self, feature: str) -> tuple[str, ...]:
        return self._camera.choices(feature) if self._camera.has(feature) else ()

    def _write_first(self, names: tuple[str, ...], value: str) -> None:
        self._write(self._feature(names) or names[0], value)

    def _write(self, feature: str, value: str) -> None:
        """Raises SettingRefused with what the camera would accept."""
        try:
            if not self._camera.has(feature):
                raise SettingRefused(
                    self._device, f"{self.name} has no {feature}", "leave the option out, or correct its name"
                )
            self._camera.write(feature, value)
        except VendorError as error:
            what = f"{self.name} refuses {feature} = {value} ({error})"
            raise SettingRefused(self._device, what, f"write {self._accepted(feature)}") from error

    def _accepted(self, feature: str) -> str:
        with suppress(VendorError):
            if choices := self._camera.choices(feature):
                return "one of " + ", ".join(choices)
        try:
            low, high = self._camera.bounds(feature)
        except VendorError:
            return "another value, see the camera's manual"
        return f"a number from {low:g} to {high:g}"

    def _drop_stream(self) -> None:
        if self._streaming:
            self._streaming = False
            with suppress(VendorError):
                self._camera.stop_stream()

    def _lost(self, error: VendorError | None) -> LinkLost:
        reason = f" ({error})" if error else ""
        return LinkLost(self._device, f"{self.name} does not answer any more{reason}", NETWORK_FIX)
