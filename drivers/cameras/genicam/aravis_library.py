"""Calls of libaravis-0.8 by ctypes: signatures, GError to VendorError, and copies of what it returns.

Signatures: aravis 0.8 API reference, arvcamera.h, arvdevice.h, arvstream.h, arvbuffer.h, arvsystem.h.
"""

import ctypes
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint, c_uint32, c_uint64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.cameras.genicam.device import VendorError
from drivers.errors import LibraryMissing

LIBRARY = "libaravis-0.8.so.0"
PREFIX = "arv_"
Handle = int | None
"""A GObject's address."""
OBJECT = ctypes.c_void_p


class _GError(ctypes.Structure):
    _fields_ = [("domain", c_uint32), ("code", c_int), ("message", c_char_p)]


PLAIN: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "update_device_list": (None, ()),
    "get_n_devices": (c_uint, ()),
    "camera_get_device": (OBJECT, (OBJECT,)),
    "camera_is_gv_device": (c_int, (OBJECT,)),
    "gv_device_is_controller": (c_int, (OBJECT,)),
    "device_get_feature": (OBJECT, (OBJECT, c_char_p)),
    "stream_push_buffer": (None, (OBJECT, OBJECT)),
    "stream_timeout_pop_buffer": (OBJECT, (OBJECT, c_uint64)),
    "buffer_new_allocate": (OBJECT, (c_size_t,)),
    "buffer_get_status": (c_int, (OBJECT,)),
    "buffer_get_image_width": (c_int, (OBJECT,)),
    "buffer_get_image_height": (c_int, (OBJECT,)),
    "buffer_get_image_pixel_format": (c_uint32, (OBJECT,)),
    "buffer_get_timestamp": (c_uint64, (OBJECT,)),
}
"""Result and arguments of functions that cannot fail."""
FAILING: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "camera_new": (OBJECT, (c_char_p,)),
    "camera_get_payload": (c_uint, (OBJECT,)),
    "camera_create_stream": (OBJECT, (OBJECT, OBJECT, OBJECT)),
    "camera_start_acquisition": (None, (OBJECT,)),
    "camera_stop_acquisition": (None, (OBJECT,)),
    "device_execute_command": (None, (OBJECT, c_char_p)),
    "gc_feature_node_is_available": (c_int, (OBJECT,)),
    "gc_feature_node_get_value_as_string": (c_char_p, (OBJECT,)),
    "gc_feature_node_set_value_from_string": (None, (OBJECT, c_char_p)),
    "device_get_float_feature_bounds": (None, (OBJECT, c_char_p, POINTER(c_double), POINTER(c_double))),
    "device_get_integer_feature_bounds": (None, (OBJECT, c_char_p, POINTER(c_int64), POINTER(c_int64))),
    "device_dup_available_enumeration_feature_values_as_strings": (
        POINTER(c_char_p),
        (OBJECT, c_char_p, POINTER(c_uint)),
    ),
}
"""Those whose last argument is a GError."""


class Aravis:
    """The library's functions without their prefix. Raises LibraryMissing where it is not installed."""

    def __init__(self) -> None:
        try:
            self._library = ctypes.CDLL(LIBRARY)
            self._gobject = ctypes.CDLL("libgobject-2.0.so.0")
            self._glib = ctypes.CDLL("libglib-2.0.so.0")
        except OSError as error:
            raise LibraryMissing(
                "camera aravis:", f"{LIBRARY} is not installed ({error})", "apt install libaravis-0.8-0"
            ) from error
        self._gobject.g_object_unref.argtypes = [OBJECT]
        self._glib.g_free.argtypes = [OBJECT]
        self._glib.g_error_free.argtypes = [POINTER(_GError)]
        for name, (result, arguments) in PLAIN.items():
            function = getattr(self._library, PREFIX + name)
            function.restype, function.argtypes = result, list(arguments)
            setattr(self, name, function)
        for name, (result, arguments) in FAILING.items():
            function = getattr(self._library, PREFIX + name)
            function.restype, function.argtypes = result, [*arguments, POINTER(POINTER(_GError))]

    def __getattr__(self, name: str) -> Any:  # for the type checker: __init__ sets each name of PLAIN
        raise AttributeError(name)

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function of FAILING. Raises VendorError."""
        error = POINTER(_GError)()
        result = getattr(self._library, PREFIX + name)(*arguments, byref(error))
        if error:
            message = (error.contents.message or b"").decode(errors="replace")
            self._glib.g_error_free(error)
            raise VendorError(message)
        return result

    def device_text(self, place: int, what: str) -> str:
        """What discovery found of the device at a place of the list."""
        function = getattr(self._library, f"{PREFIX}get_device_{what}")
        function.restype, function.argtypes = c_char_p, [c_uint]
        text: bytes | None = function(place)
        return (text or b"").decode(errors="replace")

    def feature_bounds(self, device: Handle, feature: str) -> tuple[float, float]:
        """Least and greatest value. Raises VendorError."""
        low, high = c_double(), c_double()
        try:
            self.call("device_get_float_feature_bounds", device, feature.encode(), byref(low), byref(high))
        except VendorError:
            least, greatest = c_int64(), c_int64()
            self.call("device_get_integer_feature_bounds", device, feature.encode(), byref(least), byref(greatest))
            return float(least.value), float(greatest.value)
        return low.value, high.value

    def feature_choices(self, device: Handle, feature: str) -> tuple[str, ...]:
        """Values of an enumeration. Raises VendorError."""
        count = c_uint()
        name = "device_dup_available_enumeration_feature_values_as_strings"
        values = self.call(name, device, feature.encode(), byref(count))
        if not values:
            return ()
        choices = tuple((values[place] or b"").decode() for place in range(count.value))
        self._glib.g_free(ctypes.cast(values, OBJECT))
        return choices

    def buffer_data(self, buffer: Handle) -> NDArray[np.uint8]:
        """A copy of the buffer's bytes (n,)."""
        function = self._library.arv_buffer_get_data
        function.restype, function.argtypes = OBJECT, [OBJECT, POINTER(c_size_t)]
        size = c_size_t()
        start = function(buffer, byref(size))
        return np.frombuffer(ctypes.string_at(start, size.value), np.uint8)

    def buffer_padding(self, buffer: Handle) -> int:
        """Bytes after each row."""
        function = self._library.arv_buffer_get_image_padding
        function.restype, function.argtypes = None, [OBJECT, POINTER(c_int), POINTER(c_int)]
        right, below = c_int(), c_int()
        function(buffer, byref(right), byref(below))
        return right.value

    def unref(self, handle: Handle) -> None:
        self._gobject.g_object_unref(handle)
