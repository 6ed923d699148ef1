"""Basler cameras over pypylon (the extra `basler`), whose wheel contains the pylon runtime."""

from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from drivers.cameras.genicam.device import FoundCamera, RawPicture, import_library, raises_vendor_errors
from drivers.errors import DeviceTaken

BUFFERS = 4


def _errors() -> tuple[type[Exception], ...]:
    return _import_pylon().GenericException, AttributeError  # a node of another kind lacks the method


@raises_vendor_errors(_errors)
class PylonLibrary:
    """drivers.cameras.genicam.device.Library."""

    def discover(self) -> list[FoundCamera]:
        """Cameras of every transport layer that pylon has. Raises LibraryMissing, VendorError."""
        pylon = _import_pylon()
        return [_found(info) for info in pylon.TlFactory.GetInstance().EnumerateDevices()]

    def open(self, camera: FoundCamera) -> "OpenPylonCamera":
        """Open for control. Raises DeviceTaken, LibraryMissing, VendorError."""
        pylon = _import_pylon()
        factory = pylon.TlFactory.GetInstance()
        info = pylon.DeviceInfo()
        info.SetFullName(camera.key)
        accessible = factory.IsDeviceAccessible(info, pylon.DeviceAccessMode_Control)
        if isinstance(accessible, tuple):
            accessible = accessible[0]
        if not accessible:
            raise DeviceTaken(f"camera basler:{camera.serial}", f"{camera} is controlled by another program")
        device = pylon.InstantCamera(factory.CreateDevice(info))
        device.Open()
        device.MaxNumBuffer.Value = BUFFERS
        return OpenPylonCamera(pylon, device)


@raises_vendor_errors(_errors)
class OpenPylonCamera:
    """drivers.cameras.genicam.device.OpenCamera."""

    def __init__(self, pylon: Any, camera: Any) -> None:
        from pypylon.genicam import IsAvailable

        self._pylon, self._camera, self._available = pylon, camera, IsAvailable
        self._nodes = camera.GetNodeMap()

    def has(self, feature: str) -> bool:
        return bool(self._available(self._nodes.GetNode(feature)))

    def read(self, feature: str) -> str:
        return str(self._nodes.GetNode(feature).ToString())

    def write(self, feature: str, value: str) -> None:
        self._nodes.GetNode(feature).FromString(value)

    def bounds(self, feature: str) -> tuple[float, float]:
        node = self._nodes.GetNode(feature)
        return float(node.Min), float(node.Max)

    def choices(self, feature: str) -> tuple[str, ...]:
        return tuple(self._nodes.GetNode(feature).Symbolics)

    def execute(self, feature: str) -> None:
        self._nodes.GetNode(feature).Execute()

    def is_lost(self) -> bool:
        return bool(self._camera.IsCameraDeviceRemoved())

    def start_stream(self) -> None:
        self._camera.StartGrabbing(self._pylon.GrabStrategy_OneByOne)

    def stop_stream(self) -> None:
        self._camera.StopGrabbing()

    def next_picture(self, limit_s: float) -> RawPicture | None:
        result = self._camera.RetrieveResult(max(1, round(limit_s * 1e3)), self._pylon.TimeoutHandling_Return)
        if not result.IsValid():
            return None
        try:
            if not result.GrabSucceeded():
                return RawPicture(np.empty(0, np.uint8), 0, 0, 0, complete=False)
            data = np.frombuffer(result.GetBuffer(), np.uint8).copy()
            width, height, code = result.GetWidth(), result.GetHeight(), result.GetPixelType()
            return RawPicture(data, code, width, height, result.GetPaddingX(), result.GetTimeStamp() or None)
        finally:
            result.Release()

    def close(self) -> None:
        self._camera.Close()
        self._camera.DestroyDevice()


def _import_pylon() -> Any:
    with catch_warnings():  # its SWIG wrapper ends the process where a DeprecationWarning of its types is an error
        simplefilter("ignore", DeprecationWarning)
        return import_library("pypylon.pylon", "basler")


def _found(info: Any) -> FoundCamera:
    address = info.GetIpAddress() if info.IsIpAddressAvailable() else info.GetDeviceClass()
    return FoundCamera(
        info.GetVendorName(),
        info.GetModelName(),
        info.GetSerialNumber(),
        address,
        key=info.GetFullName(),
        user_name=info.GetUserDefinedName() if info.IsUserDefinedNameAvailable() else "",
    )
