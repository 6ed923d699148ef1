"""Cameras of any vendor over its GenTL producer (.cti), by harvesters (the extra `genicam`)."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from drivers.cameras.genicam.device import FoundCamera, RawPicture, import_library, raises_vendor_errors
from drivers.errors import DeviceTaken, DeviceUnreachable

PRODUCERS = "GENICAM_GENTL64_PATH"
"""Folders of producers, as GenTL 1.6 section 6.1.1 says; vendors' installers set it."""
HELD = frozenset({3, 4, 5, 6})
"""DEVICE_ACCESS_STATUS of GenTL 1.6 without the right to control: no access, busy, open elsewhere."""

PART_IMAGES = frozenset({1, 5, 9})
"""PARTDATATYPE_IDS of GenTL 1.6: an image, an image of coordinates, a confidence map."""


def _errors() -> tuple[type[Exception], ...]:
    from genicam import genapi, gentl

    return genapi.GenericException, gentl.GenericException, AttributeError, ValueError, OSError


@raises_vendor_errors(_errors)
class HarvestersLibrary:
    """drivers.cameras.genicam.device.Library. A process loads a producer once, until its camera is closed."""

    def __init__(self, producer: str | None = None) -> None:
        self._producer = producer
        self._harvester: Any = None

    def discover(self) -> list[FoundCamera]:
        """Cameras of the producers. Raises LibraryMissing, DeviceUnreachable without a producer, VendorError."""
        core = import_library("harvesters.core", "genicam")
        files = self._files()
        if self._harvester is None:
            self._harvester = core.Harvester()
            for file in files:
                self._harvester.add_file(str(file))
        self._harvester.update()
        return [_found(info) for info in self._harvester.device_info_list]

    def open(self, camera: FoundCamera) -> "OpenGenTLCamera":
        """Open for control. Raises DeviceTaken, VendorError."""
        core = import_library("harvesters.core", "genicam")
        try:
            acquirer = self._harvester.create({"id_": camera.key})
        except Exception as error:
            if "AccessDenied" in type(error).__name__ or "ResourceInUse" in type(error).__name__:
                what = f"{camera} is controlled by another program"
                raise DeviceTaken(f"camera genicam:{camera.serial}", what) from error
            raise
        return OpenGenTLCamera(core, acquirer, self.release)

    def release(self) -> None:
        """Unload the producers."""
        if self._harvester is not None:
            harvester, self._harvester = self._harvester, None
            harvester.reset()

    def _files(self) -> list[Path]:
        if self._producer is not None:
            if not Path(self._producer).is_file():
                raise DeviceUnreachable(
                    "camera genicam:", f"there is no producer {self._producer}", "correct `producer` in the address"
                )
            return [Path(self._producer)]
        folders = [Path(folder) for folder in os.environ.get(PRODUCERS, "").split(os.pathsep) if folder]
        files = [file for folder in folders for file in sorted(folder.glob("*.cti"))]
        if not files:
            raise DeviceUnreachable(
                "camera genicam:",
                "there is no GenTL producer",
                f"install the vendor's, which sets {PRODUCERS}, or write ?producer=/path/file.cti",
            )
        return files


@raises_vendor_errors(_errors)
class OpenGenTLCamera:
    """drivers.cameras.genicam.device.OpenCamera."""

    def __init__(self, core: Any, acquirer: Any, release: Any) -> None:
        self._acquirer, self._release = acquirer, release
        self._nodes = acquirer.remote_device.node_map
        self._incomplete = _Counter(core)
        acquirer.add_callback(acquirer.Events.INCOMPLETE_BUFFER, self._incomplete.callback)

    def has(self, feature: str) -> bool:
        from genicam.genapi import EAccessMode

        if not self._nodes.has_node(feature):
            return False
        mode = self._nodes.get_node(feature).node.get_access_mode()
        return mode in (EAccessMode.RO, EAccessMode.RW, EAccessMode.WO)

    def read(self, feature: str) -> str:
        return str(self._nodes.get_node(feature).to_string())

    def write(self, feature: str, value: str) -> None:
        self._nodes.get_node(feature).from_string(value)

    def bounds(self, feature: str) -> tuple[float, float]:
        node = self._nodes.get_node(feature)
        return float(node.min), float(node.max)

    def choices(self, feature: str) -> tuple[str, ...]:
        return tuple(self._nodes.get_node(feature).symbolics)

    def execute(self, feature: str) -> None:
        self._nodes.get_node(feature).execute()

    def is_lost(self) -> bool:
        self._nodes.get_node("Width").get_value(False, True)
        return False

    def start_stream(self) -> None:
        self._acquirer.start()

    def stop_stream(self) -> None:
        self._acquirer.stop()

    def next_picture(self, limit_s: float) -> RawPicture | None:
        incomplete_before = self._incomplete.count
        buffer = self._acquirer.try_fetch(timeout=max(0.001, limit_s), is_raw=True)
        if buffer is None:
            incomplete = self._incomplete.count > incomplete_before
            return RawPicture(np.empty(0, np.uint8), 0, 0, 0, complete=False) if incomplete else None
        try:
            return self._copy(buffer)
        finally:
            buffer.parent.queue_buffer(buffer)

    def close(self) -> None:
        try:
            self._acquirer.destroy()
        finally:
            self._release()

    def _copy(self, buffer: Any) -> RawPicture:
        if parts := [part for part in _optional(lambda: list(buffer.parts)) or () if part.data_type in PART_IMAGES]:
            time_ns = _optional(lambda: buffer.timestamp_ns)
            first, *others = (_copy_part(buffer, part, time_ns) for part in parts)
            return replace(first, parts=tuple(others))
        code = _optional(lambda: buffer.pixel_format) or self._nodes.get_node("PixelFormat").get_int_value()
        width = _optional(lambda: buffer.width) or int(self.read("Width"))
        height = _optional(lambda: buffer.height) or int(self.read("Height"))
        start = _optional(lambda: buffer.image_offset) or 0
        data = np.frombuffer(buffer.raw_buffer, np.uint8)[start:].copy()
        time_ns = _optional(lambda: buffer.timestamp_ns)
        return RawPicture(data, code, width, height, _optional(lambda: buffer.padding_x) or 0, time_ns)


def _copy_part(buffer: Any, part: Any, time_ns: int | None) -> RawPicture:
    """One component of a multi-part buffer (GenTL 1.6, section 6.6.8)."""
    start = part.data_offset
    data = np.frombuffer(buffer.raw_buffer, np.uint8)[start : start + part.data_size].copy()
    return RawPicture(data, part.data_format, part.width, part.height, part.x_padding or 0, time_ns)


class _Counter:
    """Counts incomplete buffers, which harvesters drops."""

    def __init__(self, core: Any) -> None:
        self.count = 0
        counter = self

        class Count(core.Callback):  # type: ignore[misc]
            def emit(self, context: Any) -> None:
                counter.count += 1

        self.callback = Count()


def _optional(read: Any) -> Any:
    """What a producer tells of a buffer; None where it does not."""
    from genicam import gentl

    try:
        return read()
    except gentl.GenericException:
        return None


def _found(info: Any) -> FoundCamera:
    return FoundCamera(
        info.vendor,
        info.model,
        _optional(lambda: info.serial_number) or "",
        _optional(lambda: info.display_name) or info.id_,
        key=info.id_,
        user_name=_optional(lambda: info.user_defined_name) or "",
        free=(_optional(lambda: info.access_status) or 0) not in HELD,
    )
