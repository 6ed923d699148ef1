"""A GigE Vision camera at 127.0.0.1 that shows what a URL shows, by aravis's own camera and its fill callback.

`python -m tests.support.gigabit_scene SERIAL URL` runs until its standard input ends. Control (GVCP) and pictures
(GVSP) are aravis's; the pixels of each frame are those of the picture that the URL gives while the frame is made.

Signatures: aravis 0.8, arvgvfakecamera.h, arvfakecamera.h, arvbuffer.h.
"""

import ctypes
import sys
import urllib.request
from ctypes import c_char_p, c_int, c_uint32, c_void_p
from typing import Any

import cv2
import numpy as np

FILL = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_uint32, c_uint32, c_uint32)
LIMIT_S = 20.0
SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "arv_gv_fake_camera_new": (c_void_p, [c_char_p, c_char_p]),
    "arv_gv_fake_camera_is_running": (c_int, [c_void_p]),
    "arv_gv_fake_camera_get_fake_camera": (c_void_p, [c_void_p]),
    "arv_fake_camera_set_fill_pattern": (None, [c_void_p, FILL, c_void_p]),
    "arv_buffer_get_data": (c_void_p, [c_void_p, c_void_p]),
    "arv_buffer_get_image_width": (c_int, [c_void_p]),
    "arv_buffer_get_image_height": (c_int, [c_void_p]),
}


def main() -> int:
    serial, url = sys.argv[1:]
    aravis = ctypes.CDLL("libaravis-0.8.so.0")
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(aravis, name)
        function.restype, function.argtypes = result, arguments

    def fill(buffer: int, _data: int, _exposure_us: int, _gain: int, _pixel_format: int) -> None:
        with urllib.request.urlopen(url, timeout=LIMIT_S) as answer:
            pixels = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_GRAYSCALE)
        shape = aravis.arv_buffer_get_image_height(buffer), aravis.arv_buffer_get_image_width(buffer)
        assert pixels is not None and pixels.shape == shape, f"the camera's picture is {shape}"
        ctypes.memmove(aravis.arv_buffer_get_data(buffer, None), pixels.tobytes(), pixels.size)

    callback = FILL(fill)
    camera = aravis.arv_gv_fake_camera_new(b"127.0.0.1", serial.encode())
    if not aravis.arv_gv_fake_camera_is_running(camera):
        return 1
    aravis.arv_fake_camera_set_fill_pattern(aravis.arv_gv_fake_camera_get_fake_camera(camera), callback, None)
    sys.stdin.read()
    return 0


if __name__ == "__main__":
    sys.exit(main())
