"""A GenICam camera: pictures, exposure and gain."""

from collections.abc import Callable

from drivers.cameras.genicam.address import CameraAddress
from drivers.cameras.genicam.device import Library
from drivers.cameras.genicam.opened_device import LIMIT_S, GenICamDevice
from drivers.cameras.genicam.session import CameraSession
from drivers.errors import GarbledAnswer
from drivers.interfaces import CameraFrame, Exposure, ExposureRange
from drivers.timing import Timing


class GenICamCamera(GenICamDevice):
    """drivers.interfaces.Camera, AdjustableCamera and IdentifiedDevice. Each frame is exposed after it was asked for:

    triggered by software where the camera can, else the first of a stream that begins with the request.
    """

    def __init__(
        self,
        make_library: Callable[[CameraAddress], Library],
        address: CameraAddress,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float = LIMIT_S,
    ) -> None:
        super().__init__(make_library, address, timing, limit_s=limit_s)
        self._image_size = image_size

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`; raises a DeviceError."""
        frame = await self._take_new(newer_than_s, CameraSession.take)
        self._require_size(frame)
        return frame

    async def read_exposure(self) -> tuple[Exposure, ExposureRange] | None:
        """What is set and what can be; None without the feature. Raises DeviceError."""
        session = await self._opened(self._timing.clock() + self._limit_s)
        return await self._ask(session, session.read_exposure, self._limit_s)

    async def set_exposure(self, wanted: Exposure) -> Exposure:
        """Set both within the camera's range, for the next frame. Raises DeviceError."""
        session = await self._opened(self._timing.clock() + self._limit_s)
        return await self._ask(session, lambda: session.set_exposure(wanted), self._limit_s)

    def _require_size(self, frame: CameraFrame) -> None:
        height, width = frame.image.shape[:2]
        if self._image_size is not None and (width, height) != self._image_size:
            what = f"the frames are {width}×{height}, expected {self._image_size[0]}×{self._image_size[1]}"
            raise GarbledAnswer(self.device, what, "set the camera to the size its intrinsics were found at")
