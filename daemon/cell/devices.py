"""Open the devices at the settings' addresses; they connect in the background."""

from daemon.cell.capture_outputs import CaptureOutputs
from daemon.cell.cell import Devices
from daemon.cell.exposure_control import ExposureControl
from daemon.cell.settling import VibrationGate
from daemon.config.settings import CameraSettings, ScannerSettings, Settings
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from drivers.interfaces import Camera, Scanner
from drivers.registry import open_camera, open_robot, open_scanner, open_vibration_monitor
from drivers.robots.base_frame import configured
from drivers.timing import Timing


def open_devices(settings: Settings, clock: Clock) -> Devices:
    """Open the devices in a running event loop. Raises AddressNotUnderstood, DeviceUnreachable (EGM port in use)."""
    timing = Timing(clock.monotonic_s, clock.sleep)
    robot = open_robot(
        settings.robot.address,
        timing,
        stop_address=settings.robot.stop_address,
        world_T_base=settings.robot.world_T_base,
        limit_s=settings.robot.limit_s,
        axes=settings.robot.axes,
    )
    program = configured(robot)
    outputs, egm = settings.robot.outputs, settings.robot.egm
    return Devices(
        robot=robot,
        camera=_open_camera(settings.camera, timing),
        scanner=None if settings.scanner is None else _open_scanner(settings.scanner, timing),
        vibration_gate=None
        if egm is None
        else VibrationGate(open_vibration_monitor(egm.host, egm.port, egm.robot, timing), egm),
        outputs=CaptureOutputs(program.switch_output, outputs, clock)
        if program is not None and outputs is not None
        else None,
        cameras={name: _open_camera(camera, timing) for name, camera in settings.cameras.items()},
        scanners={name: _open_scanner(scanner, timing) for name, scanner in settings.scanners.items()},
    )


def open_exposure_control(settings: Settings, camera: Camera, workers: Workers, clock: Clock) -> ExposureControl | None:
    """The choice of the camera's exposure within the limits of [camera]; None without them."""
    limits = settings.camera.exposure
    if limits is None:
        return None
    return ExposureControl(camera, settings.target, limits, workers, clock)


def _open_camera(settings: CameraSettings, timing: Timing) -> Camera:
    intrinsics = settings.intrinsics
    image_size = intrinsics.image_size if intrinsics else None
    return open_camera(settings.address, timing, image_size=image_size, limit_s=settings.limit_s)


def _open_scanner(settings: ScannerSettings, timing: Timing) -> Scanner:
    return open_scanner(settings.address, timing, limit_s=settings.limit_s)
