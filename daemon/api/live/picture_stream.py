"""What GET /camera/stream sends: pictures of one camera with ids, and the target's corners in them."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from fastapi.responses import StreamingResponse
from numpy.typing import NDArray
from starlette.types import Receive, Scope, Send

from daemon.api.live.live_feed import json_of, require_room
from daemon.api.problems import problem_of
from daemon.api.schemas.cell import LookDocument
from daemon.application import Application, CellCamera
from daemon.http.problem_details import MEDIA_TYPE
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.shared_reading import RecentReading
from daemon.sessions.look import Look, look_at
from daemon.sessions.pictures import encode_picture
from drivers.errors import DeviceError
from drivers.interfaces import CameraFrame

BOUNDARY = b"handeyed-picture"
STREAM = f"multipart/x-mixed-replace; boundary={BOUNDARY.decode()}"

FAST_S, REST_S = 0.1, 0.5
"""Interval of pictures while they change, and while they do not."""

SEARCHED_PX = 960
"""Width of the picture that the target is searched in: it is found there as at full size, in a quarter of the time."""

AFFORDABLE_S = 0.15
"""After a search that took longer none begins for as long: the others are pictures without corners."""

THUMBNAIL, CHANGE_LEVELS = (32, 20), 0.7
"""Size of a thumbnail, and mean change of its grey levels above which something moves; noise of a sensor makes less."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture, the target in it where it was searched, and files of it by their width, made when first asked for."""

    number: int
    taken_at_s: float
    image: NDArray[np.uint8]
    look: Look | None
    files: dict[int, bytes] = field(default_factory=dict)


def working_run(app: Application) -> RunRecord | None:
    """The run that uses the camera now: one in progress, unless it waits for its operator or is a jog."""
    run = app.supervisor.in_progress
    return None if run is None or run.state is RunState.WAITING or run.kind == "jog" else run


class PictureStream:
    """Pictures of one camera, taken once for all who listen; while a run works those that it takes, and none for this.

    Each listener asks for the next one when it has sent the last: a slow one misses pictures.
    """

    def __init__(self, app: Application, camera: CellCamera) -> None:
        self._app, self._camera, self._turns = app, camera, camera.operations.cell.camera_turns
        self._next = RecentReading(self._take, app.clock.monotonic_s, 0.0)
        self.listeners: set[StreamedPictures] = set()
        self._due_s = self._search_due_s = float("-inf")
        self._newest: Shown | DeviceError | None = None
        self._thumbnail: NDArray[np.float32] | None = None

    async def parts(self, width: int) -> AsyncIterator[bytes]:
        """The stream's bytes for one listener. Ends when the daemon stops."""
        yield b"--%b\r\n" % BOUNDARY
        ended, sent = asyncio.create_task(self._app.events.ended.wait()), None
        try:
            while not ended.done():
                reading = asyncio.create_task(self._next.read())
                try:
                    await asyncio.wait([reading, ended], return_when=asyncio.FIRST_COMPLETED)
                finally:
                    reading.cancel()  # which a reading that is done takes no notice of
                if reading.done() and (shown := reading.result()) is not None and shown is not sent:
                    sent = shown
                    yield await self._part(shown, width)
        finally:
            ended.cancel()

    async def _part(self, shown: Shown | DeviceError, width: int) -> bytes:
        """A picture with its id, age and corners; or as a problem why there is none."""
        if isinstance(shown, DeviceError):
            head = {"Content-Type": MEDIA_TYPE}
            body = problem_of(shown).model_dump_json(exclude_none=True).encode()
        else:
            if width not in shown.files:
                encoding = self._app.service_workers.run(encode_picture, shown.image, "image/jpeg", width)
                shown.files[width] = await encoding
            body = shown.files[width]
            age_s = self._app.clock.monotonic_s() - shown.taken_at_s
            head = {"Content-Type": "image/jpeg", "Handeyed-Picture": f"{shown.number}"}
            head["Handeyed-Age-S"] = f"{max(0.0, age_s):.3f}"
            if shown.look is not None:
                head["Handeyed-Look"] = json_of(LookDocument.of_look(shown.look))
        lines = "".join(f"{name}: {value}\r\n" for name, value in {**head, "Content-Length": len(body)}.items())
        return b"%b\r\n%b\r\n--%b\r\n" % (lines.encode(), body, BOUNDARY)

    async def _take(self) -> Shown | DeviceError | None:
        """The newest picture when the next one is due; the same as before while there is none."""
        clock = self._app.clock
        await clock.sleep(max(0.0, self._due_s - clock.monotonic_s()))
        began_s, pause_s, works = clock.monotonic_s(), REST_S, working_run(self._app) is not None
        try:
            if self.listeners and not works:
                await self._turns.preview(SEARCHED_PX)
            number, frame = self._turns.newest
            if frame is not None and not (isinstance(self._newest, Shown) and self._newest.number == number):
                changed, self._newest = await self._show(number, frame, searches=not works)
                pause_s = FAST_S if changed else REST_S
        except DeviceError as error:
            if not isinstance(self._newest, DeviceError):
                self._newest = error
            self._app.device_watch.note(self._camera.name, error)
        self._due_s = began_s + (FAST_S if works else pause_s)
        return self._newest

    async def _show(self, number: int, frame: CameraFrame, searches: bool) -> tuple[bool, Shown]:
        """Whether the picture differs from the one before; and the picture, with its corners if that is affordable."""
        run, clock, look = self._app.service_workers.run, self._app.clock, None
        image, thumbnail = await run(reduce, frame.image)
        if searches and (began_s := clock.monotonic_s()) >= self._search_due_s:
            target = self._camera.settings.target
            look = await run(look_at, replace(frame, image=image), target, clock.timestamp())
            took_s = clock.monotonic_s() - began_s
            self._search_due_s = clock.monotonic_s() + (took_s if took_s > AFFORDABLE_S else 0.0)
        before, self._thumbnail = self._thumbnail, thumbnail
        changed = before is None or float(np.abs(thumbnail - before).mean()) > CHANGE_LEVELS
        return changed, Shown(number, frame.taken_at_s, image, look)


def reduce(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """The picture at most SEARCHED_PX wide, and a grey thumbnail."""
    height, width = image.shape[:2]
    if width > SEARCHED_PX:
        size = SEARCHED_PX, round(height * SEARCHED_PX / width)
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    thumbnail = np.asarray(cv2.resize(image, THUMBNAIL, interpolation=cv2.INTER_AREA), np.float32)
    return image, thumbnail.reshape(*THUMBNAIL, -1).mean(axis=2)


class StreamedPictures(StreamingResponse):
    """The stream for one listener at `address`; it raises TooManyListeners when it begins."""

    def __init__(self, stream: PictureStream, address: str, width: int) -> None:
        super().__init__(stream.parts(width), media_type=STREAM, headers={"Cache-Control": "no-store"})
        self._listeners, self.address = stream.listeners, address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        require_room([listener.address for listener in self._listeners], self.address)
        self._listeners.add(self)
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._listeners.discard(self)
