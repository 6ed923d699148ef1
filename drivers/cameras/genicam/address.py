"""Addresses of industrial cameras: `scheme:NAME?option=value&Feature=value`.

NAME is a serial number, the camera's own name or its network address; without it there must be one camera only.
"""

from dataclasses import dataclass
from math import isfinite
from urllib.parse import parse_qsl, unquote

from drivers.errors import AddressNotUnderstood

NUMBERS = ("exposure_us", "gain_db", "max_temperature_c")
WORDS = ("pixel_format", "trigger", "producer", "serial")
COUNTS = ("packet_bytes",)
FIX = (
    "write scheme:SERIAL?exposure_us=5000&gain_db=0&pixel_format=Mono12&trigger=software&packet_bytes=1500, "
    "or Feature=value with the camera's own names"
)


@dataclass(frozen=True)
class CameraAddress:
    """Which camera, and its settings. None: as the camera has it.

    `trigger`: "software", "off" or an input as "Line1"; None: by software where the camera can. `features`: the
    camera's own features and their values, written in this order before the rest. `producer`: a GenTL library (.cti).
    `max_temperature_c`: no picture is taken of a camera that is hotter.
    """

    text: str
    name: str = ""
    exposure_us: float | None = None
    gain_db: float | None = None
    pixel_format: str | None = None
    trigger: str | None = None
    packet_bytes: int | None = None
    producer: str | None = None
    serial: str | None = None
    features: tuple[tuple[str, str], ...] = ()
    max_temperature_c: float | None = None


def parse_camera_address(text: str) -> CameraAddress:
    """Raises AddressNotUnderstood; opens nothing."""
    rest = text.partition(":")[2].removeprefix("//")
    name, _, query = rest.partition("?")
    options: dict[str, str] = {}
    features: list[tuple[str, str]] = []
    for key, value in parse_qsl(query, keep_blank_values=True):
        if key[:1].isupper():
            features.append((key, value))
        elif key not in (*NUMBERS, *WORDS, *COUNTS):
            raise AddressNotUnderstood(text, f"unknown option {key!r}", FIX)
        elif key in options or not value:
            raise AddressNotUnderstood(text, f"option {key!r} is {'repeated' if value else 'empty'}", FIX)
        else:
            options[key] = value
    numbers = {key: _number(text, key, options[key]) for key in NUMBERS if key in options}
    if not numbers.get("exposure_us", 1.0) > 0:
        raise AddressNotUnderstood(text, "exposure_us is not above 0", FIX)
    packet_bytes = _number(text, "packet_bytes", options["packet_bytes"]) if "packet_bytes" in options else None
    if packet_bytes is not None and not (packet_bytes.is_integer() and 576 <= packet_bytes <= 16_384):
        raise AddressNotUnderstood(text, "packet_bytes is not a whole number from 576 to 16384", FIX)
    return CameraAddress(
        text,
        unquote(name).strip("/"),
        numbers.get("exposure_us"),
        numbers.get("gain_db"),
        options.get("pixel_format"),
        options.get("trigger"),
        None if packet_bytes is None else int(packet_bytes),
        options.get("producer"),
        options.get("serial"),
        tuple(features),
        numbers.get("max_temperature_c"),
    )


def _number(text: str, key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise AddressNotUnderstood(text, f"{key} is {value!r}, not a number", FIX)
    return number
