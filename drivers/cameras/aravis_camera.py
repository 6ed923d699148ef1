"""GigE Vision and USB3 Vision cameras of any vendor over aravis 0.8 (Debian's libaravis-0.8-0)."""

import numpy as np

from drivers.cameras.genicam.aravis_library import Aravis, Handle
from drivers.cameras.genicam.device import FoundCamera, RawPicture, VendorError
from drivers.errors import DeviceTaken
from drivers.transports.late_address import is_address

BUFFERS = 4
PROTOCOLS = ("GigEVision", "USB3Vision")
SUCCESS = 0
"""ArvBufferStatus of a whole picture."""


class AravisLibrary:
    """drivers.cameras.genicam.device.Library. `name`: the camera's in the address."""

    def __init__(self, name: str = "") -> None:
        self._name = name

    def discover(self) -> list[FoundCamera]:
        """Cameras that answer on any interface; asked twice for one by name, whose datagram may be lost.

        Raises LibraryMissing.
        """
        aravis = Aravis()
        found = _answering(aravis)
        if self._name and not any(camera.is_named(self._name) for camera in found):
            if is_address(self._name):
                return [*found, FoundCamera("", "camera", "unknown", self._name, self._name)]
            found = _answering(aravis)
        return found

    def open(self, camera: FoundCamera) -> "OpenAravisCamera":
        """Open for control. Raises DeviceTaken, LibraryMissing, VendorError."""
        aravis = Aravis()
        key = camera.address if is_address(camera.address) else camera.key
        opened = OpenAravisCamera(aravis, aravis.call("camera_new", key.encode()))
        if opened.is_lost():
            opened.close()
            raise DeviceTaken(f"camera aravis:{self._name}", f"{camera} is controlled by another program")
        return opened


class OpenAravisCamera:
    """drivers.cameras.genicam.device.OpenCamera."""

    def __init__(self, aravis: Aravis, camera: Handle) -> None:
        self._aravis, self._camera = aravis, camera
        self._device = aravis.camera_get_device(camera)
        self._stream: Handle = None

    def has(self, feature: str) -> bool:
        node = self._aravis.device_get_feature(self._device, feature.encode())
        return node is not None and bool(self._aravis.call("gc_feature_node_is_available", node))

    def read(self, feature: str) -> str:
        text: bytes | None = self._aravis.call("gc_feature_node_get_value_as_string", self._node(feature))
        return (text or b"").decode(errors="replace")

    def write(self, feature: str, value: str) -> None:
        self._aravis.call("gc_feature_node_set_value_from_string", self._node(feature), value.encode())

    def bounds(self, feature: str) -> tuple[float, float]:
        return self._aravis.feature_bounds(self._device, feature)

    def choices(self, feature: str) -> tuple[str, ...]:
        return self._aravis.feature_choices(self._device, feature)

    def execute(self, feature: str) -> None:
        self._aravis.call("device_execute_command", self._device, feature.encode())

    def is_lost(self) -> bool:
        if self._aravis.camera_is_gv_device(self._camera):
            return not self._aravis.gv_device_is_controller(self._device)
        self.read("Width")
        return False

    def start_stream(self) -> None:
        self.stop_stream()
        payload = self._aravis.call("camera_get_payload", self._camera)
        self._stream = self._aravis.call("camera_create_stream", self._camera, None, None)
        for _ in range(BUFFERS):
            self._aravis.stream_push_buffer(self._stream, self._aravis.buffer_new_allocate(payload))
        self._aravis.call("camera_start_acquisition", self._camera)

    def stop_stream(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            try:
                self._aravis.call("camera_stop_acquisition", self._camera)
            finally:
                self._aravis.unref(stream)

    def next_picture(self, limit_s: float) -> RawPicture | None:
        buffer = self._aravis.stream_timeout_pop_buffer(self._stream, max(1, round(limit_s * 1e6)))
        if buffer is None:
            return None
        try:
            if self._aravis.buffer_get_status(buffer) != SUCCESS:
                return RawPicture(np.empty(0, np.uint8), 0, 0, 0, complete=False)
            width, height = self._aravis.buffer_get_image_width(buffer), self._aravis.buffer_get_image_height(buffer)
            code = self._aravis.buffer_get_image_pixel_format(buffer)
            data, padding = self._aravis.buffer_data(buffer), self._aravis.buffer_padding(buffer)
            return RawPicture(data, code, width, height, padding, self._aravis.buffer_get_timestamp(buffer) or None)
        finally:
            self._aravis.stream_push_buffer(self._stream, buffer)

    def close(self) -> None:
        camera, self._camera = self._camera, None
        if camera is not None:
            try:
                self.stop_stream()
            finally:
                self._aravis.unref(camera)

    def _node(self, feature: str) -> Handle:
        node: Handle = self._aravis.device_get_feature(self._device, feature.encode())
        if node is None:
            raise VendorError(f"it has no feature {feature}")
        return node


def _answering(aravis: Aravis) -> list[FoundCamera]:
    aravis.update_device_list()
    places = range(aravis.get_n_devices())
    return [_found(aravis, place) for place in places if aravis.device_text(place, "protocol") in PROTOCOLS]


def _found(aravis: Aravis, place: int) -> FoundCamera:
    vendor, model, serial, address, key = (
        aravis.device_text(place, what) for what in ("vendor", "model", "serial_nbr", "address", "id")
    )
    return FoundCamera(vendor, model, serial, address, key)
