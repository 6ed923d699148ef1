"""Camera and scanner of the mock cell over HTTP, as an ASGI application.

GET /camera/snapshot.png and /scanner/cloud.ply, and of further ones /cameras/NAME/snapshot.png and
/scanners/NAME/cloud.pcd (an organised cloud of the target), capture on request at the flange's true pose. Responses
carry `X-Taken-At-Age-S` (age of the capture when the request arrived; 0 for one made on request) and `X-Capture-Id`
(a counter per device); those of a camera that warms up and reports its temperature, `X-Camera-Temperature-C`.

A camera's `?width=960`, which `X-Scales-By` names: a sketch for screens, as JPEG, which counts as no capture.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial, reduce
from time import monotonic
from typing import Literal
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform, vector_from_rotation
from mock_robot.faults.board import DeviceFault, FaultBoard
from mock_robot.scene.camera_view import render, sketch
from mock_robot.scene.printed_target import print_target
from mock_robot.scene.scanner_view import ScannerModel, cloud_ply, organised_pcd, scan
from mock_robot.truth.truth import CameraWarming, CellTruth

Device = Literal["camera", "scanner"]

STILL_MM, STILL_RAD = 1e-4, 1e-7
SMEARED_POSES, SCAN_BANDS = 7, 12
PNG_SPEED = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
BEHIND = transform(np.eye(3), [0.0, 0.0, -1e4])


@dataclass(frozen=True, eq=False)
class Exposure:
    """True flange poses at the start and the end of a capture."""

    begin_base_T_flange: Array
    end_base_T_flange: Array

    def poses(self, count: int) -> list[Array]:
        """base_T_flange at `count` evenly spaced moments; one pose when the flange stood still."""
        moved_mm, turned_rad = difference(self.begin_base_T_flange, self.end_base_T_flange)
        if moved_mm < STILL_MM and turned_rad < STILL_RAD:
            return [self.begin_base_T_flange]
        step = inverse(self.begin_base_T_flange) @ self.end_base_T_flange
        turn = vector_from_rotation(step[:3, :3])
        return [
            self.begin_base_T_flange @ transform(rotation_from_vector(part * turn), part * step[:3, 3])
            for part in (np.arange(count) + 0.5) / count
        ]


def picture(
    truth: CellTruth, exposure: Exposure, hidden: bool, rng: np.random.Generator, width: int = 0
) -> NDArray[np.uint8]:
    """Camera image (h, w), smeared when the flange moved. `hidden`: the target is covered. `width`: of a sketch.

    What lies around the target stays as it is while the flange stands; the noise is drawn from `rng`.
    """
    place = crc32(np.round(exposure.begin_base_T_flange[:3], 2).tobytes())  # one number within 0.01 mm and 0.6 degrees
    surroundings = np.random.default_rng([truth.seed, place])
    poses = [
        BEHIND if hidden else truth.camera_T_target(base_T_flange) for base_T_flange in exposure.poses(SMEARED_POSES)
    ]
    if width:
        printed = print_target(truth.target, truth.sheet)
        return sketch(truth.camera, printed, poses[-1], truth.optics, surroundings, width)
    return render(truth.camera, truth.target, np.array(poses), truth.optics, rng, truth.sheet, surroundings)


def cloud(truth: CellTruth, exposure: Exposure, rng: np.random.Generator) -> NDArray[np.float32]:
    """Points (n, 3) in the scanner frame, mm; sheared when the flange moved."""
    part_T_base = inverse(truth.base_T_part)
    poses = [part_T_base @ truth.base_T_scanner(pose) for pose in exposure.poses(SCAN_BANDS)]
    return scan(ScannerModel(noise_mm=truth.noise.scanner_mm), poses, rng)


EXPOSURE_S: dict[Device, float] = {"camera": 0.008, "scanner": 0.15}
RANGE_OF_TARGET_MM = (200.0, 1500.0)
"""Where a further scanner measures: the views of a calibration are nearer than those of a part."""

MEDIA_TYPES: dict[Device, str] = {"camera": "image/png", "scanner": "application/x-ply"}

Develop = Callable[[Exposure, tuple[DeviceFault, ...], np.random.Generator, int, int], bytes]
"""The file of an exposure, with these faults, the number of the capture, and the width of a sketch, else 0."""


@dataclass(frozen=True)
class Capture:
    """A captured file, when its capture began, and its number."""

    content: bytes
    began_s: float
    number: int


class DeviceApp(Starlette):
    def __init__(self, truth: CellTruth, flange_now: Callable[[], Array], faults: FaultBoard) -> None:
        """`flange_now`: true base_T_flange; it is called at the start and end of each capture, on the event loop."""

        def station(device: Device, develop: Develop, number: int = 0, media_type: str | None = None) -> _Station:
            warming, seed = truth.warming if device == "camera" else None, truth.seed + number
            return _Station(device, seed, flange_now, faults, develop, media_type or MEDIA_TYPES[device], warming)

        stations = {
            "/camera/snapshot.png": station("camera", partial(_camera, truth)),
            "/scanner/cloud.ply": station("scanner", partial(_scanner, truth)),
        }
        for number, name in enumerate(truth.further_cameras, start=1):
            stations[f"/cameras/{name}/snapshot.png"] = station(
                "camera", partial(_camera, truth.of_camera(name)), number
            )
        for number, name in enumerate(truth.further_scanners, start=1):
            develop = partial(_scanner_of_target, truth, name)
            stations[f"/scanners/{name}/cloud.pcd"] = station("scanner", develop, number, "application/x-pcd")
        super().__init__(routes=[Route(path, each.answer) for path, each in stations.items()])


@dataclass(eq=False)
class _Station:
    """One device: captures one at a time, renders in a thread, keeps its last file."""

    _device: Device
    _seed: int
    _flange_now: Callable[[], Array]
    _faults: FaultBoard
    _develop: Develop
    _media_type: str
    _warming: CameraWarming | None
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)
    _last: Capture | None = field(default=None, init=False)
    _captures: int = field(default=0, init=False)

    async def answer(self, request: Request) -> Response:
        asked_s = monotonic()
        struck = self._faults.strike_device(self._device)
        status = max((fault.status for fault in struck), default=200)
        if status != 200:
            return PlainTextResponse(f"the {self._device} is not ready", status)
        width = int(request.query_params.get("width", 0)) if self._device == "camera" else 0
        async with self._turn:
            capture = await self._capture(struck, width)
        await asyncio.sleep(sum(fault.delay_s for fault in struck))
        lying = any(fault.repeats == "lying" for fault in struck)
        age_s = 0.0 if lying else max(0.0, asked_s - capture.began_s)
        number = self._captures if lying else capture.number
        headers = {"X-Taken-At-Age-S": f"{age_s:.4f}", "X-Capture-Id": str(number), "Cache-Control": "no-store"}
        if self._device == "camera":
            headers["X-Scales-By"] = "width"
        if self._warming is not None and self._warming.reported:
            headers["X-Camera-Temperature-C"] = f"{self._warming.temperature_c(capture.number):.2f}"
        return Response(capture.content, media_type="image/jpeg" if width else self._media_type, headers=headers)

    async def _capture(self, struck: tuple[DeviceFault, ...], width: int) -> Capture:
        self._captures += not width
        if self._last is not None and any(fault.repeats != "no" for fault in struck):
            return self._last
        number, began_s = self._captures, monotonic()
        begin = self._flange_now()
        await asyncio.sleep(EXPOSURE_S[self._device])
        exposure = Exposure(begin, self._flange_now())
        rng = np.random.default_rng([self._seed, len(self._device), number])
        content = await asyncio.to_thread(self._develop, exposure, struck, rng, number, width)
        content = reduce(lambda now, spoil: spoil(now), [fault.content for fault in struck if fault.content], content)
        capture = Capture(content, began_s, number)
        if not width:
            self._last = capture
        return capture


def _camera(
    truth: CellTruth,
    exposure: Exposure,
    struck: tuple[DeviceFault, ...],
    rng: np.random.Generator,
    number: int,
    width: int,
) -> bytes:
    hidden = any(fault.hides_target for fault in struck)
    image = picture(truth.at_picture(number), exposure, hidden, rng, width)
    image = reduce(lambda now, spoil: spoil(now), [f.picture for f in struck if f.picture], image)
    _, encoded = cv2.imencode(".jpg", image) if width else cv2.imencode(".png", image, PNG_SPEED)
    return encoded.tobytes()


def _scanner(
    truth: CellTruth, exposure: Exposure, struck: tuple[DeviceFault, ...], rng: np.random.Generator, *_: int
) -> bytes:
    points = cloud(truth, exposure, rng)
    return cloud_ply(reduce(lambda now, spoil: spoil(now), [f.points for f in struck if f.points], points))


def _scanner_of_target(
    truth: CellTruth, name: str, exposure: Exposure, _struck: object, rng: np.random.Generator, *_: int
) -> bytes:
    scanner_T_target = truth.scanner_T_target(name, exposure.end_base_T_flange)
    model = ScannerModel(range_mm=RANGE_OF_TARGET_MM, noise_mm=truth.noise.scanner_mm)
    return organised_pcd(model, truth.target, scanner_T_target, truth.optics, rng, truth.sheet)
