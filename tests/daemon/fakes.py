"""A cell that stands in memory: devices that satisfy the interfaces, with a known truth between them."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Configuration, UnreachablePoseError
from calibration.targets import Chessboard
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from drivers.errors import DeviceError, LinkLost
from drivers.interfaces import (
    CameraFrame,
    CaptureSettings,
    LinkHealth,
    MoveGoal,
    PoseReading,
    RobotCapabilities,
    RobotStatus,
    ScannedCloud,
    Standstill,
)
from drivers.robots.abb.robtarget import UNUSED_AXIS

BOARD = Chessboard(11, 8, 20.0)
CAMERA = CameraModel(np.array([[900.0, 0, 320], [0, 900, 240], [0, 0, 1]]), np.zeros(5), (640, 480))
FLANGE_T_CAMERA = transform(rotation_from_vector([0.02, -0.03, 1.5]), [40.0, -25.0, 90.0])
BASE_T_TARGET = transform(rotation_from_vector([np.pi, 0, 0]), [800.0, 100.0, 300.0])


def poses_around_the_target(count: int = 5) -> list[Array]:
    """base_T_flange (4, 4) from which the board is in view, turned about different axes, at 420 and 640 mm by turns."""
    middle = BASE_T_TARGET @ np.array([*BOARD.points_mm.mean(axis=0), 1.0])
    poses = []
    for k in range(count):
        angle = 2 * np.pi * k / count
        tilt = rotation_from_vector(np.array([np.cos(angle), np.sin(angle), 0.0]) * 0.45)
        roll = rotation_from_vector([0, 0, 0.4 * np.sin(2.3 * k)])
        target_R_camera = tilt @ roll
        at = -target_R_camera[:, 2] * (640.0 if k % 2 else 420.0)
        target_T_camera = transform(target_R_camera, at + (inverse(BASE_T_TARGET) @ middle)[:3])
        poses.append(BASE_T_TARGET @ target_T_camera @ inverse(FLANGE_T_CAMERA))
    return poses


def pose_reading(x_mm: float = 0.0, turn_deg: float = 0.0, still: bool = True) -> PoseReading:
    """A flange near the base frame's origin: shifted along x, turned about z."""
    pose = transform(rotation_from_vector([0, 0, np.radians(turn_deg)]), [x_mm, 0.0, 0])
    return PoseReading(pose, Configuration(0, 0, 0, 0), (UNUSED_AXIS,) * 6, still, 0.0)


@dataclass
class FakeRobot:
    """Jumps to its goals. `before_move` may raise, wait, or break the link."""

    base_T_flange: Array = field(default_factory=poses_around_the_target(1)[0].copy)
    external_axes: tuple[float, ...] = (UNUSED_AXIS,) * 6
    armed: bool = False
    status: dict[str, bool] = field(default_factory=dict)
    lost: bool = False
    goals: list[MoveGoal] = field(default_factory=list)
    stops: int = 0
    before_move: Callable[[int], Awaitable[None]] | None = None
    drift_mm: float = 0.0
    reads: int = 0
    arrived_at_s: float = 0.0
    broken_with: DeviceError | None = None
    requests: int = 0
    """How often it was asked or commanded anything."""
    deaf: bool = False
    """A controller that accepts a stop and stays armed."""

    @property
    def link(self) -> LinkHealth:
        return LinkHealth(not self.lost, "lost" if self.lost else "connected", 0.0)

    @property
    def capabilities(self) -> RobotCapabilities:
        return RobotCapabilities(moves=True, pose_convention="the flange in the base frame")

    def start(self) -> None:
        pass

    def _alive(self) -> None:
        self.requests += 1
        self._raise_when_broken()

    def _raise_when_broken(self) -> None:
        if self.broken_with is not None:
            raise self.broken_with
        if self.lost:
            raise LinkLost("robot fake", "the connection broke", "look at the cable")

    async def read_pose(self) -> PoseReading:
        self._alive()
        pose = self.base_T_flange.copy()
        self.reads += 1
        pose[0, 3] += self.reads * self.drift_mm
        return PoseReading(pose, Configuration(0, 0, 0, 0), self.external_axes, True, time.monotonic())

    async def read_joints(self) -> Array:
        self._alive()
        with suppress(UnreachablePoseError):
            return np.asarray(find_arm("IRB 1600-6/1.45").inverse(self.base_T_flange)[0])
        return np.zeros(6)

    async def read_status(self) -> RobotStatus:
        self._alive()
        defaults = {"motors_on": True, "automatic": True, "emergency_stop": False, "moving": False, "in_position": True,
                    "program_running": True, "speed_limited": False}  # fmt: skip
        return RobotStatus(**{**defaults, **self.status}, armed=self.armed, taken_at_s=time.monotonic())

    async def set_armed(self, armed: bool) -> None:
        self._alive()
        self.armed = armed

    async def move_to(self, goal: MoveGoal) -> None:
        self._alive()
        assert self.armed
        self.goals.append(goal)
        if self.before_move is not None:
            await self.before_move(len(self.goals))
        self._alive()
        self.base_T_flange = goal.base_T_flange.copy()
        self.arrived_at_s = time.monotonic()

    async def stop_and_disarm(self) -> None:
        self.stops += 1
        self._alive()
        self.armed = self.armed and self.deaf

    async def read_standstill(self) -> Standstill:
        """Not counted among the requests: the daemon asks by itself every second."""
        self._raise_when_broken()
        return Standstill(standing=not self.status.get("moving", False), disarmed=not self.armed)

    async def close(self) -> None:
        pass


@dataclass
class FakeCamera:
    """Sees the board from where the robot stands; `blind` shows a grey wall instead."""

    robot: FakeRobot
    blind: Callable[[int], bool] = lambda picture: False
    failing: DeviceError | None = None
    size: tuple[int, int] = CAMERA.image_size
    pictures: int = 0
    asked: list[tuple[float, float]] = field(default_factory=list)
    """When the arm was last moved, and how new a picture was asked for."""
    capture: CaptureSettings | None = None
    flange_T_camera: Array = field(default_factory=FLANGE_T_CAMERA.copy)

    @property
    def link(self) -> LinkHealth:
        return LinkHealth(self.failing is None, str(self.failing or "connected"), 0.0)

    def start(self) -> None:
        pass

    async def grab(self, newer_than_s: float) -> CameraFrame:
        if self.failing is not None:
            raise self.failing
        self.pictures += 1
        self.asked.append((self.robot.arrived_at_s, newer_than_s))
        taken_at_s = time.monotonic()
        image: Any = np.full(self.size[::-1], 128, np.uint8)
        if not self.blind(self.pictures):
            image = picture_of_the_board(self.robot.base_T_flange @ self.flange_T_camera @ inverse(FLANGE_T_CAMERA))
        return CameraFrame(image, taken_at_s, capture=self.capture)

    async def close(self) -> None:
        pass


def picture_of_the_board(base_T_flange: Array) -> Any:
    """What the camera sees from a pose of the flange; not to be written to, since the next run sees it again."""
    return _drawn_board(base_T_flange.tobytes())


@lru_cache(maxsize=64)
def _drawn_board(base_T_flange_bytes: bytes) -> Any:
    """A drawn board through a homography, supersampled."""
    base_T_flange = np.frombuffer(base_T_flange_bytes).reshape(4, 4)
    scale, fine = 10, 3
    columns, rows = BOARD.columns + 1, BOARD.rows + 1
    cell = int(BOARD.pitch_mm * scale) // 10
    squares = np.kron((np.indices((rows, columns)).sum(axis=0) % 2) * 255, np.ones((cell, cell))).astype(np.uint8)
    sheet = cv2.copyMakeBorder(squares, cell, cell, cell, cell, cv2.BORDER_CONSTANT, value=(255.0,))
    mm_per_px = BOARD.pitch_mm / cell
    target_from_sheet = np.array([[mm_per_px, 0, mm_per_px / 2 - 2 * BOARD.pitch_mm],
                                  [0, mm_per_px, mm_per_px / 2 - 2 * BOARD.pitch_mm], [0, 0, 1]])  # fmt: skip
    camera_T_target = inverse(base_T_flange @ FLANGE_T_CAMERA) @ BASE_T_TARGET
    pixels = CAMERA.matrix @ camera_T_target[:3, [0, 1, 3]]
    finer = np.array([[fine, 0, (fine - 1) / 2], [0, fine, (fine - 1) / 2], [0, 0, 1]])
    size = (CAMERA.image_size[0] * fine, CAMERA.image_size[1] * fine)
    warped = cv2.warpPerspective(sheet, finer @ pixels @ target_from_sheet, size, borderValue=(128.0,))
    picture = cv2.resize(warped, CAMERA.image_size, interpolation=cv2.INTER_AREA)
    picture.setflags(write=False)
    return picture


@dataclass
class FakeScanner:
    """A few points in front of the scanner, as PLY."""

    failing: DeviceError | None = None
    content: bytes | None = None
    scans: int = 0

    @property
    def link(self) -> LinkHealth:
        return LinkHealth(self.failing is None, str(self.failing or "connected"), 0.0)

    def start(self) -> None:
        pass

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        if self.failing is not None:
            raise self.failing
        self.scans += 1
        points = np.random.default_rng(self.scans).normal([0, 0, 500], 50, (100, 3))
        return ScannedCloud(self.content or ply_of(points), "application/x-ply", time.monotonic())

    async def close(self) -> None:
        pass


def ply_of(points: Array) -> bytes:
    """Binary PLY of float32 x, y, z."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return header.encode() + points.astype("<f4").tobytes()


def points_of(ply: bytes) -> Array:
    """(n, 3) of a binary PLY of float32 x, y, z."""
    return np.frombuffer(ply[ply.index(b"end_header\n") + 11 :], "<f4").reshape(-1, 3).astype(float)


class Gate:
    """Lets a test hold the arm in the middle of a move, and know that it is there."""

    def __init__(self, at_move: int) -> None:
        self.at_move = at_move
        self.reached = asyncio.Event()
        self.open = asyncio.Event()

    async def __call__(self, move: int) -> None:
        if move == self.at_move:
            self.reached.set()
            await self.open.wait()
