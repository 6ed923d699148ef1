"""From addresses to drivers."""

from pathlib import Path

import pytest

from drivers import registry
from drivers.cameras.image_files import FolderCamera, HttpCamera
from drivers.cameras.video_camera import VideoCamera
from drivers.errors import AddressNotUnderstood, DeviceError
from drivers.registry import check_camera_address, check_robot_address, check_scanner_address
from drivers.scanners.cloud_files import FolderScanner, HttpScanner
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from tests.drivers.robots.fake_controller import FakeController, TcpCell
from tests.support.waiting import LIMIT_S, quick_timing


@pytest.mark.parametrize(
    ("address", "transport"),
    [
        ("tcp://192.168.125.1:5500", TcpTransport("192.168.125.1", 5500)),
        ("tcp://[::1]:5500", TcpTransport("::1", 5500)),
        ("serial:///dev/ttyUSB0", SerialTransport("/dev/ttyUSB0", 115200)),
        ("serial:///dev/ttyUSB0?baud=9600&rtscts=1", SerialTransport("/dev/ttyUSB0", 9600, True)),
        ("socket://10.0.0.7:4001", SerialTransport("socket://10.0.0.7:4001")),
        ("rfc2217://10.0.0.7:4001", SerialTransport("rfc2217://10.0.0.7:4001")),
        ("loop://", SerialTransport("loop://")),
    ],
)
def test_a_robot_address_names_its_transport(address, transport):
    assert registry.ROBOTS[address.partition(":")[0]][0](address) == transport
    check_robot_address(address)


@pytest.mark.parametrize("address", ["tcp://192.168.125.1:5500", "tcp://[::1]:5500", "serial:///dev/ttyUSB0?baud=9600"])
def test_a_transport_says_its_address_as_it_was_written(address):
    assert registry.ROBOTS[address.partition(":")[0]][0](address).address == address


@pytest.mark.parametrize(
    ("check", "address", "message"),
    [
        (check_robot_address, "udp://h:1", "one of tcp:, serial:, socket:, rfc2217:, loop:"),
        (check_robot_address, "192.168.125.1", "a robot needs a scheme"),
        (check_robot_address, "", "a robot needs a scheme"),
        (check_robot_address, "tcp://h", "write tcp://host:port"),
        (check_robot_address, "tcp://:5500", "write tcp://host:port"),
        (check_robot_address, "tcp://h:99999", "1 to 65535"),
        (check_robot_address, "tcp://[::1:5500", "scheme://host:port"),
        (check_robot_address, "serial:///dev/ttyUSB0?bauds=9600", "unknown option 'bauds'"),
        (check_robot_address, "serial:///dev/ttyUSB0?baud=fast", "cannot be read"),
        (check_robot_address, "serial://ttyUSB0", "cannot be read"),
        (check_robot_address, "socket://h", "write socket://host:port"),
        (check_camera_address, "ftp://h/x.png", "one of http:, https:, video:, rtsp:, rtsps:, folder:"),
        (check_camera_address, "http:///x.png", "the host is missing"),
        (check_camera_address, "http://kamera ü/x.png", "Invalid IDNA hostname: 'kamera ü'"),
        (check_camera_address, "http://h/x\0.png", "non-printable"),
        (check_camera_address, f"http://{'h' * 70_000}/", "too long"),
        (check_robot_address, "tcp://prüf zelle:5500", "Invalid IDNA hostname"),
        (check_robot_address, "tcp://a..b:5500", "label empty or too long"),
        (check_robot_address, f"tcp://{'h' * 64}:5500", "label too long"),
        (check_camera_address, "http://xn--abc/x.png", "write scheme://host:port"),
        (check_camera_address, "video:", "the device is missing"),
        (check_camera_address, "folder:", "the path is missing"),
        (check_scanner_address, "video:0", "one of http:, https:, folder:"),
    ],
)
def test_an_address_that_names_no_driver_says_what_would(check, address, message):
    with pytest.raises(AddressNotUnderstood) as misunderstood:
        check(address)
    assert message in str(misunderstood.value)
    assert isinstance(misunderstood.value, ValueError)
    assert isinstance(misunderstood.value, DeviceError)


@pytest.mark.parametrize(
    ("address", "kind"),
    [
        ("http://127.0.0.1:9/x", HttpCamera),
        ("video:77", VideoCamera),
        ("video:/none.mp4", VideoCamera),
        ("folder:/none", FolderCamera),
        ("folder:///none", FolderCamera),
    ],
)
async def test_a_camera_address_opens_its_driver(address, kind):
    check_camera_address(address)
    camera = registry.open_camera(address, image_size=(64, 48))
    assert isinstance(camera, kind)
    await camera.close()


@pytest.mark.parametrize(("address", "kind"), [("http://127.0.0.1:9/x", HttpScanner), ("folder:/none", FolderScanner)])
async def test_a_scanner_address_opens_its_driver(address, kind):
    check_scanner_address(address)
    scanner = registry.open_scanner(address)
    assert isinstance(scanner, kind)
    await scanner.close()


def test_a_folder_may_be_written_as_a_url():
    parse, _ = registry.CAMERAS["folder"]
    assert parse("folder:/a/b") == parse("folder:///a/b") == Path("/a/b")


async def test_an_opened_robot_dials_by_itself():
    async with TcpCell(FakeController()) as cell:
        robot = registry.open_robot(f"tcp://127.0.0.1:{cell.port}", quick_timing())
        await robot.wait_for_link(LIMIT_S)
        assert (await robot.read_pose()).still
        await robot.close()
