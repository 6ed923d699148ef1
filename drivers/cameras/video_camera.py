"""A camera that OpenCV can open: a V4L2 index or path, a stream's URL, a video file."""

import asyncio
import http.client
import re
import socket
import ssl
import threading
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np

from drivers.backoff import Backoff
from drivers.cameras.decoding import require_size
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer, LinkLost
from drivers.interfaces import CameraFrame, LinkHealth
from drivers.link_status import LinkReport
from drivers.timing import Timing

LIMIT_S = 5.0
OPENING_SHARE = 0.8
"""A stream is waited for by this share of the limit, so that the cause is known at its end. FFmpeg waits 30 s."""
LATENCY_S = 0.1
"""Delay from exposure to `read`, with one buffer. Network streams need more."""
SETTLE_S = 5.0
"""Longest wait of `close` for a `read` that hangs; the thread is a daemon thread."""


class VideoCamera:
    """drivers.interfaces.Camera. A thread reads continuously and keeps only the newest frame with its time.

    A frame's exposure is dated after the arrival of the frame before it, minus `latency_s`. So the first frame after
    opening, which may have been buffered for any time, is never returned.
    """

    def __init__(
        self,
        source: int | str,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float = LIMIT_S,
        latency_s: float = LATENCY_S,
    ) -> None:
        self._source, self._timing = source, timing or Timing()
        self._image_size, self._limit_s, self._latency_s = image_size, limit_s, latency_s
        self._device = f"camera video:{source}"
        self._report = LinkReport(self._timing.clock)
        self._newest: CameraFrame | None = None
        self._refusal: DeviceError | None = None
        self._arrived = asyncio.Event()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def link(self) -> LinkHealth:
        return self._report.health

    def start(self) -> None:
        if self._thread is None:
            self._loop = asyncio.get_running_loop()
            self._thread = threading.Thread(target=self._read_continuously, name=f"reads {self._device}", daemon=True)
            self._thread.start()

    async def grab(self, newer_than_s: float) -> CameraFrame:
        deadline_s = max(self._timing.clock(), newer_than_s) + self._limit_s
        while True:
            newest = self._newest
            if newest is not None and newest.taken_at_s > newer_than_s:
                height, width = newest.image.shape[:2]
                require_size(self._device, "the frames are", (width, height), self._image_size)
                return newest
            if self._refusal is not None:
                raise self._refusal
            self._arrived.clear()
            arrived = asyncio.ensure_future(self._arrived.wait())
            in_time = await self._timing.wait_until_done(arrived, max(0.0, deadline_s - self._timing.clock()))
            arrived.cancel()
            if not in_time:
                raise self._nothing_fresh()

    async def close(self) -> None:
        self._ending.set()
        if self._thread is not None:
            await asyncio.to_thread(self._thread.join, SETTLE_S)
            self._thread = None
        self._report.down("closed")

    def _read_continuously(self) -> None:
        backoff = Backoff(self._timing.chance)
        while not self._ending.is_set():
            try:
                self._read_until_loss(backoff)
            except DeviceError as error:
                self._report.down(f"{error.what}: {error.fix}")
            except cv2.error as error:
                self._report.down(f"OpenCV cannot read it ({error.err})")
            self._ending.wait(backoff.next_wait_s())

    def _read_until_loss(self, backoff: Backoff) -> None:
        capture = self._open()
        try:
            period_s = self._file_period_s(capture)
            arrived_before_s: float | None = None
            while not self._ending.is_set():
                came, image = capture.read()
                if not came:
                    raise LinkLost(self._device, "no more frames come", "it is opened again by itself")
                arrived_s = self._timing.clock()
                if arrived_before_s is not None:
                    backoff.reset()
                    self._hand_over(CameraFrame(np.asarray(image, np.uint8), arrived_before_s - self._latency_s))
                arrived_before_s = arrived_s
                if period_s:
                    self._ending.wait(period_s)
        finally:
            capture.release()

    def _open(self) -> cv2.VideoCapture:
        path = f"/dev/video{self._source}" if isinstance(self._source, int) else self._source
        if "://" not in path and not Path(path).exists():
            raise DeviceUnreachable(self._device, f"there is no {path}", "plug the camera in, or correct the address")
        self._refusal = refusal_of(path, self._device, OPENING_SHARE * self._limit_s)
        if self._refusal is not None:
            self._wake()
            raise self._refusal
        stream, limit_ms = "://" in path, int(OPENING_SHARE * self._limit_s * 1e3)
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, limit_ms, cv2.CAP_PROP_READ_TIMEOUT_MSEC, limit_ms]
        capture = cv2.VideoCapture(path, cv2.CAP_FFMPEG, limits) if stream else cv2.VideoCapture(self._source)
        if not capture.isOpened():
            capture.release()
            fix = "check that it is a camera or a video, and the right to use it (group video)"
            if stream:
                fix = "check that the stream's server answers, path, user and password: ffprobe says why it does not"
            raise DeviceUnreachable(self._device, "it cannot be opened", fix)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        return capture

    def _file_period_s(self, capture: cv2.VideoCapture) -> float:
        """Frame period of a video file, played at its own speed; 0 for devices and streams, whose `read` blocks."""
        if isinstance(self._source, int) or not Path(self._source).is_file():
            return 0.0
        frames_per_s = float(capture.get(cv2.CAP_PROP_FPS))
        return 1 / frames_per_s if 0 < frames_per_s < 1000 else 0.04

    def _hand_over(self, frame: CameraFrame) -> None:
        self._newest = frame
        if not self._report.health.connected:
            self._report.up(f"frames of {frame.image.shape[1]}×{frame.image.shape[0]} come")
        self._wake()

    def _wake(self) -> None:
        """Let those who wait for a frame look again."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._arrived.set)

    def _nothing_fresh(self) -> DeviceError:
        if not self.link.connected:
            return DeviceUnreachable(self._device, self.link.detail, "it is opened again by itself")
        return DeviceTimeout(self._device, f"no fresh frame in {self._limit_s:g} s", "check the camera and its cable")


PORTS = {"rtsp": 554, "rtsps": 322, "http": 80, "https": 443}
STATUS = re.compile(rb"(?:RTSP|HTTP)/\d\.\d (\d{3}) ?([^\r\n]{0,80})")
TO_SIGN_IN = 401
"""The player signs in by itself, with the user and password of the address."""


def refusal_of(url: str, device: str, limit_s: float) -> DeviceError | None:
    """Why the server does not give this stream; None where it does, or where only the player can know.

    Waits for `limit_s` at most for the connection and for the answer.
    """
    parts = urlsplit(url)
    if parts.scheme not in PORTS or parts.hostname is None:
        return None
    address = (parts.hostname, parts.port or PORTS[parts.scheme])
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # whoever it is: the player decides whether to trust the certificate
    tls.check_hostname, tls.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(address, limit_s) as plain,
            tls.wrap_socket(plain, server_hostname=parts.hostname) if parts.scheme.endswith("s") else plain as server,
        ):
            server.sendall(_request(parts.scheme, parts.hostname, url, parts.path, parts.query))
            answer = server.recv(256)
    except TimeoutError:
        return None
    except ssl.SSLError as error:
        return GarbledAnswer(device, f"no TLS with {address[0]}:{address[1]} ({error.reason})", "check scheme and port")
    except OSError as error:
        what = f"nobody answers at {address[0]}:{address[1]} ({error.strerror or error})"
        return DeviceUnreachable(device, what, "check that the device is on, the address and the port")
    found = STATUS.match(answer)
    if found is None or (status := int(found[1])) < 400 or status == TO_SIGN_IN:
        return None
    reason = found[2].decode("latin-1").strip() or http.client.responses.get(status, "")
    what = f"the stream's server answers {status} {reason}"
    if status >= 500:
        return DeviceUnreachable(device, what, "the device is not ready; look at it")
    return GarbledAnswer(device, what, "check path, user and password of the address")


def _request(scheme: str, host: str, url: str, path: str, query: str) -> bytes:
    if scheme.startswith("rtsp"):
        bare = urlsplit(url)._replace(netloc=urlsplit(url).netloc.rpartition("@")[2]).geturl()
        return f"DESCRIBE {bare} RTSP/1.0\r\nCSeq: 1\r\nAccept: application/sdp\r\n\r\n".encode()
    target = (path or "/") + (f"?{query}" if query else "")
    return f"GET {target} HTTP/1.0\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode()
