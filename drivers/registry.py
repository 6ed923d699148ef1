"""Finds the driver of an address in the settings: one table of schemes per kind of device.

robot:   rws://host, rws://user:password@host:port?version=2&frame=base (read only: drivers.robots.abb.rws.address),
         tcp://host:port, serial:///dev/ttyUSB0?baud=115200&rtscts=0, socket://host:port, rfc2217://host:port, loop://
camera:  http(s)://..., video:0, video:/dev/video0, video:/path/file.mp4, rtsp://..., folder:/path,
         basler:SERIAL, genicam:SERIAL?producer=/path.cti, aravis:SERIAL, aravis:IP, realsense:SERIAL:
         drivers.cameras.genicam.address
scanner: http(s)://..., folder:/path; 3D cameras: genicam:, basler:, aravis:, realsense: as cameras;
         line profilers: profiles://host:port, profiles:/folder
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import SplitResult, parse_qsl, urlsplit

import httpx

from calibration.transforms import Array
from drivers.cameras.aravis_camera import AravisLibrary
from drivers.cameras.basler_camera import PylonLibrary
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import Library
from drivers.cameras.genicam.opened_device import GenICamCamera
from drivers.cameras.genicam_camera import HarvestersLibrary
from drivers.cameras.image_files import FolderCamera, HttpCamera
from drivers.cameras.realsense_camera import RealSenseLibrary
from drivers.cameras.video_camera import VideoCamera
from drivers.errors import AddressNotUnderstood
from drivers.interfaces import (
    Camera,
    MakeCamera,
    MakeRobot,
    MakeScanner,
    PathRecorder,
    Robot,
    Scanner,
    VibrationMonitor,
)
from drivers.robots.abb.cb_robot import CbRobot
from drivers.robots.abb.egm_vibration import EgmMonitor, EgmPath
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.redundant_stop import RedundantStop
from drivers.robots.abb.rws.robot import RwsRobot
from drivers.robots.base_frame import RobotInBaseFrame
from drivers.scanners.cloud_files import FolderScanner, HttpScanner
from drivers.scanners.folder_profiler import FolderProfiler
from drivers.scanners.genicam_scanner import GenICamScanner
from drivers.scanners.gocator_profiler import GocatorProfiler, ProfilerHost, parse_profiler_address
from drivers.timing import Timing
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from drivers.transports.transport import Transport

STREAM_LATENCY_S = 1.0
"""Delay of a network stream of about a second: encoder, network and decoder buffer frames."""

Parse = Callable[[str], Any]
"""Parses an address to the argument of the driver's constructor. Opens nothing; raises AddressNotUnderstood."""
Entry = TypeVar("Entry")


def open_robot(
    address: str,
    timing: Timing | None = None,
    *,
    stop_address: str | None = None,
    world_T_base: Array | None = None,
    limit_s: float | None = None,
    axes: int = 6,
) -> Robot:
    """The robot at an address, connecting in the background; `stop_address`: a second way to stop it, over RWS.

    `world_T_base` (4, 4): its base frame, for a controller that gives poses in the world frame; None: they are one.
    `limit_s`: how long a controller may take for an answer; None: the driver's own limit. `axes`: of the arm, 6 or 7.

    Raises AddressNotUnderstood; needs a running loop.
    """
    timing = timing or Timing()
    parse, make = _look_up(ROBOTS, "robot", address)
    robot = make(parse(address), timing, limit_s=limit_s, axes=axes)
    if stop_address is not None:
        second = RwsRobot(check_stop_address(stop_address), timing, name="second way to stop")
        robot = RedundantStop(robot, second, timing)
    if world_T_base is not None and robot.capabilities.pose_frame == "world":
        robot = RobotInBaseFrame(robot, world_T_base)
    robot.start()
    return robot


def open_camera(
    address: str, timing: Timing | None = None, *, image_size: tuple[int, int] | None = None, limit_s: float = 5.0
) -> Camera:
    """The camera at an address, connecting in the background; `image_size` is (width, height).

    Raises AddressNotUnderstood; needs a running loop.
    """
    parse, make = _look_up(CAMERAS, "camera", address)
    camera = make(parse(address), timing or Timing(), image_size=image_size, limit_s=limit_s)
    camera.start()
    return camera


def open_scanner(address: str, timing: Timing | None = None, *, limit_s: float = 60.0) -> Scanner:
    """The scanner at an address, connecting in the background. Raises AddressNotUnderstood; needs a running loop."""
    parse, make = _look_up(SCANNERS, "scanner", address)
    scanner = make(parse(address), timing or Timing(), limit_s=limit_s)
    scanner.start()
    return scanner


def open_vibration_monitor(host: str, port: int, robot: str | None, timing: Timing) -> VibrationMonitor:
    """EGM sent by the controller to `host` and `port`; packets of senders other than `robot` are ignored.

    Raises DeviceUnreachable for a port that is taken.
    """
    monitor = EgmMonitor(host, port, robot, timing)
    monitor.start()
    return monitor


def record_path(monitor: VibrationMonitor) -> PathRecorder | None:
    """Poses in the world frame from the stream that shows vibration, from now on; None where it gives none.

    Raises DeviceTimeout when the controller sends nothing.
    """
    return EgmPath(monitor) if isinstance(monitor, EgmMonitor) else None


def cb_transport(address: str) -> Transport:
    """The line of a CB link: tcp: or a serial one. Raises AddressNotUnderstood; opens nothing."""
    parse, make = _look_up(ROBOTS, "robot", address)
    if make is not CbRobot:
        raise AddressNotUnderstood(address, "this is not the CB link", "write tcp://host:port or serial:///dev/...")
    transport: Transport = parse(address)
    return transport


def _check_address(table: dict[str, Any], device: str, address: str) -> None:
    _look_up(table, device, address)[0](address)


def check_stop_address(address: str) -> RwsAddress:
    """Parsed. Raises AddressNotUnderstood; opens nothing."""
    if address.partition(":")[0].lower() != "rws":
        raise AddressNotUnderstood(address, "a second way to stop needs Robot Web Services", "write rws://host")
    return RwsAddress.parse(address)


def _look_up(table: dict[str, Entry], device: str, address: str) -> Entry:
    scheme = address.partition(":")[0].lower()
    if ":" not in address or scheme not in table:
        known = ", ".join(f"{name}:" for name in table)
        what = f"{scheme!r} is no scheme of a {device}" if ":" in address else f"a {device} needs a scheme"
        raise AddressNotUnderstood(address, what, f"begin it with one of {known}")
    return table[scheme]


def _split(address: str) -> tuple[SplitResult, str, int]:
    """Parts, host and port (0 when absent)."""
    try:
        parts = urlsplit(address)
        httpx.URL(address).host.encode("idna")  # both refuse hosts that no resolver takes
        return parts, parts.hostname or "", parts.port or 0
    except (ValueError, httpx.InvalidURL) as error:
        raise AddressNotUnderstood(
            address, str(error), "write scheme://host:port, with a port of 1 to 65535"
        ) from error


def _tcp(address: str) -> Transport:
    parts, host, port = _split(address)
    if not host or not port or parts.path or parts.query:
        raise AddressNotUnderstood(address, "it is not a host and a port", "write tcp://host:port")
    return TcpTransport(host, port)


def _serial(address: str) -> Transport:
    parts, host, _ = _split(address)
    options = dict(parse_qsl(parts.query))
    unknown = sorted(options.keys() - {"baud", "rtscts"})
    baud, rtscts = options.get("baud", "115200"), options.get("rtscts", "0")
    if unknown or host or not parts.path or not baud.isdecimal() or rtscts not in ("0", "1"):
        what = f"unknown option {unknown[0]!r}" if unknown else "port, baud or rtscts cannot be read"
        raise AddressNotUnderstood(address, what, "write serial:///dev/ttyUSB0?baud=115200&rtscts=0")
    return SerialTransport(parts.path, int(baud), rtscts == "1")


def _device_server(address: str) -> Transport:
    parts, host, port = _split(address)
    if not host or not port:
        raise AddressNotUnderstood(address, "host and port are missing", f"write {parts.scheme}://host:port")
    return SerialTransport(address)


def _url(address: str) -> str:
    _, host, _ = _split(address)
    if not host:
        raise AddressNotUnderstood(address, "the host is missing", "write scheme://host/path")
    return address


def _video(address: str) -> int | str:
    source = address.partition(":")[2]
    if not source:
        raise AddressNotUnderstood(
            address, "the device is missing", "write video:0, video:/dev/video0 or a file's path"
        )
    return int(source) if source.isdecimal() else source


def _folder(address: str) -> Path:
    path = address.partition(":")[2]
    path = path.removeprefix("//") if path.startswith("///") else path
    if not path or path.startswith("//"):
        raise AddressNotUnderstood(address, "the path is missing", "write folder:/path")
    return Path(path)


def _profiler(source: ProfilerHost | Path, timing: Timing, /, *, limit_s: float) -> Scanner:
    if isinstance(source, Path):
        return FolderProfiler(source, timing, limit_s=limit_s)
    return GocatorProfiler(source, timing, limit_s=limit_s)


ROBOTS: dict[str, tuple[Parse, MakeRobot]] = {
    "tcp": (_tcp, CbRobot),
    "serial": (_serial, CbRobot),
    "socket": (_device_server, CbRobot),
    "rfc2217": (_device_server, CbRobot),
    "loop": (SerialTransport, CbRobot),
    "rws": (RwsAddress.parse, RwsRobot),
}
CAMERAS: dict[str, tuple[Parse, MakeCamera]] = {
    "http": (_url, HttpCamera),
    "https": (_url, HttpCamera),
    "video": (_video, VideoCamera),
    "rtsp": (_url, partial(VideoCamera, latency_s=STREAM_LATENCY_S)),
    "rtsps": (_url, partial(VideoCamera, latency_s=STREAM_LATENCY_S)),
    "folder": (_folder, FolderCamera),
    "basler": (parse_camera_address, partial(GenICamCamera, lambda address: PylonLibrary())),
    "genicam": (parse_camera_address, partial(GenICamCamera, lambda address: HarvestersLibrary(address.producer))),
    "aravis": (parse_camera_address, partial(GenICamCamera, lambda address: AravisLibrary(address.name))),
    "realsense": (parse_camera_address, partial(GenICamCamera, lambda address: RealSenseLibrary("Color"))),
}
LIBRARIES: dict[str, Callable[[], Library]] = {
    "basler": PylonLibrary,
    "genicam": HarvestersLibrary,
    "aravis": AravisLibrary,
    "realsense": RealSenseLibrary,
}
"""By scheme: what finds cameras."""
SCANNERS: dict[str, tuple[Parse, MakeScanner]] = {
    "http": (_url, HttpScanner),
    "https": (_url, HttpScanner),
    "folder": (_folder, FolderScanner),
    "profiles": (parse_profiler_address, _profiler),
    "basler": (parse_camera_address, partial(GenICamScanner, lambda address: PylonLibrary())),
    "genicam": (parse_camera_address, partial(GenICamScanner, lambda address: HarvestersLibrary(address.producer))),
    "aravis": (parse_camera_address, partial(GenICamScanner, lambda address: AravisLibrary(address.name))),
    "realsense": (parse_camera_address, partial(GenICamScanner, lambda address: RealSenseLibrary("Depth"))),
}
check_robot_address = partial(_check_address, ROBOTS, "robot")
check_camera_address = partial(_check_address, CAMERAS, "camera")
check_scanner_address = partial(_check_address, SCANNERS, "scanner")
"""Each raises AddressNotUnderstood; it opens nothing."""
