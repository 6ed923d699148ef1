"""A GenICam device behind a vendor's library, whose calls block and are made in a thread of their own; the camera."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from drivers.backoff import Backoff
from drivers.cameras.decoding import require_size
from drivers.cameras.genicam.address import CameraAddress
from drivers.cameras.genicam.device import FoundCamera, Library, VendorError
from drivers.cameras.genicam.session import CameraSession
from drivers.errors import (
    DeviceError,
    DeviceTaken,
    DeviceTimeout,
    DeviceUnreachable,
    LibraryMissing,
    LinkLost,
    SettingRefused,
    WrongDevice,
)
from drivers.file_thread import FileThread
from drivers.interfaces import CameraFrame, DeviceIdentity, Exposure, ExposureRange
from drivers.polled_device import PolledDevice
from drivers.timing import Timing

POLL_S = 1.0
MARGIN_S = 2.0
"""Time beyond its limit that a library's call may take before the thread is left alone."""
MAX_OPEN_S = 20.0
"""Discovery, opening and settings; GigE Vision's discovery alone waits a second on each interface."""

PERMANENT = (DeviceTaken, LibraryMissing, SettingRefused, WrongDevice)
"""Failures to open that are raised without waiting for the next attempt."""

Answer = TypeVar("Answer")


class GenICamDevice(PolledDevice):
    """A camera, or 3D camera, that is opened in the background, and opened again with growing waits when it is lost.

    `make_library` gives the vendor's library for the address. A subclass says how long a picture may take, and how
    large a cloud may be.
    """

    kind, limit_s, max_bytes = "camera", 5.0, 2**30

    def __init__(
        self,
        make_library: Callable[[CameraAddress], Library],
        address: CameraAddress,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float | None = None,
        max_bytes: int | None = None,
    ) -> None:
        """`image_size`: of a camera's pictures. What is not given is of the kind of device."""
        super().__init__(f"{self.kind} {address.text.partition('?')[0]}", timing or Timing())
        self._library, self._address, self._image_size = make_library(address), address, image_size
        self._limit_s = self.limit_s if limit_s is None else limit_s
        self._max_bytes = self.max_bytes if max_bytes is None else max_bytes
        self._thread = FileThread(f"calls of {self.device}", self._timing)
        self._session: CameraSession | None = None
        self._failure: DeviceError = DeviceTimeout(self.device, "not opened yet", "wait a moment")
        self._changed = asyncio.Event()
        self._turn = asyncio.Lock()

    async def identify(self) -> DeviceIdentity:
        """Vendor, model, serial number, address and abilities. Raises DeviceError."""
        session = await self._await_session(self._timing.clock() + self._limit_s)
        return await self._ask(session, session.identity, self._limit_s)

    async def close(self) -> None:
        """Close the camera; a library that hangs is left alone after MARGIN_S."""
        await super().close()
        session, self._session = self._session, None
        if session is not None:
            with suppress(TimeoutError):
                await self._thread.run(session.close, MARGIN_S)

    async def _take_new(self, newer_than_s: float, take: Callable[[CameraSession, float], Answer]) -> Answer:
        """What `take` makes of a picture exposed after `newer_than_s`, within the limit; raises a DeviceError."""
        deadline_s = max(self._timing.clock(), newer_than_s) + self._limit_s
        while True:
            session = await self._await_session(deadline_s)
            while (early_s := newer_than_s - self._timing.clock()) >= 0:
                await self._timing.sleep(early_s + 0.001)
            left_s = max(0.05, deadline_s - self._timing.clock())
            try:
                return await self._ask(session, lambda: take(session, left_s), left_s)  # noqa: B023 - awaited here
            except LinkLost:
                if self._timing.clock() >= deadline_s:
                    raise

    async def _look(self) -> None:
        """Open the camera, and open it again with growing waits whenever it is lost."""
        backoff = Backoff(self._timing.chance)
        while True:
            try:
                if self._session is None:
                    await self._open()
                elif not self._turn.locked():
                    session = self._session
                    await self._ask(session, session.check, self._limit_s)
                    backoff.reset()
                wait_s = POLL_S
            except DeviceError as error:
                self._note(error)
                wait_s = backoff.next_wait_s()
            await self._wait(wait_s)

    async def _wait(self, wait_s: float) -> None:
        """Wait, but no longer than until a request finds the camera lost."""
        lost = asyncio.ensure_future(self._changed.wait())
        self._changed.clear()
        await self._timing.wait_until_done(lost, wait_s)
        lost.cancel()

    async def _open(self) -> None:
        try:
            async with self._turn:
                self._session = await self._thread.run(self._find_and_open, MAX_OPEN_S)
        except TimeoutError:
            raise DeviceTimeout(
                self.device, f"its library has not opened it in {MAX_OPEN_S:g} s", "unplug the camera, and plug it in"
            ) from None
        self._report.up(self._session.name)

    def _find_and_open(self) -> CameraSession:
        try:
            found = self._look_up(self._library.discover())
            if not found.free:
                raise DeviceTaken(self.device, f"{found} is controlled by another program")
            camera = self._library.open(found)
        except VendorError as error:
            raise DeviceUnreachable(self.device, f"it cannot be opened ({error})", "check power and cable") from error
        try:
            return CameraSession(self.device, found, camera, self._address, self._timing.clock)
        except DeviceError:
            camera.close()
            raise
        except VendorError as error:
            camera.close()
            raise DeviceUnreachable(self.device, f"it does not answer ({error})", "check power and cable") from error

    def _look_up(self, found: list[FoundCamera]) -> FoundCamera:
        """The camera that the address names, or the only one. Raises DeviceUnreachable, WrongDevice."""
        if not found:
            what = "no camera answers discovery"
            raise DeviceUnreachable(self.device, what, "check power, cable and subnet, see `handeyed devices`")
        name = self._address.name
        named = [camera for camera in found if camera.is_named(name)] if name else found
        if len(named) == 1:
            return named[0]
        listed = "; ".join(str(camera) for camera in found)
        if named:
            raise WrongDevice(self.device, f"{len(named)} cameras answer: {listed}", "name one by its serial number")
        raise WrongDevice(self.device, f"no camera is {name}, but there are: {listed}", "correct the serial number")

    async def _await_session(self, deadline_s: float) -> CameraSession:
        """The open camera. Raises the reason why there is none at the deadline."""
        while self._session is None:
            left_s = deadline_s - self._timing.clock()
            if left_s <= 0 or isinstance(self._failure, PERMANENT):
                raise type(self._failure)(self.device, self._failure.what, self._failure.fix)
            await self._timing.sleep(min(0.02, left_s))
        return self._session

    async def _ask(self, session: CameraSession, call: Callable[[], Answer], limit_s: float) -> Answer:
        """The answer of one call at a time; a camera that was lost is given up, to be opened again."""
        async with self._turn:
            if session is not self._session:
                raise LinkLost(self.device, self._failure.what, self._failure.fix)
            try:
                return await self._thread.run(call, limit_s + MARGIN_S)
            except TimeoutError:
                error: DeviceError = DeviceTimeout(
                    self.device, "its library does not return from a call", "unplug the camera, and plug it in"
                )
                await self._give_up(session, error)
                raise error from None
            except LinkLost as lost:
                await self._give_up(session, lost)
                raise

    async def _give_up(self, session: CameraSession, error: DeviceError) -> None:
        self._session = None
        self._note(error)
        with suppress(TimeoutError):
            await self._thread.run(session.close, MARGIN_S)
        self._changed.set()

    def _note(self, error: DeviceError) -> None:
        self._failure = error
        self._report.down(f"{error.what}: {error.fix}")


class GenICamCamera(GenICamDevice):
    """drivers.interfaces.Camera, AdjustableCamera and IdentifiedDevice. Each frame is exposed after it was asked for:

    triggered by software where the camera can, else the first of a stream that begins with the request.
    """

    async def grab(self, newer_than_s: float) -> CameraFrame:
        frame = await self._take_new(newer_than_s, CameraSession.take)
        height, width = frame.image.shape[:2]
        require_size(self.device, "the frames are", (width, height), self._image_size)
        return frame

    async def read_exposure(self) -> tuple[Exposure, ExposureRange] | None:
        """What is set and what can be; None without the feature. Raises DeviceError."""
        session = await self._await_session(self._timing.clock() + self._limit_s)
        return await self._ask(session, session.read_exposure, self._limit_s)

    async def set_exposure(self, wanted: Exposure) -> Exposure:
        """Set both within the camera's range, for the next frame. Raises DeviceError."""
        session = await self._await_session(self._timing.clock() + self._limit_s)
        return await self._ask(session, lambda: session.set_exposure(wanted), self._limit_s)
