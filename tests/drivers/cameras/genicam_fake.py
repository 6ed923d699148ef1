"""A GenICam library in memory: cameras with features, pictures on request, and the faults of cables and networks."""

import threading
from dataclasses import dataclass, field

import numpy as np

from drivers.cameras.genicam.device import FoundCamera, RawPicture, VendorError
from drivers.errors import DeviceTaken

MONO8, MONO12 = 0x01080001, 0x01100005
BOUNDS = {"ExposureTime": (10.0, 1e6), "Gain": (0.0, 24.0), "GevSCPSPacketSize": (576.0, 9000.0)}
CHOICES = {
    "PixelFormat": ("Mono8", "Mono12"),
    "TriggerSelector": ("FrameStart",),
    "TriggerSource": ("Software", "Line1"),
    "TriggerMode": ("Off", "On"),
    "ExposureAuto": ("Off", "Continuous"),
}


def features() -> dict[str, str]:
    return {
        "Width": "64",
        "PixelFormat": "Mono8",
        "TriggerSelector": "FrameStart",
        "TriggerSource": "Line1",
        "TriggerMode": "Off",
        "TriggerSoftware": "",
        "ExposureAuto": "Continuous",
        "ExposureTime": "1000",
        "Gain": "0",
        "GevSCPSPacketSize": "1500",
        "DeviceTemperature": "41.5",
    }


@dataclass
class FakeDevice:
    """One camera: `shade` of its pictures, and what is wrong with it."""

    found: FoundCamera = field(default_factory=lambda: FoundCamera("Acme", "M1", "S1", "10.0.0.1", "acme-S1"))
    features: dict[str, str] = field(default_factory=features)
    shade: int = 90
    present: bool = True
    taken: bool = False
    stalled: bool = False
    incomplete: int = 0
    format_code: int | None = None
    opened: int = 0
    hung: threading.Event | None = None
    streaming: bool = False
    queue: list[int] = field(default_factory=list)


class FakeLibrary:
    """drivers.cameras.genicam.device.Library of these devices."""

    def __init__(self, *devices: FakeDevice) -> None:
        self.devices = devices

    def discover(self):
        return [device.found for device in self.devices if device.present]

    def open(self, camera):
        device = next(device for device in self.devices if device.found is camera)
        if device.taken:
            raise DeviceTaken("camera", f"{camera} is controlled by another program")
        device.opened += 1
        return FakeOpenCamera(device)


class FakeOpenCamera:
    """drivers.cameras.genicam.device.OpenCamera."""

    def __init__(self, device: FakeDevice) -> None:
        self._device = device

    def _require_present(self):
        if self._device.hung is not None:
            self._device.hung.wait()
        if not self._device.present:
            raise VendorError("the device has been removed")

    def has(self, feature):
        self._require_present()
        return feature in self._device.features

    def read(self, feature):
        self._require_present()
        return self._device.features[feature]

    def write(self, feature, value):
        self._require_present()
        if value not in CHOICES.get(feature, (value,)):
            raise VendorError(f"{value} is not a value of {feature}")
        low, high = BOUNDS.get(feature, (-np.inf, np.inf))
        if feature in BOUNDS and not low <= float(value) <= high:
            raise VendorError(f"{value} is out of range")
        self._device.features[feature] = value

    def bounds(self, feature):
        if feature not in BOUNDS:
            raise VendorError("no number")
        return BOUNDS[feature]

    def choices(self, feature):
        if feature not in CHOICES:
            raise VendorError("no enumeration")
        return CHOICES[feature]

    def execute(self, feature):
        self._require_present()
        if self._device.streaming and not self._device.stalled:
            self._device.queue.append(self._device.shade)

    def is_lost(self):
        return not self._device.present

    def start_stream(self):
        self._require_present()
        self._device.streaming = True
        self._device.queue.clear()
        if self._device.features.get("TriggerMode") != "On" and not self._device.stalled:
            self._device.queue.append(self._device.shade)

    def stop_stream(self):
        self._device.streaming = False

    def next_picture(self, limit_s):
        self._require_present()
        if not self._device.queue:
            threading.Event().wait(min(limit_s, 0.01))
            return None
        shade = self._device.queue.pop(0)
        if self._device.incomplete:
            self._device.incomplete -= 1
            return RawPicture(np.empty(0, np.uint8), 0, 0, 0, complete=False)
        if self._device.format_code is not None:
            return RawPicture(np.full(64 * 48, shade, np.uint8), self._device.format_code, 64, 48)
        if self._device.features["PixelFormat"] == "Mono12":
            data = np.full(64 * 48, shade * 16, "<u2").view(np.uint8)
            return RawPicture(data, MONO12, 64, 48, device_time_ns=7)
        return RawPicture(np.full(64 * 48, shade, np.uint8), MONO8, 64, 48)

    def close(self):
        self._device.streaming = False
