"""Switches outputs of the controller around a frame: a light before and after it, a trigger signal during it."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Literal

from daemon.config.robot_settings import OutputSettings
from daemon.runtime.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import CameraFrame

log = logging.getLogger(__name__)


Output = Literal["light", "trigger"]

SwitchOutput = Callable[[Output, bool], Awaitable[None]]
"""Of the robot over the CB link. Raises DeviceError."""


class CaptureOutputs:
    """The outputs that `[robot.outputs]` names. They are low again after each frame, also after one that failed."""

    def __init__(self, switch: SwitchOutput, settings: OutputSettings, clock: Clock) -> None:
        self._switch, self._settings, self._clock = switch, settings, clock

    async def capture(self, grab: Callable[[float], Awaitable[CameraFrame]], newer_than_s: float) -> CameraFrame:
        """A frame that `grab` takes, exposed after `newer_than_s` and when the light shines. Raises DeviceError."""
        if self._settings.light_s is None:
            return await self._triggered(grab, newer_than_s)
        await self._switch("light", True)
        try:
            await self._clock.sleep(self._settings.light_s)
            return await self._triggered(grab, max(newer_than_s, self._clock.monotonic_s()))
        finally:
            await self._low("light")

    async def _triggered(self, grab: Callable[[float], Awaitable[CameraFrame]], newer_than_s: float) -> CameraFrame:
        """The signal rises when the camera waits for it."""
        if self._settings.trigger_s is None:
            return await grab(newer_than_s)
        waiting = asyncio.ensure_future(grab(newer_than_s))
        try:
            await asyncio.sleep(0)
            await self._switch("trigger", True)
            await self._clock.sleep(self._settings.trigger_s)
            await self._low("trigger")
            return await waiting
        except BaseException:
            waiting.cancel()
            await asyncio.gather(waiting, return_exceptions=True)
            await self._low("trigger")
            raise

    async def _low(self, output: Output) -> None:
        """A frame that was taken is not lost when its output cannot be switched off."""
        try:
            await self._switch(output, False)
        except DeviceError as error:
            log.warning("the %s stays on: %s", output, error)
