"""The camera, for one run and any number of readers."""

import asyncio

from daemon.runtime.clock import Clock
from drivers.errors import errors_of
from drivers.interfaces import Camera, CameraFrame


class CameraTurns:
    """Grabs one frame at a time; a run waits for one reader's grab at most.

    That grab is not cut off: a camera goes on with a picture that nobody waits for, and the run's would time out.
    """

    def __init__(self, camera: Camera, clock: Clock) -> None:
        self._camera, self._clock = camera, clock
        self._turn = asyncio.Lock()
        self._latest: CameraFrame | None = None
        self._runs = 0

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`, for a run. Raises DeviceError."""
        self._runs += 1
        try:
            async with self._turn:
                self._latest = None
                with errors_of("camera"):
                    self._latest = await self._camera.grab(newer_than_s)
                return self._latest
        finally:
            self._runs -= 1

    async def read(self) -> CameraFrame:
        """A frame exposed after this call, or the one that a run grabs meanwhile. Raises DeviceError."""
        shares_run = self._runs > 0
        asked_at_s = self._clock.monotonic_s()
        async with self._turn:
            if shares_run and self._latest is not None:
                return self._latest
            with errors_of("camera"):
                return await self._camera.grab(asked_at_s)
