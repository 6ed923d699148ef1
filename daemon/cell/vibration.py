"""Waits before each capture until the flange no longer vibrates, measured through EGM, in cells that have it."""

import asyncio
from dataclasses import dataclass
from math import degrees

from calibration.sentences.sentence import Sentence
from daemon.config.robot_settings import EgmSettings
from daemon.errors import NotStill
from daemon.runtime.clock import Clock
from drivers.interfaces import Vibration, VibrationMonitor

POLL_S = 0.02


@dataclass(frozen=True)
class VibrationGate:
    """A vibration monitor with the allowed limits."""

    monitor: VibrationMonitor
    limits: EgmSettings

    async def wait(self, limit_s: float, clock: Clock) -> Vibration:
        """Wait until the vibration is within the limits; returns it. Raises NotStill, DeviceTimeout."""
        ends_s = clock.monotonic_s() + limit_s
        while not self._within(vibration := self.monitor.vibration(self.limits.window_s)):
            if clock.monotonic_s() > ends_s:
                raise _not_at_rest(vibration)
            await clock.sleep(POLL_S)
        return vibration

    def check(self) -> Vibration:
        """The present vibration, if within the limits. Raises NotStill, DeviceTimeout."""
        vibration = self.monitor.vibration(self.limits.window_s)
        if not self._within(vibration):
            raise _not_at_rest(vibration)
        return vibration

    async def close(self) -> None:
        await asyncio.to_thread(self.monitor.close)

    def _within(self, vibration: Vibration) -> bool:
        return (
            vibration.translation_mm <= self.limits.translation_mm
            and degrees(vibration.rotation_rad) <= self.limits.rotation_deg
        )


def _not_at_rest(vibration: Vibration) -> NotStill:
    what = Sentence("flange-vibrates", mm=vibration.translation_mm, deg=degrees(vibration.rotation_rad))
    return NotStill(what, Sentence("look-what-shakes"))
