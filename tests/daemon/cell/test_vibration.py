"""The settling monitor before each look: it waits for an arm that rings, and says so of one that goes on."""

from dataclasses import dataclass, field
from math import radians

import pytest

from daemon.cell.cell import Cell, Devices
from daemon.cell.settling import VibrationGate
from daemon.config.robot_settings import EgmSettings, SettlingSettings
from daemon.errors import NotStill
from daemon.runtime.clock import Clock
from drivers.errors import DeviceTimeout
from drivers.interfaces import Vibration
from tests.daemon.fakes import FakeCamera, FakeRobot


def stepped_clock() -> Clock:
    """Time that passes only while somebody sleeps."""
    now_s = [0.0]

    async def sleep(duration_s: float) -> None:
        now_s[0] += duration_s

    return Clock(monotonic_s=lambda: now_s[0], sleep=sleep)


ALLOWED = EgmSettings(translation_mm=0.05, rotation_deg=0.01)


@dataclass
class Ringing:
    """Dies out by half with each look."""

    translation_mm: float
    rotation_deg: float = 0.0
    decay: float = 0.5
    looks: int = 0
    windows: list[float] = field(default_factory=list)

    def vibration(self, window_s: float) -> Vibration:
        self.windows.append(window_s)
        self.looks += 1
        left = self.decay ** (self.looks - 1)
        return Vibration(self.translation_mm * left, radians(self.rotation_deg * left), 60, 0)

    def close(self) -> None:
        pass


async def test_it_waits_until_the_arm_has_stopped_ringing() -> None:
    monitor = Ringing(1.0, 0.1)
    left = await VibrationGate(monitor, ALLOWED).wait(10.0, stepped_clock())
    assert left.translation_mm <= 0.05
    assert monitor.looks == 6
    assert set(monitor.windows) == {0.25}


@pytest.mark.parametrize("shaken", [Ringing(0.06, 0.0, 1.0), Ringing(0.0, 0.011, 1.0)])
async def test_an_arm_that_goes_on_is_reported_with_its_amplitude(shaken: Ringing) -> None:
    with pytest.raises(NotStill, match="still vibrates by") as rings:
        await VibrationGate(shaken, ALLOWED).wait(1.0, stepped_clock())
    assert "[robot.egm]" in rings.value.fix
    with pytest.raises(NotStill):
        VibrationGate(shaken, ALLOWED).check()


async def test_a_silent_controller_is_not_taken_for_a_quiet_arm() -> None:
    class Silent(Ringing):
        def vibration(self, window_s: float) -> Vibration:
            raise DeviceTimeout("EGM", "no samples", "start the stream")

    with pytest.raises(DeviceTimeout):
        await VibrationGate(Silent(0.0), ALLOWED).wait(1.0, stepped_clock())


def looking_through(monitor: Ringing, limit_s: float) -> tuple[Cell, FakeCamera]:
    robot = FakeRobot()
    camera = FakeCamera(robot)
    devices = Devices(robot, camera, None, VibrationGate(monitor, ALLOWED))
    return Cell(devices, SettlingSettings(gap_s=0.0, limit_s=limit_s), Clock()), camera


async def test_every_picture_waits_until_the_arm_has_stopped_ringing() -> None:
    monitor = Ringing(1.0, 0.1)
    cell, camera = looking_through(monitor, limit_s=10.0)
    await cell.capture_frame(await cell.read_settled_pose())
    assert (monitor.looks, camera.pictures) == (6, 1)


async def test_of_an_arm_that_goes_on_ringing_no_picture_is_taken() -> None:
    cell, camera = looking_through(Ringing(0.06, decay=1.0), limit_s=0.05)
    with pytest.raises(NotStill, match="still vibrates"):
        await cell.capture_frame(await cell.read_settled_pose())
    assert camera.pictures == 0
