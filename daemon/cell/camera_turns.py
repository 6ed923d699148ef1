"""The camera, for one run and any number of readers."""

import asyncio

from daemon.runtime.clock import Clock
from drivers.errors import errors_of
from drivers.interfaces import Camera, CameraFrame


class CameraTurns:
    """Grabs one frame at a time. A run goes first: its grab ends a reader's, who then receives the run's frame."""

    def __init__(self, camera: Camera, clock: Clock) -> None:
        self._camera, self._clock = camera, clock
        self._turn = asyncio.Lock()
        self._reading: asyncio.Task[CameraFrame] | None = None
        self._readers = 0
        self._for_readers: CameraFrame | None = None

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`, for a run. Raises DeviceError."""
        if self._reading is not None:
            self._reading.cancel()
        async with self._turn:
            with errors_of("camera"):
                frame = await self._camera.grab(newer_than_s)
        self._for_readers = frame if self._readers else None
        return frame

    async def read(self) -> CameraFrame:
        """A frame exposed after this call, or the one that a run has grabbed since. Raises DeviceError."""
        asked_at_s = self._clock.monotonic_s()
        self._readers += 1
        self._for_readers = None
        try:
            while (frame := await self._read_unless_a_run_goes_first(asked_at_s)) is None:
                pass
            return frame
        finally:
            self._readers -= 1

    async def _read_unless_a_run_goes_first(self, newer_than_s: float) -> CameraFrame | None:
        async with self._turn:
            if self._for_readers is not None:
                return self._for_readers
            self._reading = asyncio.ensure_future(self._camera.grab(newer_than_s))
            try:
                await asyncio.wait([self._reading])
                if self._reading.cancelled():
                    return None
                with errors_of("camera"):
                    return self._reading.result()
            finally:
                self._reading.cancel()
                await asyncio.gather(self._reading, return_exceptions=True)
                self._reading = None
