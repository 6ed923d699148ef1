"""The settings' addresses as devices, dialling in the background."""

from daemon.cell import Devices
from daemon.clock import Clock
from daemon.settings import Settings
from drivers.catalogue import open_camera, open_robot, open_scanner
from drivers.timing import Timing


def open_devices(settings: Settings, clock: Clock) -> Devices:
    """Needs a running loop. Raises AddressNotUnderstood."""
    timing = Timing(clock.monotonic_s, clock.sleep)
    intrinsics = settings.camera.intrinsics
    return Devices(
        robot=open_robot(settings.robot.address, timing),
        camera=open_camera(settings.camera.address, timing, image_size=intrinsics.image_size if intrinsics else None),
        scanner=open_scanner(settings.scanner.address, timing) if settings.scanner else None,
    )
